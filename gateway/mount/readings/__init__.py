"""The readings of a mount: cached, polled, shared by all clients, and extrapolated while the mount moves."""
