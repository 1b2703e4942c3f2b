"""mount-gateway: a protocol translator between Meade LX200 and Celestron NexStar telescope mounts."""

from __future__ import annotations

__version__ = "0.1.0"
