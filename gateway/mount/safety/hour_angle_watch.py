"""Follows how far the tube is past the meridian, from the axis readings or from the positions of one mount."""

from __future__ import annotations

from itertools import pairwise

from msgspec import Struct

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.seen import Seen
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.hour_angle import PastNow, meridian_known, past_by_axes, past_meridian, told_by_axes

#: Seconds between two readings of the axes: while the mount moves, and while it tracks or rests.
IN_MOTION, AT_REST = 0.45, 5.0
#: Seconds for which a pier side is trusted at rest.
SIDE_AGE = 5.0


class Reading(Struct, frozen=True):
    """How far the tube was past the meridian at a loop time, by the first axis."""

    at: float
    past: float


class HourAngleWatch:
    """Follows the hour angle of one mount, as long as the owner has set a limit for it."""

    def __init__(self, mount: Context, reader: Reader) -> None:
        self._mount, self._reader = mount, reader
        #: The last three readings of the first axis since the last goto.
        self._readings: tuple[Reading, ...] = ()

    @property
    def _watched(self) -> bool:
        status = self._mount.cache.value(op.GetStatus)
        return self._mount.policy.limits.hour_angle is not None and status is not None and status.equatorial

    @property
    def _by_axes(self) -> bool:
        return told_by_axes(self._mount)

    def interval(self, moves: bool) -> float | None:
        """Return how often to read the axes, seconds; None if that is not needed."""
        if not (self._watched and self._by_axes) or self._mount.movement.slewing:
            return None
        return IN_MOTION if moves else AT_REST

    def take_reading(self, axes: op.Horizontal, now: float) -> None:
        """Take an axis reading."""
        past = past_by_axes(self._mount, axes) if self._watched and self._by_axes else None
        if past is not None and not self._mount.movement.slewing:
            self._readings = (*self._readings[-2:], Reading(now, past))

    def look(self, seen: Seen) -> PastNow | None:
        """Return how far the tube is past the meridian at the last position; None if unknown or during a goto."""
        mount = self._mount
        if not self._watched:
            return None
        if mount.movement.slewing:
            self._readings = ()
            if mount.cache.value(op.PierSide) is not None:
                mount.cache.forget(op.PierSide)  # it is that of the goal
            return None
        return _by_readings(self._readings, mount.now()) if self._by_axes else self._by_side(seen)

    def _by_side(self, seen: Seen) -> PastNow | None:
        """Judge by the hour angles of the last two positions."""
        german, side = self._mount.driver.german, self._side()
        before, last, earlier = seen.before, seen.last, seen.earlier
        if not meridian_known(german, side) or before is None or last is None:
            return None
        if before.hour_angle is None or last.hour_angle is None:
            return None
        then, now = (past_meridian(hour_angle, side) for hour_angle in (before.hour_angle, last.hour_angle))
        return PastNow(now, (now - then) / seen.elapsed, None if earlier is None else earlier.hour_angle)

    def _side(self) -> str | None:
        """Return the pier side of a German mount from the cache, and start a new read if it is old."""
        mount = self._mount
        if not mount.driver.german:
            return None
        if mount.cache.age(op.PierSide, mount.now()) > SIDE_AGE:
            mount.tasks.spawn(self._reader.tube_side())
        return mount.driver.tube_side(mount.cache.value(op.PierSide) or "")


def _by_readings(readings: tuple[Reading, ...], now: float) -> PastNow | None:
    """Judge by the last readings of the first axis, continued to ``now``."""
    if len(readings) < 2:
        return None
    rates = [(b.past - a.past) / (b.at - a.at) for a, b in pairwise(readings) if b.at > a.at]
    if not rates:
        return None
    last = readings[-1]
    return PastNow(last.past + rates[-1] * (now - last.at), rates[-1], abs(rates[0]) if len(rates) > 1 else None)
