"""The NexStar surface: what its rows in ``mappings/nexstar/surface.toml`` call."""
