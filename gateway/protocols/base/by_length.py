"""Framing of what has a length instead of an end, where quiet on the line tells one command from the next.

What begins nothing is dropped with all that comes with it, until the line has been quiet for a tenth of a second. Half
a command, whose rest has not come within a second, is dropped as well; so what waits is never longer than one command.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from gateway.protocols.base.frames import WholeFramer

#: Seconds of quiet after which the rest of a command is no longer expected.
QUIET_GAP = 1.0
#: Seconds of quiet after which bytes may begin a command again, behind some that could not.
RESYNC_GAP = 0.1


class LengthFramer(WholeFramer, ABC):
    """Bytes in, whole commands out. ``noise`` and ``half`` are why bytes are of no use, in words."""

    noise: str
    half: str
    #: Whether what comes after half a command may be its other half, and counts only after more quiet.
    wary = False

    def __init__(self) -> None:
        super().__init__()
        self._heard = 0.0

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The commands that these bytes complete, in order. ``now`` is any clock, in seconds."""
        if not data:
            return []
        self.dropped.clear()
        quiet, self._heard = now - self._heard, now
        if quiet >= RESYNC_GAP:
            self._lost = False
        if quiet >= QUIET_GAP and self._pending:
            self.dropped.add(bytes(self._pending), self.half)
            self._pending.clear()
            self._lost = self.wary
        if self._lost:
            self.dropped.add(data, self.noise)
            return []
        return self._cut(data)

    @abstractmethod
    def _cut(self, data: bytes) -> list[bytes]:
        """The commands that are whole with these bytes."""
