"""The LX200 surface: what its rows in ``mappings/lx200/surface.toml`` call."""
