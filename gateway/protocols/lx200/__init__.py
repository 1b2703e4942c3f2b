"""Meade LX200: the protocol of revision L (2002) and its later extensions."""
