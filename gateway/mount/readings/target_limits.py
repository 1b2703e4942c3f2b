"""The limits as a question about one place: may the mount be told to point there?

It is asked of places that are reckoned, so that nobody is told of a mount beyond a limit which it has not been seen to
cross. What is really done at a limit is decided elsewhere, by what the mount tells.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.wanted import Movement, Slew, WantedState
from gateway.mount.policy import Limits
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.readings.reckoning import Inside
from gateway.mount.safety.allow import can_be_told, past_meridian
from gateway.mount.safety.sun import SunAvoidance
from gateway.mount.site.astrometry import SiteAstrometry


class TargetLimits:
    """``over_the_horizon`` and ``on_the_sky`` give the question, by what is known now."""

    def __init__(
        self,
        context: Context,
        cache: ReadingsCache,
        wanted: WantedState,
        movement: Movement,
        astrometry: SiteAstrometry,
        suns: SunAvoidance,
    ) -> None:
        self._context, self._cache, self._wanted, self._movement = context, cache, wanted, movement
        self._astrometry, self._suns = astrometry, suns

    def _limits(self) -> Limits:
        """The operator's limits, narrowed by the programs whose motion is under way."""
        limits, motion = self._context.policy.limits, self._wanted.value.motion
        for moving in [motion.operation] if isinstance(motion, Slew) else self._wanted.by_hand.values():
            if isinstance(moving, op.Move | op.Goto):
                limits = limits.narrowed(moving.lowest, moving.highest)
        return limits

    def over_the_horizon(self) -> Inside:
        """Of an azimuth and an altitude."""
        limits = self._limits()
        return lambda _, altitude: limits.lowest <= altitude <= limits.highest

    def on_the_sky(self) -> Inside:
        """Of a right ascension and a declination of date: altitude, Sun, hour angle of a mount whose side is known.

        While the site is unknown the Sun alone counts.
        """
        limits, astrometry, suns = self._limits(), self._astrometry, self._suns
        meridian = self._meridian(limits)

        def inside(ra: float, dec: float) -> bool:
            altitude = astrometry.altitude(ra, dec)
            if altitude is not None and not limits.lowest <= altitude <= limits.highest:
                return False
            if any(distance < suns.limit for distance in suns.distances(op.Equatorial(ra, dec))):
                return False
            return meridian(ra, dec)

        return inside

    def _meridian(self, limits: Limits) -> Inside:
        """A goto crosses the meridian on its way: the limit is that of a motion by hand."""
        driver, cache, limit = self._context.driver, self._cache, limits.hour_angle
        status = cache.value(op.GetStatus)
        side = driver.tube_side(cache.value(op.PierSide) or "") if driver.german else None
        known = status is not None and status.equatorial and can_be_told(driver.german, side)
        if limit is None or not known or self._movement.slewing or self._astrometry.site_clock.site() is None:
            return lambda ra, dec: True
        sidereal = self._astrometry.sidereal_time()
        return lambda ra, _: past_meridian(sidereal - ra, side) <= limit
