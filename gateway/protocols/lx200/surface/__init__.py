"""The LX200 surface: the functions that the rows of ``mappings/lx200/surface.toml`` call."""
