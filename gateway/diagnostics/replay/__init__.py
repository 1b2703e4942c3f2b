"""Playing a recording again, turn by turn."""
