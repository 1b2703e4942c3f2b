"""The simulated Meade."""
