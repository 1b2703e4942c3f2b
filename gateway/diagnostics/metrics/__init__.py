"""Figures of a running gateway for Prometheus, counted without asking a mount anything."""
