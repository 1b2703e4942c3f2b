"""Where the mount stands and what time it is: the sources of both, and which of them the limits go by."""
