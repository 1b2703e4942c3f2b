"""A port for every protocol: the first bytes of a connection decide which one its client speaks."""
