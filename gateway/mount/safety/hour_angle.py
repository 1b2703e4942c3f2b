"""How far the tube is past the meridian, where a German mount meets its pier and the cables of a fork tighten.

If the mount reports its axes, the first axis tells it, whatever the mount believes about the sky. Otherwise it follows
from the hour angle and, on a German mount, from the side of the pier that the mount has told at rest. During a goto
neither is used: the tube may change sides, and the side that is told is already that of the goal. Angles are degrees.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from itertools import pairwise

from msgspec import Struct

from gateway.astro.axes import Build, Geometry
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import PastMeridian
from gateway.mount.context import Context
from gateway.mount.motion.seen import Seen
from gateway.mount.policy import AT_LIMIT, Limits
from gateway.mount.safety.allow import PastNow

#: Degrees past the meridian beyond which a tube has passed under the pole and no longer turns towards the pier.
AROUND_THE_POLE = 90.0
#: Seconds between two readings of the axes: while the mount moves, and while it tracks or rests.
IN_MOTION, AT_REST = 0.45, 5.0
#: Seconds for which a pier side is trusted at rest.
SIDE_AGE = 5.0


def told_by_axes(mount: Context) -> bool:
    """Whether the mount itself reports its axes."""
    return mount.driver.implementation(op.AxisPosition) is not None


def past_by_axes(mount: Context, axes: op.Horizontal | op.GotoAxes) -> float | None:
    """Return how far these axis readings of an equatorial mount are past the meridian; None without a hemisphere.

    The first axis of a German mount reads 90 with the counterweight shaft down. Past the meridian the shaft is above
    horizontal. A fork on its wedge counts from north, and its hour angle in both directions.
    """
    if mount.driver.german:
        return abs(wrap180(axes.az - 90.0)) - 90.0
    site = mount.sources.site()
    if site is None:
        return None
    return abs(wrap180(axes.az - Geometry(Build.WEDGE, site.latitude).axes(0.0, 0.0, False)[0]))


def meridian_known(german: bool | None, side: str | None) -> bool:
    """Whether the distance past the meridian is known. A German mount must have reported its pier side."""
    return german is not None and (bool(side) or not german)


def past_meridian(hour_angle: float, side: str | None) -> float:
    """Return by how many degrees the tube is past the meridian, towards the pier; negative on the free side.

    ``side`` is the side of the pier that the tube of a German mount is on. On the west side the tube looks east, and
    the pier is in its way once the hour angle is positive; on the east side it is the other way round. Without a side
    the mount is a fork on a wedge, and its hour angle counts in both directions.
    """
    hour_angle = wrap180(hour_angle)
    past = abs(hour_angle) if side is None else hour_angle if side == "W" else -hour_angle
    return past if side is None or past <= AROUND_THE_POLE else past - 360.0


def check_hour_angle(limits: Limits, hour_angle: float) -> None:
    """Raises PastMeridian if a target is too far from the meridian for a mount that cannot change the pier side."""
    if limits.hour_angle is not None and abs(wrap180(hour_angle)) > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


def check_shaft(limits: Limits, first: float) -> None:
    """Like ``check_hour_angle``, by the reading of the first axis of a German mount. Raises PastMeridian.

    The axis reads 90 degrees with the counterweight shaft down. Past the meridian the shaft is above horizontal.
    """
    if limits.hour_angle is not None and abs(wrap180(first - 90.0)) - 90.0 > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


class Reading(Struct, frozen=True):
    """How far the tube was past the meridian at a loop time, by the first axis."""

    at: float
    past: float


class HourAngleWatch:
    """Follows the hour angle of one mount, as long as the owner has set a limit for it."""

    def __init__(self, mount: Context, tube_side: Callable[[], Coroutine[None, None, str | None]]) -> None:
        self._mount, self._read_side = mount, tube_side
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
            mount.tasks.spawn(self._read_side())
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
