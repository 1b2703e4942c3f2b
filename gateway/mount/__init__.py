"""One mount: its line, its readings, its motion, its limits, and its site and clock."""
