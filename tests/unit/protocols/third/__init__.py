"""A protocol that is not of this gateway, as its author would add it: a folder, a folder of mappings, one entry."""
