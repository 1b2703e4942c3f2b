"""Programs: how they are let in, told apart, and answered in order."""
