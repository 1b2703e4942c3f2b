"""Replay a recording, one event loop iteration ("turn") at a time."""
