"""What the operating system gives a process: locks, folders, file limits, streams, the journal."""
