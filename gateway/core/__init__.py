"""Values that every other part speaks in: operations, errors, and the log of the wire."""
