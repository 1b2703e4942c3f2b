"""The first stretch of a motion by hand: where it leads until it has been seen and can be stopped.

It is looked at whole, because over the zenith or past the Sun its end may be allowed again; and both ways of each
axis, because what tells no axis may point the other way round. A guide pulse is a stretch, too.
"""

from __future__ import annotations

from itertools import product
from math import ceil
from typing import NamedTuple

from gateway.astro.spherical import SIDEREAL_RATE, fold_declination
from gateway.core import operations as op
from gateway.core.errors import NearSun, PastMeridian
from gateway.mount.policy import AT_LIMIT, Limits
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.rules.altitude import leaving
from gateway.mount.safety.rules.meridian import can_be_told, past_meridian
from gateway.mount.safety.stop_timing import SHORTEST

#: Degrees of an axis between the places of a way that are looked at.
STRIDE = 2.0


class Start(NamedTuple):
    """Where a stretch begins; ``tilt`` is by how much the altitude axis differs from what is reckoned.

    ``side`` is the side of the pier (E, W) that the tube is on, None where nobody knows or there is no pier.
    """

    seen: op.Equatorial
    status: op.Status
    tilt: float = 0.0
    side: str | None = None


def turn(mount: MountInputs, operation: op.Move | op.MoveAxis) -> float:
    """How far an axis turns from the last position until the next was seen and has stopped it, degrees."""
    age = mount.readings.age(op.Position, mount.now()) if mount.moving().by_hand else 0.0
    return operation.sense * mount.speed(operation) * (mount.timing.reaction + SHORTEST + age)


def as_motion(pulse: op.Pulse | op.PulseAxis) -> tuple[op.Move | op.MoveAxis, float]:
    """A guide pulse as a motion by hand, and how far it turns its axis at most, degrees."""
    degrees, guide = SIDEREAL_RATE * pulse.ms / 1000.0, op.Rate(name="guide")
    if isinstance(pulse, op.Pulse):
        return op.Move(pulse.direction, guide), pulse.direction.sense * degrees
    return op.MoveAxis(pulse.axis, pulse.sense, guide), pulse.sense * degrees * (pulse.rate or 1.0)


def check_either_way(mount: MountInputs, limits: Limits, start: Start, turns: dict[int, float]) -> None:
    """The turns of the axes, degrees, each of them either way. Raises BelowHorizon, TooHigh, NearSun, PastMeridian."""
    for way in product(*({degrees, -degrees} for degrees in turns.values())):
        check_turns(mount, limits, start, dict(zip(turns, way, strict=True)))


def check_turns(mount: MountInputs, limits: Limits, start: Start, turns: dict[int, float]) -> None:
    """The whole way of so many degrees of the axes. Raises BelowHorizon, TooHigh, NearSun or PastMeridian."""
    steps = max(1, ceil(max(abs(degrees) for degrees in turns.values()) / STRIDE))
    here = start.seen
    for step in range(1, steps + 1):
        soon = _soon(mount, start, {axis: degrees * step / steps for axis, degrees in turns.items()})
        _check_step(mount, limits, start, here, soon)
        here = soon


def _check_step(mount: MountInputs, limits: Limits, start: Start, seen: op.Equatorial, soon: op.Equatorial) -> None:
    before, after = mount.astrometry.horizon(seen).alt + start.tilt, mount.astrometry.horizon(soon).alt + start.tilt
    if leaving(limits, before, after, 0.0):
        limits.check_altitude(after)
    for now, then in zip(mount.suns.distances(seen), mount.suns.distances(soon), strict=True):
        if then < mount.suns.limit and then < now:
            raise NearSun
    if limits.hour_angle is not None and start.status.equatorial and can_be_told(mount.driver.german, start.side):
        sidereal = mount.astrometry.sidereal_time()
        now, then = (past_meridian(sidereal - place.ra, start.side) for place in (seen, soon))
        if then > limits.hour_angle + AT_LIMIT and then > now:
            raise PastMeridian


def _soon(mount: MountInputs, start: Start, turns: dict[int, float]) -> op.Equatorial:
    """Where so many degrees of the axes lead."""
    first, second = turns.get(1, 0.0), turns.get(2, 0.0)
    if start.status.equatorial or mount.driver.stepping:
        return op.Equatorial(*fold_declination(start.seen.ra - first, start.seen.dec + second))
    here = mount.astrometry.horizon(start.seen)
    return mount.astrometry.equatorial(op.Horizontal(*fold_declination(here.az + first, here.alt + second)))
