"""A whole gateway: its configuration, state on disk, control by other processes, discovery on the network."""
