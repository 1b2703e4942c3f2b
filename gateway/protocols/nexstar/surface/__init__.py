"""The NexStar surface: the handlers that rows of ``mappings/nexstar/surface.toml`` call."""
