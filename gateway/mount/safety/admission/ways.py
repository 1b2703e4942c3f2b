"""Whether the ways to a goal leave the altitude limits, and by which place they do not.

A goto has several possible ways (``slew_paths.py``). It is refused only if each of them leaves the limits; the refusal
names a place to send the mount to first. If only some do, it is begun and watched like a motion by hand.
"""

from __future__ import annotations

import asyncio
from typing import NamedTuple

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import WayBlocked
from gateway.mount.context import Context
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.slew_paths import (
    SHAPES,
    Circle,
    Path,
    Shape,
    clear,
    forbidden_circles,
    place_at,
    possible_paths,
    sides_at,
    sun_reading,
)

#: Degrees by which a place on the way must keep within the limits: the mount tracks while its user reads the refusal.
WITHIN = 3.0
#: Steps of the two axes between the places that are tried, degrees; none is near the meridian or the pole.
STEPS = 15, 10


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
            middle = place_at(mount.astrometry, (float(first), float(second)), journey.equatorial)
            seen = mount.astrometry.horizon(middle)
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
