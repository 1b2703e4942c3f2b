"""The alarm: rings when a limit is about to be reached and nothing newer has been seen of the mount.

The guard acts on positions. One that comes late, for whatever reason, must not lead farther than one that comes in
time: at every look the guard sets the alarm for the last moment at which a stop still helps, by what it knows then.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable


class Alarm:
    """``ring`` is called with the reason that was given, once, unless the alarm is set anew or off before."""

    def __init__(self, loop: asyncio.AbstractEventLoop, ring: Callable[[str], None]) -> None:
        self._loop, self._ring = loop, ring
        self._handle: asyncio.TimerHandle | None = None

    def within(self, seconds: float, reason: str) -> None:
        """Ring after so many seconds, if it does not ring before."""
        at = self._loop.time() + max(0.0, seconds)
        if self._handle is not None and self._handle.when() <= at:
            return
        self.off()
        self._handle = self._loop.call_at(at, self._rings, reason)

    def off(self) -> None:
        """Nothing is to be feared any more, or the next look has come."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None

    def _rings(self, reason: str) -> None:
        self._handle = None
        self._ring(reason)
