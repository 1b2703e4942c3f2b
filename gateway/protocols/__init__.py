"""One folder per protocol: its framing, its surface, its driver and its simulator."""
