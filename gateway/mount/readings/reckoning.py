"""Where a mount that moves points now, reckoned from the last two places that it told.

Each of the two angles has gone on at the rate that the last two readings show: for a second at most, never more than
half of what is left to the goal, never beyond a limit, for nobody is told of a mount beyond one that it has not been
seen to cross. Where angles do not grow evenly (at a pole), or nothing that turns is so fast, the last place stands.
Pure functions over frozen values; angles are degrees, times are seconds of any clock that never goes back.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec import Struct

from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.wanted import Slew
from gateway.mount.policy import Limits
from gateway.mount.safety.allow import can_be_told, past_meridian

Pair = tuple[float, float]
Inside = Callable[[float, float], bool]

#: For how many seconds after the last reading a place is reckoned on.
LONGEST = 1.0
#: What was told a moment ago may be asked for again: of so many seconds before the last reading, too.
EARLIER = 0.05
#: Two readings tell a rate when they are so many seconds apart: sooner it is their last digit, later it is long ago.
SOONEST, LATEST = 0.1, 3.0
#: Degrees from the equator beyond which the first angle does not grow evenly, and how far it turns at most meanwhile.
POLEWARD, TURN = 85.0, 30.0
#: How many of its digits an angle must have turned by between two readings: less is their last digit.
DIGITS = 3.0
#: How much of what is left to a goal is gone at most: motors slow down before it, and nobody is told that they arrived.
NEARER = 0.5
#: A limit is found to a 256th of the time for which a place is reckoned on.
HALVINGS = 8


class Reading(Struct, frozen=True):
    """A longitude and a latitude, or the readings of two axes, and when each of them was true."""

    place: Pair
    at: Pair

    @property
    def complete(self) -> float:
        """When the later of both was true."""
        return max(self.at)


class Course(Struct, frozen=True):
    """From where a mount goes on, how fast (degrees a second), how far at most, and for how many seconds at most."""

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
) -> Course:
    """How it goes on after ``last``; ``before`` is an earlier reading of the same motion, or there is none.

    ``fastest``: degrees a second that no motor exceeds. ``digit``: how finely readings tell, degrees. ``polar``: the
    angles are places on a sphere, and not the readings of two axes. ``inside`` says whether a place is within the
    limits; one that is not has none.
    """
    rates = None if before is None else _rates(before, last, fastest, digit, polar)
    if before is None or rates is None:
        return Course(last)
    rooms = (inf, inf) if goal is None else (_room(before, last, goal, 0), _room(before, last, goal, 1))
    lasts = LONGEST
    if polar:
        to_pole = POLEWARD - last.place[1] if rates[1] > 0.0 else POLEWARD + last.place[1]
        ends = last.at[0] + _until(rates[0], TURN), last.at[1] + _until(rates[1], to_pole)
        lasts = min(lasts, min(ends) - last.complete)
        if lasts < 0.0:
            return Course(last)
    free = Course(last, rates, rooms, lasts)
    return free if inside is None else _within(free, inside)


def place(going: Course, now: float) -> Pair:
    """Where it is at a moment: the first angle in [0, 360), the second as it was told, or an axis in [-180, 180)."""
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
    """Degrees a second of each angle; None where nothing can be said of them."""
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
    """How far one angle may still go; one that leads away from the goal all the time goes another way round."""
    was, left = (wrap180(goal[which] - reading.place[which]) for reading in (before, last))
    if was * left <= 0.0:
        return 0.0  # it has come there
    return NEARER * abs(left) if abs(left) <= abs(was) else inf


def _within(going: Course, inside: Inside) -> Course:
    """The same for as long as it stays within the limits."""
    begins = going.begins

    def allowed(lasts: float) -> bool:
        return inside(*place(going, begins.complete + lasts))

    if allowed(going.lasts) or not inside(*begins.place):
        return going
    if not allowed(0.0):
        return Course(begins)
    good, bad = 0.0, going.lasts
    for _ in range(HALVINGS):
        middle = (good + bad) / 2.0
        good, bad = (middle, bad) if allowed(middle) else (good, middle)
    return Course(begins, going.rates, going.rooms, good)


# --- the limits as a question about one place: may a program be told that the mount points there? ---------------------
# What is really done at a limit is decided elsewhere, by what the mount tells.


def over_the_horizon(context: Context) -> Inside:
    """Of an azimuth and an altitude, by what is known now."""
    limits = _limits(context)
    return lambda _, altitude: limits.lowest <= altitude <= limits.highest


def on_the_sky(context: Context) -> Inside:
    """Of a right ascension and a declination of date: altitude, Sun, hour angle of a mount whose side is known.

    While the site is unknown the Sun alone counts.
    """
    limits, astrometry, suns = _limits(context), context.astrometry, context.suns
    meridian = _meridian(context, limits.hour_angle)

    def inside(ra: float, dec: float) -> bool:
        altitude = astrometry.altitude(ra, dec)
        if altitude is not None and not limits.lowest <= altitude <= limits.highest:
            return False
        if any(distance < suns.limit for distance in suns.distances(op.Equatorial(ra, dec))):
            return False
        return meridian(ra)

    return inside


def _limits(context: Context) -> Limits:
    """The operator's limits, narrowed by the programs whose motion is under way."""
    limits, motion = context.policy.limits, context.wanted.value.motion
    for moving in [motion.operation] if isinstance(motion, Slew) else context.wanted.by_hand.values():
        if isinstance(moving, op.Move | op.Goto):
            limits = limits.narrowed(moving.lowest, moving.highest)
    return limits


def _meridian(context: Context, limit: float | None) -> Callable[[float], bool]:
    """Of a right ascension. A goto crosses the meridian on its way: the limit is that of a motion by hand."""
    driver, cache = context.driver, context.cache
    status = cache.value(op.GetStatus)
    side = driver.tube_side(cache.value(op.PierSide) or "") if driver.german else None
    known = status is not None and status.equatorial and can_be_told(driver.german, side)
    if limit is None or not known or context.movement.slewing or context.sources.site() is None:
        return lambda _: True
    sidereal = context.astrometry.sidereal_time()
    return lambda ra: past_meridian(sidereal - ra, side) <= limit
