"""The Alpaca surface: the functions that the rows of ``mappings/alpaca/surface.toml`` call."""
