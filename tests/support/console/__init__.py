"""Pages of the console in tests: their scripts run in Node, over a network that delays and a simulated gateway."""
