"""Meade LX200 (revision L, 2002, and what came after it)."""
