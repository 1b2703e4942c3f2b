"""Celestron NexStar hand control (versions 1.2 to 5.x)."""
