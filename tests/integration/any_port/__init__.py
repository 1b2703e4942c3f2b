"""A port for every protocol, in processes of the product."""
