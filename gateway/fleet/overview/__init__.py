"""A web page with all mounts on a broker, and STOP for each of them and for all."""
