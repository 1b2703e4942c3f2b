"""Commands that look at ports, commands, tables and recordings."""
