"""The hub of a mount: its snapshot, its motions, its site and clock, in one place for all clients."""

from __future__ import annotations

from gateway.hub.core import Hub, Policy
from gateway.hub.snapshot import FRESH, MISSING

__all__ = ["FRESH", "MISSING", "Hub", "Policy"]
