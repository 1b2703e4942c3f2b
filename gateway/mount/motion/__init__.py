"""What moves a mount: what was ordered, what is seen of it, and what must still be done about the difference."""
