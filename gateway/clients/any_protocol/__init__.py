"""A port for every protocol: each connection is told by its first bytes."""
