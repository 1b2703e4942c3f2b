"""Where the Sun is that must not come into the tube.

It counts while it is up. When the mount's date and this computer's differ by more than a day nobody knows which one is
right, so both Suns count; while nobody has told a date, this computer's does, and the log says so, loudly.
"""

from __future__ import annotations

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.site.site_clock import COMPUTER, BestSources

DAY = 86400.0
#: The Sun moves a twenty-thousandth of a degree a second against the stars: one place is good for a minute.
KEPT = 60.0
#: Altitude of a Sun that may still shine into a tube: refraction, the disk, and a horizon that lies lower than the eye.
SUN_IS_UP = -1.0


class SunAvoidance:
    """``limit`` is how near to it the tube may come, degrees; with 0 there is no Sun at all."""

    def __init__(self, context: Context, sky: Sky, sources: BestSources) -> None:
        self._context, self._sky, self._sources = context, sky, sources
        self.limit = context.policy.limits.sun
        self._key: tuple[object, ...] = ()
        self._up: list[op.Equatorial] = []

    def up(self) -> list[op.Equatorial]:
        """The places of date of every Sun that counts now."""
        if not self.limit:
            return []
        best, host, site = self._sources.best_time(), self._sources.host(), self._sources.site()
        if best.source == COMPUTER and self._context.milestones.settled.is_set():  # else the mount may tell one yet
            self._context.note_once(
                "WARNING: nobody has told a date: the Sun is avoided by this computer's date and time"
            )
        key = best.unix // KEPT, host // KEPT, site
        if key != self._key:
            self._key = key
            moments = [best.unix]
            if abs(best.unix - host) > DAY:
                moments.append(host)
                self._context.note_once("WARNING: the mount's date is not this computer's: the Sun is avoided by both")
            self._up = [place for place in (self._place(unix, site) for unix in moments) if place is not None]
        return self._up

    def _place(self, unix: float, site: op.Place | None) -> op.Equatorial | None:
        """The Sun of one moment; None when it is down. Without a site it counts as up."""
        sky = self._sky
        ra, dec = sky.sun(unix)
        if site is not None and sky.horizon(ra, dec, site.latitude, site.longitude, unix)[1] < SUN_IS_UP:
            return None
        return op.Equatorial(ra, dec)

    def distances(self, seen: op.Equatorial) -> list[float]:
        """How far a place is from every Sun that counts, degrees."""
        return [separation(seen.ra, seen.dec, sun.ra, sun.dec) for sun in self.up()]
