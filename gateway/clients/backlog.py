"""How far a connection is behind: was what is read of it sent just now, before the last stops, or long ago?

A connection that sends more than is read at a time is behind. Nobody knows when the rest was sent, so what may be older
than a stop begins no motion after that stop. One that has been behind for over a second may be closed at the other end:
nothing that is left of it begins a motion. It has caught up when nothing was left to read, or, after having been late,
when that has been so for a second.
"""

from __future__ import annotations

from gateway.clients.commands.turn import LONG_AGO
from gateway.transport.intake import LATE, SHARE

#: Seconds after which whoever has sent a whole share, and nothing since, has caught up.
CAUGHT_UP = 5.0


class Backlog:
    """Of one connection; times are seconds of the event loop's clock. ``late``: what is read now was sent long ago."""

    def __init__(self) -> None:
        self.late = False
        #: How many stops there had been when it fell behind; None while it is not.
        self._stops: int | None = None
        self._since = self._last = -1e9

    def sent(self, now: float) -> int | None:
        """How many stops there may have been when that was sent which is about to be taken in; None for all so far."""
        if self._stops is not None and now - self._last > (LATE if self.late else CAUGHT_UP):
            self._stops, self.late = None, False
        self.late = self.late or (self._stops is not None and now - self._since > LATE)
        return LONG_AGO if self.late else self._stops

    def took(self, size: int, now: float, stops: int) -> None:
        """So many bytes were taken in; there have been so many stops now."""
        if size >= SHARE:
            if self._stops is None:
                self._stops, self._since = stops, now
            self._last = now
        elif not self.late:
            self._stops = None
