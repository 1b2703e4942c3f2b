"""Proofs that run longer than a test may: see README.md."""
