"""The paths that a goto may take, as readings of the two axes, and the checks of these paths for limits and the Sun.

There may be several paths: a position does not always show in which of two ways the axes point (a second axis beyond 90
degrees points the other way round), nor on which side of the pier a goto ends. A mount turns each axis straight to its
target at full speed, and the axis with the shorter turn then rests. A mount that moves otherwise is seen away from
these paths, and then watched like a motion by hand (``safety/watch.py``). All readings of an equatorial mount are
expressed like a German mount's, so that Sun, zenith and nadir are the same for every build; angles are degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign, isfinite, sqrt
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import WayBlocked
from gateway.mount.context import Context
from gateway.mount.policy import AT_LIMIT, Limits
from gateway.mount.site.astrometry import SiteAstrometry, Sun

#: Readings of both axes at the beginning, and by how much they turn.
Path = tuple[Pair, Pair]
#: Degrees: a turn of the first axis that is so near to half a circle may go the other way round.
EITHER_WAY_ROUND = 5.0
#: Degrees from the meridian, and from the pole, within which a German mount may choose either side of the pier.
EITHER_SIDE = 2.0
#: Step along a path where it passes close to a circle, degrees; the greatest error is half of it.
STEP = 0.2
#: Degrees that an axis can turn on a path, and degrees between two points of a path that are kept.
LONGEST, APART = 1080.0, 3.0
#: Azimuths and altitudes of the places that are tried between here and a goal, and how far they keep from a limit: the
#: mount tracks while its user reads the refusal.
BETWEEN = tuple((azimuth, altitude) for altitude in (45, 65, 25) for azimuth in range(15, 360, 30))
WITHIN = 3.0


class Circle(NamedTuple):
    """A region around axis readings that is too high or too low."""

    middle: Pair
    radius: float


def sun_reading(astrometry: SiteAstrometry, direction: op.Equatorial | Sun, equatorial: bool) -> Pair:
    """Return the axis readings at which this mount points at a Sun, or at a place, in the first of the two ways."""
    sun = op.Equatorial(direction.ra, direction.dec)
    if equatorial:
        return _geometry(astrometry, Build.GERMAN).axes(_hour_angle(astrometry, sun), sun.dec, False)
    horizon = astrometry.horizon(sun) if astrometry.site_clock.site() is not None else op.Horizontal(sun.ra, sun.dec)
    return horizon.az, horizon.alt


def zenith(astrometry: SiteAstrometry, equatorial: bool) -> Pair:
    """Return the axis readings at which this mount points at the zenith."""
    geometry = _geometry(astrometry, Build.GERMAN)
    return geometry.axes(0.0, geometry.latitude, False) if equatorial else (0.0, 90.0)


def possible_paths(
    astrometry: SiteAstrometry,
    german: bool,
    equatorial: bool,
    start: op.Equatorial,
    goal: op.Equatorial,
    axes: Pair | None,
    others: set[bool],
) -> list[Path]:
    """Return the paths from ``start`` to ``goal``, or to the target readings ``axes`` if they are given.

    ``others`` says whether the axes may now point in the first of the two ways (False), the other (True), or both.
    """
    if not equatorial:
        return [path for other in others for path in _both_directions(_fork(astrometry, start, goal, axes, other))]
    german = german and astrometry.site_clock.site() is not None
    geometry = _geometry(astrometry, Build.GERMAN if german else Build.WEDGE)
    if german:
        flips = sides_at(astrometry, goal) if axes is None else {False}
        return [_polar(astrometry, geometry, start, goal, axes, other, flip) for other in others for flip in flips]
    paths = [_polar(astrometry, geometry, start, goal, axes, other, False) for other in others]
    return [round_ for path in paths for round_ in _both_directions(path)]


def sides_at(astrometry: SiteAstrometry, goal: op.Equatorial) -> set[bool]:
    """Return in which of two ways a German mount may point after a goto: the second, the first, or either.

    The hand control chooses by the hour angle. Near the meridian, also below the pole, the choice depends on its own
    clock and settings; near the pole a small error of its alignment is a large hour angle.
    """
    hour_angle = _hour_angle(astrometry, goal)
    if min(abs(hour_angle), 180.0 - abs(hour_angle), 90.0 - abs(goal.dec)) < EITHER_SIDE:
        return {False, True}
    return {_geometry(astrometry, Build.GERMAN).other_side(hour_angle)}


def _fork(
    astrometry: SiteAstrometry, origin: op.Equatorial, goal: op.Equatorial, axes: Pair | None, other: bool
) -> Path:
    """The path of an alt-azimuth fork; without a site, as if on a wedge. At the zenith ``axes`` give its azimuth."""
    if astrometry.site_clock.site() is None:
        start, end = op.Horizontal(origin.ra, origin.dec), op.Horizontal(goal.ra, goal.dec)
    else:
        start = astrometry.horizon(origin)
        end = op.Horizontal(*axes) if axes is not None else astrometry.horizon(goal)
    first, second = _pointing(start.az, start.alt, other)
    return (first, second), (wrap180(end.az - first), end.alt - second)


def _polar(
    astrometry: SiteAstrometry,
    geometry: Geometry,
    position: op.Equatorial,
    goal: op.Equatorial,
    axes: Pair | None,
    other: bool,
    flip: bool,
) -> Path:
    """The path of an equatorial mount; ``flip``: a German mount will point at the goal in the other of the two ways."""
    begin, end = _hour_angle(astrometry, position), _hour_angle(astrometry, goal)
    if geometry.build is Build.GERMAN:
        target = axes or geometry.axes(end, goal.dec, flip)
    elif axes is not None:
        target = axes[0] - geometry.axes(0.0, 0.0, False)[0], axes[1]
    else:
        target = geometry.pole * end, geometry.pole * goal.dec
    start = _pointing(geometry.pole * begin, geometry.pole * position.dec, other)
    return start, (geometry.travel(1, start[0], target[0]), geometry.travel(2, start[1], target[1]))


def _pointing(first: float, second: float, other: bool) -> Pair:
    """Return a pair of readings out of the two for the same direction; ``other`` is over the pole or the zenith."""
    return (first + 180.0, 180.0 - second) if other else (first, second)


def _both_directions(path: Path) -> Iterator[Path]:
    """Yield the path, and for a turn of about 180 degrees also the path on which the first axis turns the other way."""
    start, (first, second) = path
    yield path
    if abs(first) > 180.0 - EITHER_WAY_ROUND:
        yield start, (first - copysign(360.0, first), second)


def _geometry(astrometry: SiteAstrometry, build: Build) -> Geometry:
    place = astrometry.site_clock.site()
    return Geometry(build, place.latitude if place is not None else 0.0)


def _hour_angle(astrometry: SiteAstrometry, position: op.Equatorial) -> float:
    """Hour angle in degrees; without a site, relative to an arbitrary hour circle."""
    return wrap180((astrometry.sidereal_time() if astrometry.site_clock.site() is not None else 0.0) - position.ra)


def one_rests(start: Pair, turn: Pair, turned: float) -> Pair:
    """Where the axes are after ``turned`` degrees: both are equally fast, and the shorter turn rests at its end."""
    first, second = (copysign(min(abs(whole), turned), whole) for whole in turn)
    return start[0] + first, start[1] + second


def clear(start: Pair, turn: Pair, place: Pair, limit: float) -> bool:
    """Whether the path from ``start`` by ``turn`` never comes nearer to ``place`` than ``limit`` degrees.

    Far from the circle the steps are large: two axes that turn one degree each move the tube by at most root two.
    Values that are not finite, and a turn that no mount can make, count as not clear.
    """
    length = max(abs(turn[0]), abs(turn[1]))
    if not (all(map(isfinite, (*start, *turn, *place, limit))) and length <= LONGEST):
        return False
    turned = 0.0
    while True:
        distance = separation(*one_rests(start, turn, turned), *place)
        if distance < limit:
            return False
        if turned >= length:
            return True
        turned = min(length, turned + max(STEP, (distance - limit) / sqrt(2.0)))


def points(path: Path) -> Iterator[Pair]:
    """Yield readings along a path."""
    start, turn = path
    length = min(LONGEST, max(abs(turn[0]), abs(turn[1])))
    for step in range(int(length / APART) + 1):
        yield one_rests(start, turn, step * APART)
    yield one_rests(start, turn, length)


class Journey(NamedTuple):
    """A goto that is to be checked: its start, in which of the two ways the axes may point there, and its goal.

    ``axes`` are the target readings, if they are given.
    """

    equatorial: bool
    here: op.Equatorial
    others: set[bool]
    goal: op.Equatorial
    axes: Pair | None = None


def paths_of(mount: Context, journey: Journey) -> list[Path]:
    equatorial, position, others, goal, axes = journey
    german = mount.driver.german is True
    return possible_paths(mount.astrometry, german, equatorial, position, goal, axes, others)


def within(mount: Context, limits: Limits, journey: Journey, stretch: float = LONGEST) -> list[Path]:
    """Return the possible paths that keep the altitude limits, or do so for the first ``stretch`` degrees. A path that
    starts beyond a limit must lead no farther out.
    """
    top = zenith(mount.astrometry, journey.equatorial)
    bottom = top[0] + 180.0, -top[1]
    circles = [Circle(top, 90.0 - limits.highest), Circle(bottom, 90.0 + limits.lowest)]
    paths = []
    for start, turn in paths_of(mount, journey):
        radii = [
            (circle.middle, min(circle.radius, separation(*start, *circle.middle)))
            for circle in circles
            if circle.radius > 0.0
        ]
        if all(clear(start, _first(turn, stretch), middle, radius - AT_LIMIT) for middle, radius in radii):
            paths.append((start, turn))
    return paths


def _first(turn: Pair, stretch: float) -> Pair:
    """Limit the turn of each axis to its first ``stretch`` degrees."""
    return max(-stretch, min(stretch, turn[0])), max(-stretch, min(stretch, turn[1]))


def check_ways(mount: Context, limits: Limits, journey: Journey) -> list[Path]:
    """Like ``within``. Raises WayBlocked if every path leaves the limits, or one does before a stop could end it. Its
    text names a place to go to first, if there is one, and has at most 60 characters, because LX200 programs show no
    more.
    """
    paths, stretch = within(mount, limits, journey), mount.timing.reaction * mount.fastest
    if paths and len(within(mount, limits, journey, stretch)) == len(paths_of(mount, journey)):
        return paths
    where = "low" if within(mount, replace(limits, lowest=-90.0), journey) else "high"
    for azimuth, altitude in BETWEEN:
        place = mount.astrometry.equatorial(op.Horizontal(float(azimuth), float(altitude)))
        sides = sides_at(mount.astrometry, place) if mount.driver.german else {False}
        legs = journey._replace(goal=place, axes=None), journey._replace(here=place, others=sides)
        inside = limits.lowest + WITHIN <= altitude <= limits.highest - WITHIN
        if inside and len(sides) == 1 and all(_keeps_clear(mount, limits, leg) for leg in legs):
            raise WayBlocked(f"The way is too {where}. Send it first to az {azimuth}, alt {altitude}.")
    raise WayBlocked(
        f"The way is too {where}. {'Raise' if where == 'low' else 'Lower'} the tube with the arrows first."
    )


def _keeps_clear(mount: Context, limits: Limits, leg: Journey) -> bool:
    """Whether every possible way keeps the limits and the distance from the Sun, or leads out of where it begins."""
    paths, suns = paths_of(mount, leg), mount.suns.up()
    places = [sun_reading(mount.astrometry, sun, leg.equatorial) for sun in suns]
    return len(within(mount, limits, leg)) == len(paths) and all(
        clear(*path, place, min(mount.suns.limit, separation(*path[0], *place) - 0.01))
        for path in paths for place in places
    )  # fmt: skip
