"""Clients: how they are admitted, recognised, and answered in order."""
