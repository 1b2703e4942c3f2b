"""The paths that a goto may take, as readings of the two axes: which leave the limits, and which come near the Sun.

A position does not always tell in which of the two ways the axes point there (a second axis beyond 90 degrees is the
other way of pointing), nor in which direction they will turn, so there may be several paths. A mount turns both axes
straight to their targets. Their relative speed is unknown, so a path has two shapes: both axes arrive together, or both
are equally fast and the one with the shorter turn rests at its end. All readings of an equatorial mount are expressed
like a German mount's, so that Sun, zenith and nadir are the same for every build. Angles are degrees.

A goto is refused only if each of its paths leaves the limits; the refusal names a place to send the mount to first. If
only some do, it is begun and watched like a motion by hand.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from math import copysign, isfinite, sqrt
from typing import NamedTuple

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import WayBlocked
from gateway.mount.context import Context
from gateway.mount.policy import Limits
from gateway.mount.site.astrometry import SiteAstrometry, Sun

Path = tuple[Pair, Pair]
#: By how much a sync may have shifted the axis readings of a fork from where it points.
DISPLACED = 15.0
#: Degrees from the meridian, and from the pole, within which a German mount may choose either side of the pier.
EITHER_SIDE = 5.0
#: Step along a path where it passes close to a circle, degrees; the greatest error is half of it.
STEP = 0.2
#: Degrees that an axis can turn on one path.
LONGEST = 1080.0
#: Where the axes are on a path, after so many degrees of the longer turn.
Shape = Callable[[Pair, Pair, float], Pair]
#: Degrees by which a place on the way must keep within the limits: the mount tracks while its user reads the refusal.
WITHIN = 3.0
#: Steps of the two axes between the places that are tried, degrees; none is near the meridian or the pole.
STEPS = 15, 10


class Circle(NamedTuple):
    """A region around axis readings that is too high or too low: its altitude, centre and radius."""

    altitude: float
    middle: Pair
    radius: float


def forbidden_circles(astrometry: SiteAstrometry, limits: Limits, equatorial: bool, over: bool) -> list[Circle]:
    """Return the regions that the altitude limits forbid.

    A fork in alt-azimuth only passes higher than both ends of its path when it returns over the zenith (``over``).
    """
    if astrometry.site_clock.site() is None:
        return []
    zenith, nadir = (0.0, 90.0), (0.0, -90.0)
    if equatorial:
        geometry = _geometry(astrometry, Build.GERMAN)
        zenith, nadir = geometry.axes(0.0, geometry.latitude, False), geometry.axes(180.0, -geometry.latitude, False)
    high = Circle(90.0, zenith, (90.0 - limits.highest) * (equatorial or over))
    low = Circle(-90.0, nadir, (90.0 + limits.lowest) * equatorial)
    return [circle for circle in (high, low) if circle.radius > 0.0]


def sun_reading(astrometry: SiteAstrometry, there: op.Equatorial | Sun, equatorial: bool) -> Pair:
    """Return the axis readings at which this mount points at a Sun, or at a place, in the first way."""
    sun = op.Equatorial(there.ra, there.dec)
    if equatorial:
        return _geometry(astrometry, Build.GERMAN).axes(_hour_angle(astrometry, sun), sun.dec, False)
    seen = astrometry.horizon(sun) if astrometry.site_clock.site() is not None else op.Horizontal(sun.ra, sun.dec)
    return seen.az, seen.alt


def possible_paths(
    astrometry: SiteAstrometry,
    german: bool,
    equatorial: bool,
    here: op.Equatorial,
    goal: op.Equatorial,
    axes: Pair | None,
    others: set[bool],
) -> list[Path]:
    """Return the paths from ``here`` to ``goal``, or to the target readings ``axes`` if they are given.

    ``others`` says whether the axes may now point in the first of the two ways (False), the other (True), or both.
    """
    if not equatorial:
        return [path for other in others for path in _both_directions(_fork(astrometry, here, goal, axes, other))]
    german = german and astrometry.site_clock.site() is not None
    geometry = _geometry(astrometry, Build.GERMAN if german else Build.WEDGE)
    if german:
        flips = sides_at(astrometry, goal) if axes is None else {False}
        return [_polar(astrometry, geometry, here, goal, axes, other, flip) for other in others for flip in flips]
    paths = [_polar(astrometry, geometry, here, goal, axes, other, False) for other in others]
    return [round_ for path in paths for round_ in _both_directions(path)]


def sides_at(astrometry: SiteAstrometry, goal: op.Equatorial) -> set[bool]:
    """Return in which of the two ways a German mount may point after a goto: the second, the first, or either.

    The hand control chooses by the hour angle. Near the meridian, also below the pole, that depends on its own clock
    and settings; near the pole a small error of its alignment is a large hour angle.
    """
    hour_angle = _hour_angle(astrometry, goal)
    if min(abs(hour_angle), 180.0 - abs(hour_angle), 90.0 - abs(goal.dec)) < EITHER_SIDE:
        return {False, True}
    return {_geometry(astrometry, Build.GERMAN).other_side(hour_angle)}


def _fork(astrometry: SiteAstrometry, here: op.Equatorial, goal: op.Equatorial, axes: Pair | None, other: bool) -> Path:
    """The path of an alt-azimuth fork; without a site, as if on a wedge. At the zenith ``axes`` give its azimuth."""
    if astrometry.site_clock.site() is None:
        start, end = op.Horizontal(here.ra, here.dec), op.Horizontal(goal.ra, goal.dec)
    else:
        start = astrometry.horizon(here)
        end = op.Horizontal(*axes) if axes is not None else astrometry.horizon(goal)
    first, second = _pointing(start.az, start.alt, other)
    return (first, second), (wrap180(end.az - first), end.alt - second)


def _polar(
    astrometry: SiteAstrometry,
    geometry: Geometry,
    here: op.Equatorial,
    goal: op.Equatorial,
    axes: Pair | None,
    other: bool,
    flip: bool,
) -> Path:
    """The path of an equatorial mount; ``flip``: a German one will point there in the other of the two ways."""
    begin, end = _hour_angle(astrometry, here), _hour_angle(astrometry, goal)
    if geometry.build is Build.GERMAN:
        there = axes or geometry.axes(end, goal.dec, flip)
    elif axes is not None:
        there = axes[0] - geometry.axes(0.0, 0.0, False)[0], axes[1]
    else:
        there = geometry.pole * end, geometry.pole * goal.dec
    start = _pointing(geometry.pole * begin, geometry.pole * here.dec, other)
    return start, (geometry.travel(1, start[0], there[0]), geometry.travel(2, start[1], there[1]))


def _pointing(first: float, second: float, other: bool) -> Pair:
    """Return one of the two pairs of readings for the same direction; ``other`` is over the pole or the zenith."""
    return (first + 180.0, 180.0 - second) if other else (first, second)


def _both_directions(path: Path) -> Iterator[Path]:
    """Yield the path, and for a turn of about 180 degrees also the one with the first axis turning the other way."""
    start, (first, second) = path
    yield path
    if abs(first) > 180.0 - DISPLACED:
        yield start, (first - copysign(360.0, first), second)


def _geometry(astrometry: SiteAstrometry, build: Build) -> Geometry:
    place = astrometry.site_clock.site()
    return Geometry(build, place.latitude if place is not None else 0.0)


def _hour_angle(astrometry: SiteAstrometry, seen: op.Equatorial) -> float:
    """Hour angle in degrees; without a site, relative to an arbitrary hour circle."""
    return wrap180((astrometry.sidereal_time() if astrometry.site_clock.site() is not None else 0.0) - seen.ra)


def together(start: Pair, turn: Pair, turned: float) -> Pair:
    """Where the axes are after the longer turn has done ``turned`` degrees, if both arrive together."""
    part = turned / max(abs(turn[0]), abs(turn[1]), 1e-9)
    return start[0] + turn[0] * part, start[1] + turn[1] * part


def one_rests(start: Pair, turn: Pair, turned: float) -> Pair:
    """Where the axes are after ``turned`` degrees, if both are equally fast."""
    first, second = (copysign(min(abs(whole), turned), whole) for whole in turn)
    return start[0] + first, start[1] + second


#: The relative speed of the two axes is unknown, so a path may have either shape.
SHAPES: tuple[Shape, ...] = (together, one_rests)


def clear(start: Pair, turn: Pair, place: Pair, limit: float, shapes: Iterable[Shape] = SHAPES) -> bool:
    """Whether no shape of the path from ``start`` by ``turn`` comes nearer to ``place`` than ``limit`` degrees.

    Far from the circle the steps are large: two axes that turn one degree each move the tube by at most root two. A
    path or a place that is no number, and a turn that no mount can make, count as not clear.
    """
    length = max(abs(turn[0]), abs(turn[1]))
    if not (all(map(isfinite, (*start, *turn, *place, limit))) and length <= LONGEST):
        return False
    for shape in shapes:
        turned = 0.0
        while True:
            distance = separation(*shape(start, turn, turned), *place)
            if distance < limit:
                return False
            if turned >= length:
                break
            turned = min(length, turned + max(STEP, (distance - limit) / sqrt(2.0)))
    return True


class Journey(NamedTuple):
    """A goto that is to be checked: from where, and in which of the two ways the axes may point there; to where.

    ``axes`` are the target readings, if they are given.
    """

    equatorial: bool
    here: op.Equatorial
    others: set[bool]
    goal: op.Equatorial
    axes: Pair | None = None


def paths_of(mount: Context, journey: Journey) -> list[Path]:
    equatorial, here, others, goal, axes = journey
    german = mount.driver.german is True
    return possible_paths(mount.astrometry, german, equatorial, here, goal, axes, others)


async def check_ways(mount: Context, limits: Limits, journey: Journey) -> bool:
    """Return whether a possible way leaves the altitude limits, so that it must be watched like a motion by hand.

    Raises WayBlocked if every way leaves them, or one does before a stop could end it. A way from beyond a limit is
    clear if it never leads farther out than where it begins.
    """
    circles, blocked, leaves = _examine(mount, limits, journey)
    if blocked is not None:
        raise WayBlocked(await _words(mount, limits, journey, circles, blocked))
    return leaves


def leaves_limits(mount: Context, limits: Limits, journey: Journey) -> bool:
    """Like ``check_ways`` for where the tube is if the syncs were wrong: such a goto is watched, not refused."""
    _, blocked, leaves = _examine(mount, limits, journey)
    return leaves or blocked is not None


def _examine(mount: Context, limits: Limits, journey: Journey) -> tuple[list[Circle], Circle | None, bool]:
    """Return the forbidden regions, the one for which the goto is refused, and whether a possible way leads there."""
    circles = forbidden_circles(mount.astrometry, limits, journey.equatorial, True in journey.others)
    stretch = mount.timing.reaction * mount.fastest
    ways = [(start, turn, shape) for start, turn in paths_of(mount, journey) for shape in SHAPES]
    crossed = [_first_crossed(circles, *way) for way in ways]
    at_once = [_first_crossed(circles, start, _first(turn, stretch), shape) for start, turn, shape in ways]
    blocked = next(filter(None, at_once), crossed[0] if all(crossed) else None)
    outside = any(separation(*start, *one.middle) < one.radius for start, _, _ in ways for one in circles)
    return circles, blocked, outside or any(crossed)


def _first_crossed(circles: list[Circle], start: Pair, turn: Pair, shape: Shape) -> Circle | None:
    for circle in circles:
        radius = min(circle.radius, separation(*start, *circle.middle) - 0.01)
        if not clear(start, turn, circle.middle, radius, (shape,)):
            return circle
    return None


def _first(turn: Pair, stretch: float) -> Pair:
    """Limit the turn of each axis to its first ``stretch`` degrees."""
    first, second = (max(-stretch, min(stretch, degrees)) for degrees in turn)
    return first, second


async def _words(mount: Context, limits: Limits, journey: Journey, circles: list[Circle], blocked: Circle) -> str:
    """Return at most 60 characters, because LX200 programs show no more."""
    high = blocked.altitude > 0.0
    place = await _place_between(mount, limits, journey, circles)
    if place is None:
        return f"The way is too {'high. Lower' if high else 'low. Raise'} the tube with the arrows first."
    return f"The way is too {'high' if high else 'low'}. Send it first to az {place.az:.0f}, alt {place.alt:.0f}."


async def _place_between(
    mount: Context, limits: Limits, journey: Journey, circles: list[Circle]
) -> op.Horizontal | None:
    """Return the place with the shortest way that is clear from here and from which the goal is clear, or None."""
    found: list[tuple[float, op.Horizontal, Journey, Journey]] = []
    german = mount.driver.german is True
    for first in range(STEPS[0] // 2, 360, STEPS[0]):
        await asyncio.sleep(0)  # some hundred places take a slow computer a tenth of a second
        for second in range(STEPS[1] // 2 - 90, 90, STEPS[1]):
            axes = op.GotoAxes(float(first), float(second))
            seen = op.Horizontal(axes.az, axes.alt)
            if journey.equatorial:  # these are the readings of the first way
                seen = mount.astrometry.horizon(mount.astrometry.from_axes(axes))
            seen = op.Horizontal(round(seen.az) % 360, round(seen.alt))
            if not limits.lowest + WITHIN <= seen.alt <= limits.highest - WITHIN:
                continue
            middle = mount.astrometry.equatorial(seen)  # as its user will read it
            sides = sides_at(mount.astrometry, middle) if german else {False}
            if len(sides) > 1 or not _hour_angle_allowed(mount, limits, journey, middle):
                continue
            legs = journey._replace(goal=middle, axes=None), journey._replace(here=middle, others=sides)
            length = sum(max(abs(turn) for _, turns in paths_of(mount, leg) for turn in turns) for leg in legs)
            found.append((length, seen, *legs))
    for _, seen, *both in sorted(found, key=lambda one: one[0]):
        if all(_keeps_clear(mount, leg, circles) for leg in both):
            return seen
    return None


def _hour_angle_allowed(mount: Context, limits: Limits, journey: Journey, place: op.Equatorial) -> bool:
    if limits.hour_angle is None or not journey.equatorial or mount.driver.tube_side("E") is not None:
        return True
    return abs(wrap180(mount.astrometry.sidereal_time() - place.ra)) <= limits.hour_angle


def _keeps_clear(mount: Context, leg: Journey, circles: list[Circle]) -> bool:
    """Whether every possible way keeps within the limits and away from the Sun, or leads out of where it begins."""
    forbidden = [(circle.middle, circle.radius) for circle in circles]
    suns = mount.suns.up()
    forbidden += [(sun_reading(mount.astrometry, sun, leg.equatorial), mount.suns.limit) for sun in suns]
    return all(
        clear(start, turn, middle, min(radius, separation(*start, *middle) - 0.01))
        for start, turn in paths_of(mount, leg)
        for middle, radius in forbidden
    )
