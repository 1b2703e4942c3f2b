"""A port for every protocol."""
