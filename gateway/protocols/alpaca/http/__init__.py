"""Alpaca over HTTP: requests become lines for the surface, its answers become JSON, and programs find the port."""
