"""The Alpaca surface: what its rows in ``mappings/alpaca/surface.toml`` call."""
