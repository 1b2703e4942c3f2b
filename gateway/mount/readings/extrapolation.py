"""Extrapolates the position of a moving mount from its last two readings.

Each of the two angles continues at the rate between these readings: for a second at most, and for no more than half of
the distance to the goal. It stops at a limit, because clients must not see the mount beyond a limit that it has not
crossed. The last reading is used unchanged near a pole, where angles do not change evenly, and at rates that no motor
reaches. Pure functions over frozen values; angles are degrees, times are seconds of a monotonic clock.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec import Struct

from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import FASTEST
from gateway.mount.motion.wanted import Slew
from gateway.mount.policy import Limits
from gateway.mount.readings.cache import CachedAnswer, Kind, Pair, Reading, angles
from gateway.mount.safety.hour_angle import past_meridian, turned_by_side

Inside = Callable[[float, float], bool]

#: Seconds after the last reading for which the position is extrapolated.
LONGEST = 1.0
#: Seconds before the last reading for which it is calculated: a moment ago may be asked for again.
EARLIER = 0.05
#: Two readings give a rate if they are between so many seconds apart: less is rounding, more is out of date.
SOONEST, LATEST = 0.1, 3.0
#: Degrees from the equator beyond which the first angle does not change evenly, and its largest change otherwise.
POLEWARD, TURN = 85.0, 30.0
#: An angle must change by this many units of its resolution between two readings: less is rounding.
DIGITS = 3.0
#: The part of the distance to the goal that is covered at most: motors slow down, and the arrival is never guessed.
NEARER = 0.5
#: Bisection steps: a limit is found to a 256th of the extrapolated time.
HALVINGS = 8


class Extrapolation(Struct, frozen=True):
    """An extrapolation: its start, the rates (degrees a second), the largest distances, the longest time in seconds."""

    begins: Reading
    rates: Pair = (0.0, 0.0)
    rooms: Pair = (inf, inf)
    lasts: float = 0.0


def course(
    before: Reading | None,
    last: Reading,
    *,
    fastest: float,
    digit: float = 0.0,
    goal: Pair | None = None,
    polar: bool = True,
    inside: Inside | None = None,
) -> Extrapolation:
    """Return the course after ``last``; ``before`` is an earlier reading of the same motion, if there is one.

    ``fastest``: degrees a second that no motor exceeds. ``digit``: the resolution of readings, degrees. ``polar``: the
    angles are a position on a sphere, and not the readings of two axes. ``inside`` returns whether a position is within
    the limits; a mount that is beyond a limit already is extrapolated without them.
    """
    rates = None if before is None else _rates(before, last, fastest, digit, polar)
    if before is None or rates is None:
        return Extrapolation(last)
    rooms = (inf, inf) if goal is None else (_room(before, last, goal, 0), _room(before, last, goal, 1))
    lasts = LONGEST
    if polar:
        to_pole = POLEWARD - last.place[1] if rates[1] > 0.0 else POLEWARD + last.place[1]
        ends = last.at[0] + _until(rates[0], TURN), last.at[1] + _until(rates[1], to_pole)
        lasts = min(lasts, min(ends) - last.complete)
        if lasts < 0.0:
            return Extrapolation(last)
    free = Extrapolation(last, rates, rooms, lasts)
    return free if inside is None else _within(free, inside)


def place(going: Extrapolation, now: float) -> Pair:
    """Return the position at a time: the first angle in [0, 360), the second in [-180, 180)."""
    begins = going.begins
    if going.rates == (0.0, 0.0):
        return begins.place
    then = begins.complete + max(-EARLIER, min(now - begins.complete, going.lasts))
    first, second = (
        max(-room, min(room, rate * (then - at)))
        for rate, room, at in zip(going.rates, going.rooms, begins.at, strict=True)
    )
    return wrap360(begins.place[0] + first), wrap180(begins.place[1] + second)


def _until(rate: float, degrees: float) -> float:
    return degrees / abs(rate) if rate else inf


def _rates(before: Reading, last: Reading, fastest: float, digit: float, polar: bool) -> Pair | None:
    """Return the rates of both angles in degrees a second; None if the readings do not show them."""
    elapsed = last.at[0] - before.at[0], last.at[1] - before.at[1]
    if min(elapsed) < SOONEST or max(elapsed) > LATEST:
        return None
    turned = wrap180(last.place[0] - before.place[0]), wrap180(last.place[1] - before.place[1])
    if polar:
        if max(abs(before.place[1]), abs(last.place[1])) >= POLEWARD or abs(turned[0]) > TURN:
            return None
        if separation(*before.place, *last.place) > fastest * max(elapsed):
            return None
    elif max(abs(turned[0]) / elapsed[0], abs(turned[1]) / elapsed[1]) > fastest:
        return None
    first, second = (turned[n] / elapsed[n] if abs(turned[n]) >= DIGITS * digit else 0.0 for n in (0, 1))
    return first, second


def _room(before: Reading, last: Reading, goal: Pair, which: int) -> float:
    """Return the degrees that one angle may still turn; unlimited while it moves away from the goal (a longer path)."""
    was, left = (wrap180(goal[which] - reading.place[which]) for reading in (before, last))
    if was * left <= 0.0:
        return 0.0  # it has arrived
    return NEARER * abs(left) if abs(left) <= abs(was) else inf


def _within(going: Extrapolation, inside: Inside) -> Extrapolation:
    """Shorten the course so that it stays within the limits."""
    begins = going.begins

    def allowed(lasts: float) -> bool:
        return inside(*place(going, begins.complete + lasts))

    if allowed(going.lasts) or not inside(*begins.place):
        return going
    if not allowed(0.0):
        return Extrapolation(begins)
    good, bad = 0.0, going.lasts
    for _ in range(HALVINGS):
        middle = (good + bad) / 2.0
        good, bad = (middle, bad) if allowed(middle) else (good, middle)
    return Extrapolation(begins, going.rates, going.rooms, good)


# --- the course of a mount: its goal, and the limits as a test of one position ---------------------------------------
# Whether the mount is stopped at a limit is decided elsewhere, from real readings.


def course_of(context: Context, kind: Kind, entry: CachedAnswer) -> Extrapolation:
    """Return the course after the last reading of a kind, calculated once."""
    if entry.course is None:
        assert entry.reading is not None
        before = entry.before if entry.before is not None and entry.before.asked >= context.cache.outdated else None
        entry.course = course(
            None if before is None else before.reading,
            entry.reading,
            fastest=FASTEST * context.driver.speed_factor,
            digit=context.driver.resolution,
            goal=_goal(context, kind),
            polar=kind is not op.AxisPosition,
            inside=_inside(context, kind),
        )
    result: Extrapolation = entry.course
    return result


def equatorial(context: Context) -> bool:
    """Whether the mount has reported that it is equatorial."""
    status = context.cache.value(op.GetStatus)
    return status is not None and bool(status.equatorial)


def _goal(context: Context, kind: Kind) -> Pair | None:
    """Return the goal of the goto under way in the coordinates of this read; None if it is unknown."""
    motion, astrometry, driver = context.wanted.value.motion, context.astrometry, context.driver
    if not isinstance(motion, Slew):
        return None
    goto, polar = motion.operation, equatorial(context)
    axes = goto if isinstance(goto, op.GotoAxes) else driver.destination(goto)
    try:
        if isinstance(goto, op.Goto):
            sky = astrometry.from_mount(op.Equatorial(goto.ra, goto.dec))
        elif axes is None:
            return None
        elif kind is op.AxisPosition or (kind is op.HorizontalPosition and not polar):
            return axes.az, axes.alt
        elif polar:
            sky = astrometry.from_axes(axes, wedge=not driver.german)
        else:
            sky = astrometry.equatorial(axes)
        if kind is op.AxisPosition and polar:
            return None
        return angles(sky if kind is op.Position else astrometry.horizon(sky))
    except Unsupported:
        return None


def _inside(context: Context, kind: Kind) -> Inside | None:
    if kind is op.Position:
        return on_the_sky(context)
    if kind is op.AxisPosition and equatorial(context):
        return None
    limits = _limits(context)
    return lambda _, altitude: limits.lowest <= altitude <= limits.highest


def on_the_sky(context: Context) -> Inside:
    """Return the test for a right ascension and declination of date; without a site, only the Sun counts."""
    limits, astrometry, suns = _limits(context), context.astrometry, context.suns
    meridian = _meridian(context, limits.hour_angle)

    def inside(ra: float, dec: float) -> bool:
        altitude, _ = astrometry.overhead(op.Equatorial(ra, dec))
        if altitude is not None and not limits.lowest <= altitude <= limits.highest:
            return False
        if any(distance < suns.limit for distance in suns.distances(op.Equatorial(ra, dec))):
            return False
        return meridian(ra)

    return inside


def _limits(context: Context) -> Limits:
    """Return the operator's limits, narrowed by the clients whose motion is under way."""
    limits, motion = context.policy.limits, context.wanted.value.motion
    for moving in [motion.operation] if isinstance(motion, Slew) else context.wanted.by_hand.values():
        if isinstance(moving, op.Move | op.Goto):
            limits = limits.narrowed(moving.lowest, moving.highest)
    return limits


def _meridian(context: Context, limit: float | None) -> Callable[[float], bool]:
    """Return the hour angle test for a right ascension. During a goto all pass, because it may cross the meridian."""
    driver, cache = context.driver, context.cache
    status = cache.value(op.GetStatus)
    side = driver.tube_side(cache.value(op.PierSide) or "") if driver.german else None
    known = status is not None and status.equatorial and (side is not None or driver.german is False)
    if limit is None or not known or context.movement.slewing or context.sources.site() is None:
        return lambda _: True
    sidereal = context.astrometry.sidereal_time()
    return lambda ra: past_meridian(turned_by_side(sidereal - ra, side), driver.german) <= limit
