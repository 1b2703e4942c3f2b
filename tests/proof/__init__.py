"""Long proofs: run by hand, not by the suite."""
