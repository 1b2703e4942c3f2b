"""Commands that inspect ports, this computer, command tables and recordings."""
