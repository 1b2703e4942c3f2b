"""The paths that a goto may take, as readings of the two axes, and the checks of these paths for limits and the Sun.

There may be several paths: axes can point at a position in two ways (usual, or with the second axis over the pole or
the zenith), and the position does not always show which; nor is the pier side known on which a goto ends. A mount turns
each axis straight to its target at full speed, and the axis with the shorter turn then rests. If positions show a goto
off these paths, it is watched like a motion by hand (``safety/watch.py``). All readings of an equatorial mount are
expressed like a German mount's, so that Sun, zenith and nadir have the same readings on every build. Angles: degrees.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from math import copysign, isfinite, sqrt
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import WayBlocked
from gateway.mount.context import FASTEST_RATE, Context
from gateway.mount.policy import LIMIT_TOLERANCE, Limits
from gateway.mount.safety.admission.contradictions import contradicting_skies, contradictions
from gateway.mount.site.astrometry import SUN_UP_ALTITUDE, FixedSiteTime, SiteAstrometry, Sun

#: A path: the readings of both axes at its beginning, and by how many degrees each turns.
Path = tuple[Pair, Pair]
#: Degrees: a turn of the first axis that is so near to half a circle may go the other way round.
HALF_CIRCLE_TOLERANCE = 5.0
#: Degrees from the meridian, and from the pole, within which a German mount may choose either side of the pier.
MERIDIAN_TOLERANCE = 2.0
#: Step along a path where it passes close to a forbidden circle, degrees; the greatest error is half a step.
PATH_STEP = 0.2
#: Degrees that an axis can turn on a path, and degrees between two points of ``path_points``.
MAX_AXIS_TURN, POINT_SPACING = 1080.0, 3.0
#: Azimuths and altitudes that a refusal may suggest between the mount's position and the goal, and their least distance
#: from a limit in degrees, because the mount tracks while its user reads the refusal.
INTERMEDIATE_POINTS = tuple((azimuth, altitude) for altitude in (45, 65, 25) for azimuth in range(15, 360, 30))
LIMIT_MARGIN = 3.0


class Journey(NamedTuple):
    """A goto that is to be checked, from ``start`` to ``goal``. ``start_pointings``: in which of the two ways the axes
    may point at the start (`find_pointings`).

    ``target_readings`` are those of the axes, if the goto is ordered by them; ``sky`` is the astronomy by which the
    mount calculates axis readings, if that is not by its own site and clock.
    """

    equatorial: bool
    start: op.Equatorial
    start_pointings: set[bool]
    goal: op.Equatorial
    target_readings: Pair | None = None
    sky: SiteAstrometry | None = None


def axis_readings_at(astrometry: SiteAstrometry, direction: op.Equatorial | Sun, equatorial: bool) -> Pair:
    """Return the axis readings at which this mount points in a direction, in the usual of the two ways."""
    aim = op.Equatorial(direction.ra, direction.dec)
    if equatorial:
        return _geometry_of(astrometry, Build.GERMAN).to_axes(_hour_angle(astrometry, aim), aim.dec, False)
    horizon = astrometry.horizontal(aim) if astrometry.site_clock.site() is not None else op.Horizontal(aim.ra, aim.dec)
    return horizon.az, horizon.alt


def zenith_readings(mount: Context, equatorial: bool) -> list[Pair]:
    """Return the axis readings of the zenith by the site and clock of this mount, and by each other source."""
    skies = [mount.astrometry, *(sky for _, sky in contradicting_skies(mount))]
    overhead = (op.Equatorial(sky.sidereal_time(), sky.site().latitude) for sky in skies)
    return [axis_readings_at(mount.astrometry, place, equatorial) for place in overhead]


def contradicting_suns(mount: Context) -> Iterator[tuple[SiteAstrometry, Sun]]:
    """Yield the astronomy and the Sun for each site and time that contradict the mount's own, if the Sun is up there.
    If these are right, an alt-azimuth mount that was aligned on stars turns round the zenith that they give.
    """
    sites, times, own = mount.sources.sites(), mount.sources.times(), mount.astrometry
    for time, site in product(times, sites):
        if not any(contradictions([sites[0], site], [times[0], time])):
            continue
        sky = SiteAstrometry(own.sky, FixedSiteTime(site.place, time.unix), own.equinox)
        sun = Sun(*own.sky.sun(time.unix), False, time, site)
        if sky.horizontal(op.Equatorial(sun.ra, sun.dec)).alt >= SUN_UP_ALTITUDE:
            yield sky, sun


def paths_of(mount: Context, journey: Journey) -> list[Path]:
    """Return the possible paths of a goto."""
    equatorial, position, others, goal, axes, sky = journey
    astrometry = sky or mount.astrometry
    german = mount.driver.german is True and equatorial and astrometry.site_clock.site() is not None
    geometry = _geometry_of(astrometry, Build.GERMAN if german else Build.WEDGE if equatorial else Build.ALTAZ)
    start, end = (axis_readings_at(astrometry, place, equatorial) for place in (position, goal))
    if axes is not None:
        end = (axes[0] - geometry.to_axes(0.0, 0.0, False)[0], axes[1]) if geometry.build is Build.WEDGE else axes
    flips = pointings_at(astrometry, goal) if german and axes is None else {False}
    paths = []
    for begin in (_flip_over_pole(start, other) for other in others):
        for target in (_flip_over_pole(end, flip) for flip in flips):
            first, second = (geometry.axis_travel(axis, begin[axis - 1], target[axis - 1]) for axis in (1, 2))
            paths.append((begin, (first, second)))
            if not german and abs(first) > 180.0 - HALF_CIRCLE_TOLERANCE:
                paths.append((begin, (first - copysign(360.0, first), second)))
    return paths


def pointings_at(astrometry: SiteAstrometry, goal: op.Equatorial) -> set[bool]:
    """Return in which of two ways a German mount may point after a goto: the other (True), the usual (False), or both.

    The hand control chooses by the hour angle. Near the meridian, also below the pole, the choice depends on its own
    clock and settings; near the pole a small error of its alignment is a large hour angle.
    """
    hour_angle = _hour_angle(astrometry, goal)
    if min(abs(hour_angle), 180.0 - abs(hour_angle), 90.0 - abs(goal.dec)) < MERIDIAN_TOLERANCE:
        return {False, True}
    return {_geometry_of(astrometry, Build.GERMAN).is_flipped(hour_angle)}


def _flip_over_pole(reading: Pair, other_way: bool) -> Pair:
    """Return the axis readings, or for ``other_way`` those of the same direction over the pole or the zenith."""
    return (reading[0] + 180.0, 180.0 - reading[1]) if other_way else reading


def _geometry_of(astrometry: SiteAstrometry, build: Build) -> Geometry:
    place = astrometry.site_clock.site()
    return Geometry(build, place.latitude if place is not None else 0.0)


def _hour_angle(astrometry: SiteAstrometry, position: op.Equatorial) -> float:
    """Return the hour angle in degrees; without a site, relative to an arbitrary hour circle."""
    return wrap180((astrometry.sidereal_time() if astrometry.site_clock.site() is not None else 0.0) - position.ra)


def readings_after(start: Pair, turn: Pair, degrees: float) -> Pair:
    """Return the readings after each axis has turned by ``degrees``, or by its whole turn if that is smaller."""
    first, second = (copysign(min(abs(whole), degrees), whole) for whole in turn)
    return start[0] + first, start[1] + second


def is_clear(start: Pair, turn: Pair, centre: Pair, min_distance: float) -> bool:
    """Whether the path from ``start`` by ``turn`` never comes nearer to ``centre`` than ``min_distance`` degrees.

    Far from the circle the steps are large: two axes that turn one degree each move the tube by at most root two.
    Values that are not finite, and a turn that no mount can make, count as not clear.
    """
    length = max(abs(turn[0]), abs(turn[1]))
    if not (all(map(isfinite, (*start, *turn, *centre, min_distance))) and length <= MAX_AXIS_TURN):
        return False
    turned = 0.0
    while True:
        distance = separation(*readings_after(start, turn, turned), *centre)
        if distance < min_distance:
            return False
        if turned >= length:
            return True
        turned = min(length, turned + max(PATH_STEP, (distance - min_distance) / sqrt(2.0)))


def are_clear(paths: Iterable[Path], centre: Pair, min_distance: float) -> bool:
    """Whether all paths keep this distance from ``centre``; a path that begins nearer must never come nearer still."""
    return all(is_clear(*path, centre, min(min_distance, separation(*path[0], *centre) - 0.01)) for path in paths)


def path_points(path: Path) -> Iterator[Pair]:
    """Yield the axis readings along a path, at most ``POINT_SPACING`` degrees apart."""
    start, turn = path
    length = min(MAX_AXIS_TURN, max(abs(turn[0]), abs(turn[1])))
    for step in range(int(length / POINT_SPACING) + 1):
        yield readings_after(start, turn, step * POINT_SPACING)
    yield readings_after(start, turn, length)


def paths_within(mount: Context, limits: Limits, journey: Journey, stretch: float = MAX_AXIS_TURN) -> list[Path]:
    """Return the possible paths that keep the altitude limits for their first ``stretch`` degrees. Altitudes by sources
    that contradict the mount's site and clock count, too. A path that begins beyond a limit must lead no farther out.
    """
    tops = zenith_readings(mount, journey.equatorial)
    circles = [(top, 90.0 - limits.highest) for top in tops]
    circles += [((top[0] + 180.0, -top[1]), 90.0 + limits.lowest) for top in tops]

    def is_within(path: Path) -> bool:
        start, turn = path[0], _limited_turn(path[1], stretch)
        return all(
            radius <= 0.0 or is_clear(start, turn, middle, min(radius, separation(*start, *middle)) - LIMIT_TOLERANCE)
            for middle, radius in circles
        )

    return [path for path in paths_of(mount, journey) if is_within(path)]


def all_paths_within(mount: Context, limits: Limits, journey: Journey, stretch: float = MAX_AXIS_TURN) -> bool:
    """Whether every possible path keeps the limits, as in ``paths_within``."""
    return len(paths_within(mount, limits, journey, stretch)) == len(paths_of(mount, journey))


def _limited_turn(turn: Pair, stretch: float) -> Pair:
    """Limit the turn of each axis to its first ``stretch`` degrees."""
    return max(-stretch, min(stretch, turn[0])), max(-stretch, min(stretch, turn[1]))


def check_paths(mount: Context, limits: Limits, journey: Journey, unsynced: Sequence[Journey] = ()) -> list[Path]:
    """Like ``paths_within``. Raises WayBlocked if every path leaves the limits, or if any leaves them before a stop can
    end the goto, by the mount's coordinates or as if the syncs were wrong (``unsynced``). The message suggests where to
    send the mount first, if possible. It has at most 60 characters, because LX200 programs show no more.
    """
    paths, stretch = paths_within(mount, limits, journey), mount.stop_timing.reaction * mount.driver.speed(FASTEST_RATE)
    if paths and all(all_paths_within(mount, limits, path, stretch) for path in (journey, *unsynced)):
        return paths
    where = "low" if paths_within(mount, replace(limits, lowest=-90.0), journey) else "high"
    for azimuth, altitude in INTERMEDIATE_POINTS:
        place = mount.astrometry.equatorial_of(op.Horizontal(float(azimuth), float(altitude)))
        sides = pointings_at(mount.astrometry, place) if mount.driver.german else {False}
        legs = journey._replace(goal=place, target_readings=None), journey._replace(start=place, start_pointings=sides)
        inside = limits.lowest + LIMIT_MARGIN <= altitude <= limits.highest - LIMIT_MARGIN
        if inside and len(sides) == 1 and all(_is_leg_clear(mount, limits, leg) for leg in legs):
            raise WayBlocked(f"The way is too {where}. Send it first to az {azimuth}, alt {altitude}.")
    raise WayBlocked(
        f"The way is too {where}. {'Raise' if where == 'low' else 'Lower'} the tube with the arrows first."
    )


def _is_leg_clear(mount: Context, limits: Limits, leg: Journey) -> bool:
    """Whether every possible path keeps the limits and the distance from the Sun.

    A path that begins beyond one of these must lead no farther beyond it.
    """
    places = [axis_readings_at(mount.astrometry, sun, leg.equatorial) for sun in mount.suns.suns_to_avoid()]
    return all_paths_within(mount, limits, leg) and all(
        are_clear(paths_of(mount, leg), place, mount.suns.min_dist) for place in places
    )
