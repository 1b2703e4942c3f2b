"""The motion of a mount: what clients ordered, what the position shows, and the operations that this requires."""
