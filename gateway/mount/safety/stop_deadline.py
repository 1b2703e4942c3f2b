"""The latest moment at which a stop still helps, should nothing newer be seen of the mount before it.

The limits are watched by positions. One that comes late, for whatever reason, must not lead farther than one that comes
in time: at every look the deadline is set by what is known then.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable


class StopDeadline:
    """``passed`` is called with the limit that was named, once, unless the deadline is set anew or taken back."""

    def __init__(self, loop: asyncio.AbstractEventLoop, passed: Callable[[str], None]) -> None:
        self._loop, self._passed = loop, passed
        self._handle: asyncio.TimerHandle | None = None

    def arm(self, seconds: float, limit: str) -> None:
        """Stop in so many seconds at the latest; an earlier deadline stays."""
        at = self._loop.time() + max(0.0, seconds)
        if self._handle is not None and self._handle.when() <= at:
            return
        self.disarm()
        self._handle = self._loop.call_at(at, self._passes, limit)

    def disarm(self) -> None:
        """No limit is near any more, or the next position has come."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None

    def _passes(self, limit: str) -> None:
        self._handle = None
        self._passed(limit)
