"""Alpaca over HTTP: requests become lines for the surface, replies become JSON; and discovery of the port."""
