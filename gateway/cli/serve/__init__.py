"""Commands that serve: a gateway, a demonstration, a simulated mount."""
