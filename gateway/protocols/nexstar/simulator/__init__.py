"""The simulated Celestron hand control."""
