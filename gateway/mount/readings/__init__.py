"""What is told of where a mount points: what it said last, and where that leads until now while it moves."""
