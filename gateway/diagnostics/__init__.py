"""Tools that examine a gateway from outside: command tables, rehearsals, recordings, captures and port detection."""
