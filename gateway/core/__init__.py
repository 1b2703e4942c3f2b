"""Values that all other layers share: operations, errors, signals, and the log of the wire."""
