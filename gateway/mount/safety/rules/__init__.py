"""One rule a file: what it is given, and what it says."""
