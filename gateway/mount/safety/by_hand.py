"""The first stretch of a motion by hand: where it leads until it has been seen and can be stopped.

It is looked at whole, because over the zenith or past the Sun its end may be allowed again; and both ways of each
axis, because what tells no axis may point the other way round.
"""

from __future__ import annotations

from itertools import product
from math import ceil

from gateway import operations as op
from gateway.errors import NearSun
from gateway.mount.safety.altitude import check_altitude, leaving
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.limits import Limits
from gateway.mount.safety.stop_timing import SHORTEST
from gateway.spherical import fold_declination

#: Degrees of an axis between the places of a way that are looked at.
STRIDE = 2.0


def turn(mount: MountInputs, operation: op.Move | op.MoveAxis) -> float:
    """How far an axis turns from the last position until the next was seen and has stopped it, degrees."""
    age = mount.readings.age(op.Position, mount.now()) if mount.moving().by_hand else 0.0
    return operation.sense * mount.speed(operation) * (mount.timing.reaction + SHORTEST + age)


def check_either_way(mount: MountInputs, limits: Limits, seen: op.Equatorial, status: op.Status,
                     turns: dict[int, float], tilt: float) -> None:
    """The turns of the axes, degrees, each of them either way. Raises BelowHorizon, TooHigh or NearSun."""
    for way in product(*({degrees, -degrees} for degrees in turns.values())):
        check_turns(mount, limits, seen, status, dict(zip(turns, way, strict=True)), tilt)


def check_turns(mount: MountInputs, limits: Limits, seen: op.Equatorial, status: op.Status,
                turns: dict[int, float], tilt: float) -> None:
    """The whole way of so many degrees of the axes. Raises BelowHorizon, TooHigh or NearSun.

    ``tilt`` is by how much the altitude axis differs from what is reckoned.
    """
    steps = max(1, ceil(max(abs(degrees) for degrees in turns.values()) / STRIDE))
    here = seen
    for step in range(1, steps + 1):
        soon = _soon(mount, seen, status, {axis: degrees * step / steps for axis, degrees in turns.items()})
        _check_step(mount, limits, here, soon, tilt)
        here = soon


def _check_step(mount: MountInputs, limits: Limits, seen: op.Equatorial, soon: op.Equatorial, tilt: float) -> None:
    before, after = mount.astrometry.horizon(seen).alt + tilt, mount.astrometry.horizon(soon).alt + tilt
    if leaving(limits, before, after, 0.0):
        check_altitude(limits, after)
    for now, then in zip(mount.suns.distances(seen), mount.suns.distances(soon), strict=True):
        if then < mount.suns.limit and then < now:
            raise NearSun


def _soon(mount: MountInputs, seen: op.Equatorial, status: op.Status, turns: dict[int, float]) -> op.Equatorial:
    """Where so many degrees of the axes lead."""
    first, second = turns.get(1, 0.0), turns.get(2, 0.0)
    if status.equatorial or mount.driver.stepping:
        return op.Equatorial(*fold_declination(seen.ra - first, seen.dec + second))
    here = mount.astrometry.horizon(seen)
    goal = mount.astrometry.equatorial(op.GotoHorizontal(*fold_declination(here.az + first, here.alt + second)))
    return op.Equatorial(goal.ra, goal.dec)
