"""A look: what one position of the mount means for the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from gateway import operations as op
from gateway.mount.motion.ends import Sample
from gateway.spherical import wrap180

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: Degrees of right ascension between two looks that no motor turns: a sync, or the pole was passed.
JUMP = 30.0
#: The least that a position can show, degrees: a second of right ascension, a 16-bit reading; in low precision more.
DIGIT, COARSE_DIGIT = 0.006, 0.025


class Look(Struct, frozen=True):
    """Altitude and hour angle (None without a site), distances from the Suns, degrees.

    ``at`` is the loop time, ``lifting`` what moved the second axis by hand then.
    """

    at: float
    seen: op.Equatorial
    altitude: float | None
    hour_angle: float | None
    suns: list[float]
    lifting: op.Move | op.MoveAxis | None = None


def measured(hub: Hub, now: float, seen: op.Equatorial, before: Look | None = None) -> Look:
    """What a position means that is told now."""
    here = seen if before is None else _at_once(hub, now, seen, before)
    altitude = hub.derived.altitude(here.ra, here.dec)
    hour_angle = None if altitude is None else hub.derived.sidereal_time() - here.ra
    return Look(now, seen, altitude, hour_angle, hub.suns.distances(here), hub.motions.by_hand.get(2))


def _at_once(hub: Hub, now: float, seen: op.Equatorial, before: Look) -> op.Equatorial:
    """Where the mount is when the second half of its position is told: the first has gone on meanwhile."""
    halves = hub.driver.position_reads - 1
    turned = wrap180(seen.ra - before.seen.ra)
    if not halves or abs(turned) > JUMP:
        return seen
    return replace(seen, ra=(seen.ra + turned / (now - before.at) * 2.0 * halves * hub.line.typical) % 360.0)


def sample(hub: Hub, now: float, seen: op.Equatorial) -> Sample:
    """A position as the readings of the two axes that are ended one by one."""
    digit = COARSE_DIGIT if getattr(hub.driver, "low", False) else DIGIT
    status = hub.snapshot.value(op.GetStatus)
    if status is None or status.equatorial or hub.sources.site() is None:
        return Sample(now, (seen.ra, seen.dec), digit)
    place = hub.derived.horizon(seen)
    return Sample(now, (place.az, place.alt), digit)
