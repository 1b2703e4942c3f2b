"""The rules that keep a mount within its owner's limits."""
