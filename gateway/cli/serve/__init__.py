"""Commands that serve: a gateway, a demonstration, a simulated mount."""

from __future__ import annotations

# Imported here, where the call stack is short: deep in a chain of imports CPython 3.11 maps and unmaps a piece of its
# stack at every call, and compiling one regular expression of platformdirs takes 5 ms longer.
import gateway.system.files  # noqa: F401
