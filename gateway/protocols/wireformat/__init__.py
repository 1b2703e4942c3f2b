"""Converts between bytes and named fields, by the tables under ``mappings``."""
