"""The limits as a question about one place: may the mount be told to point there?

It is asked of places that are reckoned, so that nobody is told of a mount beyond a limit which it has not been seen to
cross. What is really done at a limit is decided elsewhere, by what the mount tells.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway.core import operations as op
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings.reckoning import Inside
from gateway.mount.safety.limits import Limits
from gateway.mount.safety.rules.meridian import past_meridian

if TYPE_CHECKING:
    from gateway.mount.controller import MountController


def limits_of(controller: MountController) -> Limits:
    """The operator's limits, narrowed by the programs whose motion is under way."""
    limits, motion = controller.policy.limits, controller.motions.wanted.motion
    for moving in [motion.operation] if isinstance(motion, Slew) else controller.motions.by_hand.values():
        if isinstance(moving, op.Move | op.Goto):
            limits = limits.narrowed(moving.lowest, moving.highest)
    return limits


def over_the_horizon(limits: Limits) -> Inside:
    """Of an azimuth and an altitude."""
    return lambda _, altitude: limits.lowest <= altitude <= limits.highest


def on_the_sky(controller: MountController, limits: Limits) -> Inside:
    """Of a right ascension and a declination of date: altitude, the Sun, the hour angle of a mount whose side is known.

    While the site is unknown the Sun alone counts.
    """
    meridian = _meridian(controller, limits)

    def inside(ra: float, dec: float) -> bool:
        altitude = controller.derived.altitude(ra, dec)
        if altitude is not None and not limits.lowest <= altitude <= limits.highest:
            return False
        if any(distance < controller.suns.limit for distance in controller.suns.distances(op.Equatorial(ra, dec))):
            return False
        return meridian(ra, dec)

    return inside


def _meridian(controller: MountController, limits: Limits) -> Inside:
    """A goto crosses the meridian on its way: the limit is that of a motion by hand."""
    status, german, limit = controller.snapshot.value(op.GetStatus), controller.driver.german, limits.hour_angle
    side = controller.driver.tube_side(controller.snapshot.value(op.PierSide) or "") if german else None
    known = status is not None and status.equatorial and german is not None and (side or not german)
    if limit is None or not known or controller.slewing or controller.sources.site() is None:
        return lambda ra, dec: True
    sidereal = controller.derived.sidereal_time()
    return lambda ra, _: past_meridian(sidereal - ra, side) <= limit
