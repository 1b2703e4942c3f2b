"""Virtual time for tests: the product's own loop, by its short name."""

from gateway.diagnostics.virtual_time import VirtualLoop, run

__all__ = ["VirtualLoop", "run"]
