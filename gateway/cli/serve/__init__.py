"""Commands that serve: a gateway, a demonstration, a simulated mount."""

from __future__ import annotations

# Loaded here, where the stack is low: deep in the chain of imports CPython 3.11 maps and unmaps a piece of its stack at
# every call, and compiling one regular expression of platformdirs takes 5 ms longer.
import gateway.system.files  # noqa: F401
