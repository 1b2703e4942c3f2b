"""Bytes to named fields and back, by the tables under ``mappings``."""
