"""A gateway put together: configuration, state on disk, control from outside, discovery on the network."""
