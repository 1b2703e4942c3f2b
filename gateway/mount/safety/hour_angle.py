"""How far the tube is past the meridian, where a German mount meets its pier and the cables of a fork tighten.

It follows from the angle of the first axis, west positive, from its middle: on a German mount where the counterweight
shaft points down, on a fork the meridian. If the mount reports its axes, their readings give that angle; otherwise the
hour angle does, on a German mount together with the reported pier side. After that each hour angle continues the last,
because a tube that is driven over the pole changes its hour angle by 180 degrees although the first axis rests. During
a goto the angle is unknown: the tube may change sides, and the reported side is that of the goal. Angles are degrees.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from itertools import pairwise

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import PastMeridian
from gateway.mount.context import Context
from gateway.mount.motion.seen import ObservedMotion, PositionSample
from gateway.mount.policy import LIMIT_TOLERANCE, Limits
from gateway.mount.safety.allow import PastMeridianState

#: Degrees from the middle at which the counterweight shaft of a German mount is horizontal.
LEVEL_SHAFT_ANGLE = 90.0
#: Degrees that the first axis turns at most between two positions, so that one angle continues the other.
MAX_CONTINUATION = 45.0
#: Seconds between two readings of the axes, also at rest: the next motion may begin at the hand control.
AXIS_READ_INTERVAL = 0.45
#: Seconds for which a pier side is trusted at rest.
MAX_SIDE_AGE = 5.0
#: The message to the user if nothing shows how far the tube is past the meridian.
NO_LIMIT_MESSAGE = "hour-angle-limit has no effect on this mount, because it does not report the side of its pier"


def reports_axes(mount: Context) -> bool:
    """Whether the mount itself reports its axes."""
    return mount.driver.implementation(op.AxisPosition) is not None


def mount_suits_hour_angle_limit(mount: Context) -> bool:
    """Whether an hour angle limit can be enforced: on forks, and on German mounts that report axes or pier side."""
    german = mount.driver.german
    return reports_axes(mount) or german is False or (german is True and mount.driver.reports_pier_side)


def angle_from_axes(mount: Context, axes: op.Horizontal | op.GotoAxes) -> float | None:
    """Return how far the first axis is turned from its middle by these readings; None for a fork without a site.

    On a German mount (in the north without a site) the reading is 90 with the shaft down; on a fork 0 is in the north.
    """
    site = mount.sources.site()
    if mount.driver.german:
        return wrap180(axes.az - LEVEL_SHAFT_ANGLE) * (-1.0 if site is not None and site.latitude < 0.0 else 1.0)
    if site is None:
        return None
    geometry = Geometry(Build.WEDGE, site.latitude)
    return geometry.pole_sign * wrap180(axes.az - geometry.to_axes(0.0, 0.0, False)[0])


def angle_from_pier_side(hour_angle: float, side: str | None) -> float:
    """Return how far the first axis is turned from its middle, with the tube on this ``side`` of the pier (E, W).

    From the east side the tube looks west, from the west side east. Without a side the mount is a fork.
    """
    return wrap180(hour_angle - {"E": LEVEL_SHAFT_ANGLE, "W": -LEVEL_SHAFT_ANGLE, None: 0.0}[side])


def past_meridian(axis_angle: float, german: bool | None) -> float:
    """Return how far the tube is past the meridian, degrees: on a German mount the angle of the counterweight shaft
    above horizontal (negative on the free side), on a fork the hour angle, east or west.
    """
    return abs(wrap180(axis_angle)) - (LEVEL_SHAFT_ANGLE if german else 0.0)


def check_past_meridian(limits: Limits, axis_angle: float, german: bool | None) -> None:
    """Raises PastMeridian if the first axis of a mount would be turned too far from its middle."""
    if limits.hour_angle is not None and past_meridian(axis_angle, german) > limits.hour_angle + LIMIT_TOLERANCE:
        raise PastMeridian


class HourAngleWatch:
    """Follows the first axis of a mount, as long as the owner has set a limit for it."""

    def __init__(self, mount: Context, read_side: Callable[[], Coroutine[None, None, str | None]]) -> None:
        self._mount, self._read_side = mount, read_side
        #: The last three samples since the last goto: the loop time, and how far the tube was past the meridian.
        self._past_samples: tuple[Pair, ...] = ()
        #: How far the axis was turned at the last position of a mount that does not report its axes; None if unknown.
        self._axis_angle: float | None = None

    @property
    def has_limit(self) -> bool:
        """Whether a limit is set that can be enforced on this mount."""
        mount = self._mount
        status = mount.cache.last_value(op.GetStatus)
        limited = mount.policy.limits.hour_angle is not None and status is not None and status.equatorial
        return limited and mount_suits_hour_angle_limit(mount)

    @property
    def read_period(self) -> float | None:
        """How often to read the axes, seconds; None if that is not needed."""
        needed = self.has_limit and reports_axes(self._mount) and not self._mount.movement.slewing
        return AXIS_READ_INTERVAL if needed else None

    def forget(self) -> None:
        """Forget the angle of the axis: positions before and after now cannot be compared."""
        self._past_samples, self._axis_angle = (), None

    def take_reading(self, axes: op.Horizontal) -> None:
        """Store how far the tube is past the meridian by this axis reading, unless a goto is under way."""
        turned = angle_from_axes(self._mount, axes) if self.has_limit and reports_axes(self._mount) else None
        if turned is not None and not self._mount.movement.slewing:
            self._add_sample(self._mount.now(), turned)

    def past_meridian_now(self, observed: ObservedMotion) -> PastMeridianState | None:
        """Return how far the tube is past the meridian at the last position; None if unknown or during a goto."""
        mount = self._mount
        if not self.has_limit:
            return None
        if mount.movement.slewing:
            self.forget()
            if mount.cache.last_value(op.PierSide) is not None:
                mount.cache.forget(op.PierSide)  # it is that of the goal
            return None
        if not reports_axes(mount) and observed.last is not None:
            self._follow_position(observed.last)
        return _extrapolate(self._past_samples, mount.now())

    def axis_angle(self, hour_angle: float, side: str | None) -> float | None:
        """Return how far the axis is turned at this hour angle: near its last known angle, else by the pier side."""
        german, before = self._mount.driver.german, self._axis_angle
        if before is not None:
            first = angle_from_pier_side(hour_angle, "E" if german else None)
            nearest = min((first, wrap180(first + 180.0)), key=lambda way: abs(wrap180(way - before)))
            if abs(wrap180(nearest - before)) <= MAX_CONTINUATION:
                return nearest
        return None if german and side is None else angle_from_pier_side(hour_angle, side if german else None)

    def _follow_position(self, sample: PositionSample) -> None:
        """Update the angle of the axis by the last position, unless that position is already used."""
        if sample.hour_angle is not None and not (self._past_samples and sample.time <= self._past_samples[-1][0]):
            self._axis_angle = self.axis_angle(sample.hour_angle, self._pier_side())
            if self._axis_angle is not None:
                self._add_sample(sample.time, self._axis_angle)

    def _add_sample(self, read_at: float, axis_angle: float) -> None:
        self._past_samples = (*self._past_samples[-2:], (read_at, past_meridian(axis_angle, self._mount.driver.german)))

    def _pier_side(self) -> str | None:
        """Return the pier side that a German mount last reported, else None; start a new read if that report is old."""
        mount = self._mount
        if not mount.driver.german:
            return None
        if mount.cache.age(op.PierSide, mount.now()) > MAX_SIDE_AGE:
            mount.tasks.spawn(self._read_side())
        return mount.driver.tube_side(mount.cache.last_value(op.PierSide) or "")


def _extrapolate(samples: tuple[Pair, ...], now: float) -> PastMeridianState | None:
    """Return how far the tube is past the meridian now, extrapolated from the last samples; None without a rate."""
    rates = [(past - before) / (at - then) for (then, before), (at, past) in pairwise(samples) if at > then]
    if not rates:
        return None
    at, past = samples[-1]
    return PastMeridianState(past + rates[-1] * (now - at), rates[-1], abs(rates[0]) if len(rates) > 1 else None)
