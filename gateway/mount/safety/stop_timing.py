"""How long it takes to see where the mount is and to stop it, and how fast it approaches a limit meanwhile.

Times are seconds, from the typical duration of an exchange on this link and from the inertia of motors. A motion must
be stopped early enough to end before the limit. Until the motors have reached their speed, the commanded speed counts.
A rate that grew from one position to the next may grow by as much again, because motors accelerate, and because a tube
that leaves the pole loses altitude faster and faster. At every position a deadline is set for the last moment at which
a stop still helps, so that a position that arrives late cannot let the mount pass a limit.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec import Struct

#: Positions closer together than this, in seconds, give no reliable rate.
MIN_INTERVAL = 0.15
#: Exchanges until a stop takes effect: the one that returned the position, one already sent, and the first of the stop.
EXCHANGES = 3
#: Seconds at full speed that a motor runs on after a stop: one that slows down evenly within a second covers half a
#: second's way. Mounts do not report how they slow down; owners see about a second from full speed, and less below it.
RUN_ON = 0.5
#: Exchanges between stopping one axis and stopping the other, which alone may lead where both together do not.
BETWEEN_AXES = 2.0
#: Seconds until motors have reached their speed; the rate that is measured earlier is too low.
RUN_UP = 1.0
#: The part of the commanded speed above which a rate shows an approach; a slower change means moving along the limit.
APPROACH = 0.2


class StopTiming(Struct, frozen=True):
    """Timing of one mount: ``exchange`` seconds each, ``reads`` per position, ``period`` seconds between positions."""

    exchange: float
    reads: int
    period: float

    @property
    def lag(self) -> float:
        """How much older the first coordinate of a position is than the second, when the second arrives."""
        return 2.0 * (self.reads - 1) * self.exchange

    @property
    def interval(self) -> float:
        """Seconds from one position to the next. While the mount moves, each coordinate is read twice."""
        return max(self.period, 2.0 * self.reads * self.exchange)

    @property
    def to_stop(self) -> float:
        """Seconds from the moment at which a position was true until the stop that it triggers has ended the motion."""
        return (EXCHANGES + self.reads - 1) * self.exchange + RUN_ON

    @property
    def reaction(self) -> float:
        """Seconds from one position until the stop that the next one triggers has ended the motion."""
        return self.interval + self.to_stop

    def overdue(self, elapsed: float) -> float:
        """Like ``reaction``, if the last two positions were ``elapsed`` seconds apart: the next one may be as late."""
        return max(self.reaction, elapsed + EXCHANGES * self.exchange + RUN_ON)

    def between_axes(self, axes: int) -> float:
        """Seconds between stopping one axis and stopping the other; 0 if at most one moves."""
        return BETWEEN_AXES * self.exchange if axes > 1 else 0.0


def ahead(rate: float, earlier: float | None, commanded: float, first: float, last: float) -> float:
    """Return how fast the mount may approach a limit from now on, degrees a second.

    ``rate`` was seen between the last two positions, ``earlier`` before that in the same motion; ``first`` and ``last``
    are the seconds from the beginning of the motion to the two. ``commanded`` is the speed ordered, 0 if unknown.
    """
    grown = max(0.0, rate - earlier) if earlier is not None else 0.0
    if first < RUN_UP and rate > APPROACH * commanded * _run_up(first, last):
        return max(rate + grown, commanded)
    return rate + grown


def _run_up(first: float, last: float) -> float:
    """The mean speed of a motor between two moments (seconds after its start) as a part of its full speed."""
    if last >= RUN_UP or last <= max(0.0, first):
        return 1.0
    return (max(0.0, first) + last) / 2.0 / RUN_UP


class StopDeadline:
    """A timer that calls ``passed`` once with the name of a limit, unless it is armed again or disarmed."""

    def __init__(self, loop: asyncio.AbstractEventLoop, passed: Callable[[str], None]) -> None:
        self._loop, self._passed = loop, passed
        self._handle: asyncio.TimerHandle | None = None

    def arm(self, seconds: float, limit: str) -> None:
        """Set the deadline to ``seconds`` from now, unless an earlier one is set."""
        at = self._loop.time() + max(0.0, seconds)
        if self._handle is not None and self._handle.when() <= at:
            return
        self.disarm()
        self._handle = self._loop.call_at(at, self._fire, limit)

    def disarm(self) -> None:
        """Cancel the deadline: no limit is near, or the next position has arrived."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None

    def _fire(self, limit: str) -> None:
        self._handle = None
        self._passed(limit)
