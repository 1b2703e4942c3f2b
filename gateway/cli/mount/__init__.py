"""Commands that speak to a running gateway about its mount."""
