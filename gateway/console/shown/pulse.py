"""How the mount's line is: how long each answer took, how many there are a second, how many questions failed."""

from __future__ import annotations

from collections import deque

from gateway.app.status import Rate
from gateway.core.wire_log import MOUNT, Entry

#: Answer times that are kept for a page that has just come.
KEPT = 240

#: When (Unix seconds), and after how many milliseconds; None for a question that failed.
Sample = tuple[float, float | None]


class Pulse:
    """Listens to the mount's side of a wire_log."""

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque(maxlen=KEPT)
        self.faults = 0
        self._new: deque[Sample] = deque(maxlen=KEPT)
        self._asked = 0.0
        self._rate = Rate()

    def put(self, entry: Entry) -> None:
        """A sink of the wire_log."""
        if entry.side != MOUNT:
            return
        if entry.arrow == ">":
            self._asked = entry.time
        elif entry.arrow == "<":
            failed = bool(entry.note)
            self.faults += failed
            self._new.append((round(entry.time, 3), None if failed else round((entry.time - self._asked) * 1e3, 1)))

    def take(self) -> list[Sample]:
        """What is new since the last time; from now on it is among the ``samples``."""
        new = list(self._new)
        self._new.clear()
        self.samples += new
        return new

    def rate(self, now: float, answers: int) -> float:
        """Exchanges a second, of late."""
        return round(self._rate.per_second(now, answers), 1)
