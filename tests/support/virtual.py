"""Virtual time for tests: the product's own event loop under a short name."""

from gateway.diagnostics.virtual_time import VirtualLoop, run

__all__ = ["VirtualLoop", "run"]
