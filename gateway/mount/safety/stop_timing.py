"""How long it takes to see where the mount is and to bring it to rest, and how fast it comes nearer meanwhile.

Seconds, from what an exchange typically takes on this line and what motors need: what cannot be had sooner must be
known before. Until motors have their speed it is the speed they were told; and what has grown from one position to the
next may grow by as much again, for motors gather speed, and a tube that leaves the pole falls faster and faster. At
every look the latest moment is set at which a stop still helps, should nothing newer be seen before it: a position that
comes late, for whatever reason, must not lead farther than one that comes in time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec import Struct

#: Looks that follow each other faster than that say nothing about a rate.
SHORTEST = 0.15
#: Exchanges that pass before a stop has effect: the one that told the position, one on the wire, the first of the stop.
EXCHANGES = 3
#: Motors do not stop at once: one that slows down evenly for a second runs on as far as in half a second at its speed.
#: No mount tells how it slows down; about a second from full speed is what owners see, and slower motors need less.
RUN_ON = 0.5
#: Exchanges from the end of one axis to the end of the other, which alone may lead where both together do not.
BETWEEN = 2.0
#: Motors do not reach their speed at once: what is measured in the first second is not yet all of it.
RUN_UP = 1.0
#: A part of the speed told that says which way a motion leads; a slower change is the way past a limit.
LEADS = 0.2


class StopTiming(Struct, frozen=True):
    """``exchange`` is what one takes, ``reads`` how many a position needs, ``period`` how often positions are asked."""

    exchange: float
    reads: int
    period: float

    @property
    def lag(self) -> float:
        """How much older the first half of a position is than its second, as it is told."""
        return 2.0 * (self.reads - 1) * self.exchange

    @property
    def interval(self) -> float:
        """From one look to the next: where the mount moves, each read of a position is told twice."""
        return max(self.period, 2.0 * self.reads * self.exchange)

    @property
    def to_stop(self) -> float:
        """From where a position was true to where the stop that it calls for brings it to rest."""
        return (EXCHANGES + self.reads - 1) * self.exchange + RUN_ON

    @property
    def reaction(self) -> float:
        """From one look to the rest that the next one brings."""
        return self.interval + self.to_stop

    def overdue(self, elapsed: float) -> float:
        """The same when the last two looks were so far apart: the next one may be as late."""
        return max(self.reaction, elapsed + EXCHANGES * self.exchange + RUN_ON)

    def between(self, axes: int) -> float:
        """From the end of one of two axes to the end of the other; 0 where at most one moves."""
        return BETWEEN * self.exchange if axes > 1 else 0.0


def ahead(rate: float, earlier: float | None, told: float, first: float, last: float) -> float:
    """How fast it may come nearer from now on, degrees a second, where ``rate`` was seen between two positions.

    ``earlier`` is the rate seen before that, in the same motion. ``first`` and ``last`` are the seconds from the
    beginning of the motion to the two positions, ``told`` its speed where it is known, else 0.
    """
    grown = max(0.0, rate - earlier) if earlier is not None else 0.0
    if first < RUN_UP and rate > LEADS * told * _run_up(first, last):
        return max(rate + grown, told)
    return rate + grown


def _run_up(first: float, last: float) -> float:
    """What part of its speed a motor has had on average between two moments, seconds after it was told to turn."""
    if last >= RUN_UP or last <= max(0.0, first):
        return 1.0
    return (max(0.0, first) + last) / 2.0 / RUN_UP


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
