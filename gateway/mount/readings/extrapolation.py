"""Extrapolates the position of a moving mount from its last two readings.

Each of the two angles continues at the rate between these readings: for a second at most, and for no more than half of
the distance to the goal. The last reading is used unchanged near a pole, where angles do not change evenly, and at
rates that no motor reaches. Limits are judged by real readings only. Angles are degrees, times are seconds of a
monotonic clock.
"""

from __future__ import annotations

from math import inf

from msgspec import Struct

from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import MAX_SPEED
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings.cache import CachedAnswer, Kind, Pair, Reading, angles_of

#: Seconds after the last reading for which the position is extrapolated.
MAX_EXTRAPOLATION = 1.0
#: A position is also calculated for up to this many seconds before the last reading: replies may refer to the past.
MAX_BACKWARD_TIME = 0.05
#: Seconds between two readings that give a rate: with less, rounding dominates; with more, the earlier is outdated.
MIN_GAP, MAX_READING_GAP = 0.1, 3.0
#: Degrees: nothing is extrapolated beyond this latitude, or if the first angle turned by more between two readings.
POLE_LATITUDE, MAX_TURN = 85.0, 30.0
#: An angle must change by this many units of its resolution between two readings: less is rounding.
MIN_CHANGE_UNITS = 3.0
#: The largest part of the distance to the goal that is extrapolated, because motors slow down near the goal.
MAX_GOAL_FRACTION = 0.5


class Extrapolation(Struct, frozen=True):
    """How a position continues: from which reading, at which rates of both angles (degrees a second), by how many
    degrees at most, and for how many seconds after the reading.
    """

    start: Reading
    rates: Pair = (0.0, 0.0)
    max_changes: Pair = (inf, inf)
    duration: float = 0.0


def extrapolate(
    previous: Reading | None,
    last: Reading,
    *,
    max_speed: float,
    resolution: float = 0.0,
    goal: Pair | None = None,
    on_sphere: bool = True,
) -> Extrapolation:
    """Return the extrapolation from the reading ``last``. ``previous``: an earlier reading of the same motion, or None.

    ``max_speed``: highest speed of the motors, degrees a second. ``resolution``: of readings, degrees. ``on_sphere``:
    the angles are a position on a sphere; otherwise they are the readings of two axes.
    """
    rates = None if previous is None else _rates(previous, last, max_speed, resolution, on_sphere)
    if previous is None or rates is None:
        return Extrapolation(last)
    rooms = (inf, inf) if goal is None else (_max_change(previous, last, goal, 0), _max_change(previous, last, goal, 1))
    duration = MAX_EXTRAPOLATION
    if on_sphere:
        to_pole = POLE_LATITUDE - last.angles[1] if rates[1] > 0.0 else POLE_LATITUDE + last.angles[1]
        ends = last.times[0] + _turn_time(rates[0], MAX_TURN), last.times[1] + _turn_time(rates[1], to_pole)
        duration = min(duration, min(ends) - last.completed_at)
        if duration < 0.0:
            return Extrapolation(last)
    return Extrapolation(last, rates, rooms, duration)


def predict(extrapolation: Extrapolation, now: float) -> Pair:
    """Return both angles at the loop time ``now``: the first in [0, 360), the second in [-180, 180)."""
    begins = extrapolation.start
    if extrapolation.rates == (0.0, 0.0):
        return begins.angles
    then = begins.completed_at + max(-MAX_BACKWARD_TIME, min(now - begins.completed_at, extrapolation.duration))
    first, second = (
        max(-room, min(room, rate * (then - at)))
        for rate, room, at in zip(extrapolation.rates, extrapolation.max_changes, begins.times, strict=True)
    )
    return wrap360(begins.angles[0] + first), wrap180(begins.angles[1] + second)


def _turn_time(rate: float, degrees: float) -> float:
    return degrees / abs(rate) if rate else inf


def _rates(previous: Reading, last: Reading, max_speed: float, resolution: float, on_sphere: bool) -> Pair | None:
    """Return the rates of both angles in degrees a second; None if the readings do not show them."""
    elapsed = last.times[0] - previous.times[0], last.times[1] - previous.times[1]
    if min(elapsed) < MIN_GAP or max(elapsed) > MAX_READING_GAP:
        return None
    turned = wrap180(last.angles[0] - previous.angles[0]), wrap180(last.angles[1] - previous.angles[1])
    if on_sphere:
        if max(abs(previous.angles[1]), abs(last.angles[1])) >= POLE_LATITUDE or abs(turned[0]) > MAX_TURN:
            return None
        if separation(*previous.angles, *last.angles) > max_speed * max(elapsed):
            return None
    elif max(abs(turned[0]) / elapsed[0], abs(turned[1]) / elapsed[1]) > max_speed:
        return None
    first, second = (turned[n] / elapsed[n] if abs(turned[n]) >= MIN_CHANGE_UNITS * resolution else 0.0 for n in (0, 1))
    return first, second


def _max_change(previous: Reading, last: Reading, goal: Pair, angle_index: int) -> float:
    """Return by how many degrees to extrapolate an angle at most; infinite while it moves away from the goal."""
    was, left = (wrap180(goal[angle_index] - reading.angles[angle_index]) for reading in (previous, last))
    if was * left <= 0.0:
        return 0.0  # it has arrived
    return MAX_GOAL_FRACTION * abs(left) if abs(left) <= abs(was) else inf


# --- the extrapolation for a mount, and its goal ----------------------------------------------------------------------


def extrapolation_of(context: Context, kind: Kind, entry: CachedAnswer) -> Extrapolation:
    """Return the extrapolation from a cached position; it is calculated once for each entry."""
    if entry.extrapolation is None:
        assert entry.reading is not None
        before = entry.prev if entry.prev is not None and entry.prev.asked_at >= context.cache.outdated_before else None
        entry.extrapolation = extrapolate(
            None if before is None else before.reading,
            entry.reading,
            max_speed=MAX_SPEED * context.driver.speed_factor,
            resolution=context.driver.rest_tolerance,
            goal=_goal_angles(context, kind),
            on_sphere=kind is not op.AxisPosition,
        )
    result: Extrapolation = entry.extrapolation
    return result


def is_equatorial(context: Context) -> bool:
    """Whether the mount has reported that it is equatorial."""
    status = context.cache.last_value(op.GetStatus)
    return status is not None and bool(status.equatorial)


def _goal_angles(context: Context, kind: Kind) -> Pair | None:
    """Return the goal of the current goto, in the coordinates of this kind of position read; None if unknown."""
    motion, astrometry, driver = context.wanted.value.motion, context.astrometry, context.driver
    if not isinstance(motion, Slew):
        return None
    goto, polar = motion.operation, is_equatorial(context)
    axes = goto if isinstance(goto, op.GotoAxes) else driver.destination(goto)
    try:
        if isinstance(goto, op.Goto):
            sky = astrometry.from_mount_equinox(op.Equatorial(goto.ra, goto.dec))
        elif axes is None:
            return None
        elif kind is op.AxisPosition or (kind is op.HorizontalPosition and not polar):
            return axes.az, axes.alt
        elif polar:
            sky = astrometry.from_axes(axes, on_wedge=not driver.german)
        else:
            sky = astrometry.equatorial_of(axes)
        if kind is op.AxisPosition and polar:
            return None
        return angles_of(sky if kind is op.Position else astrometry.horizontal(sky))
    except Unsupported:
        return None
