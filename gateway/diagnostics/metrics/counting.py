"""Counts what happens on one mount: exchanges, faults by kind, how long answers and stops take.

It listens to the mount's own signals and keeps numbers only. The text for Prometheus is made of them when asked for.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from typing import Any

from gateway.core.errors import Fault
from gateway.mount.controller import MountController
from gateway.mount.motion.wanted import Wanted

#: Upper bounds of what is told apart, seconds.
BOUNDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.5, 5.0)


class Histogram:
    """How many values were no more than each bound; the last count is of those above all of them."""

    def __init__(self, bounds: Sequence[float] = BOUNDS) -> None:
        self.bounds, self.counts, self.sum = bounds, [0] * (len(bounds) + 1), 0.0

    def add(self, value: float) -> None:
        """One more."""
        self.counts[bisect_left(self.bounds, value)] += 1
        self.sum += value

    def buckets(self) -> list[tuple[str, float]]:
        """As Prometheus has them: every bound with the count of all that are no more."""
        total, found = 0, []
        for bound, count in zip((*map(str, self.bounds), "+Inf"), self.counts, strict=True):
            total += count
            found.append((bound, float(total)))
        return found


class Counts:
    """From when it is made until it is closed. ``stops`` are those that were asked for, ``stopping`` how long each took
    from then until the mount had acknowledged it.
    """

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        self.faults: Counter[str] = Counter()
        self.answering, self.stopping = Histogram(), Histogram()
        self.exchanges = self.stops = 0
        self._stops = controller.stops
        self._since: float | None = None
        controller.line.exchanged.connect(self._exchanged)
        controller.wanted.changed.connect(self._changed)
        controller.reconciler.at_rest.connect(self._at_rest)

    def close(self) -> None:
        """Nothing is counted any more."""
        controller = self._controller
        controller.line.exchanged.disconnect(self._exchanged)
        controller.wanted.changed.disconnect(self._changed)
        controller.reconciler.at_rest.disconnect(self._at_rest)

    def _exchanged(self, outcome: dict[str, Any] | Fault) -> None:
        self.exchanges += 1
        if isinstance(outcome, Fault):
            self.faults[type(outcome).__name__] += 1
        else:
            self.answering.add(self._controller.line.talk.times.took)

    def _changed(self, wanted: Wanted) -> None:
        if wanted.stops != self._stops:
            self.stops += wanted.stops - self._stops
            self._stops = wanted.stops
            if wanted.owed and self._since is None:
                self._since = self._controller.now()

    def _at_rest(self, _: None) -> None:
        if self._since is not None:
            self.stopping.add(self._controller.now() - self._since)
            self._since = None
