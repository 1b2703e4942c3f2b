"""The site of the mount and the time: the sources of both, and which of them the limits use."""
