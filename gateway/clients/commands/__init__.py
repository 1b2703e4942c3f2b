"""The commands of one connection: taken in order, carried out, and answered in time."""
