"""How the mount's line is: how long each answer took, how many there are a second, how many questions failed."""

from __future__ import annotations

from collections import deque

from gateway.app.status import Rate
from gateway.core.wire_log import Entry
from gateway.diagnostics.log.printing import MOUNT

#: Answer times that are kept for a page that has just come.
KEPT = 240


class Pulse:
    """Listens to the mount's side of a wire_log."""

    def __init__(self) -> None:
        #: When (Unix seconds), and after how many milliseconds; None for a question that failed.
        self.samples: deque[tuple[float, float | None]] = deque(maxlen=KEPT)
        self.faults = 0
        self.count = 0
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
            self.count += 1
            self.samples.append((round(entry.time, 3), None if failed else round((entry.time - self._asked) * 1e3, 1)))

    def rate(self, now: float, answers: int) -> float:
        """Exchanges a second, of late."""
        return round(self._rate.per_second(now, answers), 1)
