"""Looking at a gateway from outside: the tables, rehearsals, recordings, captures, detection."""
