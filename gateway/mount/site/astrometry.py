"""What follows from site and clock, so that no mount is asked: places, axis readings, planets, the Sun to be avoided.

Without a site what needs one is refused in words, and the Sun counts as up.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation, wrap360
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Unsupported
from gateway.mount.site.site_clock import COMPUTER, BestSources, SiteClock

DAY = 86400.0
#: The Sun moves a twenty-thousandth of a degree a second against the stars: one place is good for a minute.
KEPT = 60.0
#: Altitude of a Sun that may still shine into a tube: refraction, the disk, and a horizon that lies lower than the eye.
SUN_IS_UP = -1.0


class SiteAstrometry:
    """Astronomy at this mount's site and by its clock. ``equinox`` is what the mount's coordinates mean."""

    def __init__(self, sky: Sky, site_clock: SiteClock | BestSources, equinox: str) -> None:
        self.sky, self.site_clock, self.equinox = sky, site_clock, equinox

    def place(self) -> op.Place:
        """The site in force. Raises Unsupported."""
        place = self.site_clock.site()
        if place is None:
            raise Unsupported("The site is not known.")
        return place

    def sidereal_time(self) -> float:
        """Local apparent sidereal time, degrees."""
        return self.sky.sidereal_time(self.site_clock.unix(), self.place().longitude)

    def altitude(self, ra: float, dec: float) -> float | None:
        """Degrees above the horizon now; None while the site is unknown."""
        place = self.site_clock.site()
        if place is None:
            return None
        return self.sky.horizon(ra, dec, place.latitude, place.longitude, self.site_clock.unix())[1]

    def horizon(self, seen: op.Equatorial) -> op.Horizontal:
        """Azimuth and altitude of a place of date."""
        place = self.place()
        unix = self.site_clock.unix()
        return op.Horizontal(*self.sky.horizon(seen.ra, seen.dec, place.latitude, place.longitude, unix))

    def equatorial(self, seen: op.Horizontal | op.GotoHorizontal | op.GotoAxes) -> op.Equatorial:
        """The place of date that stands at an azimuth and altitude now."""
        place = self.place()
        unix = self.site_clock.unix()
        return op.Equatorial(*self.sky.equatorial(seen.az, seen.alt, place.latitude, place.longitude, unix))

    def axes(self, seen: op.Equatorial, wedge: bool = False) -> op.Horizontal:
        """Where the axes of an equatorial mount would stand; a fork on its ``wedge`` reads from north."""
        geometry = Geometry(Build.WEDGE if wedge else Build.GERMAN, self.place().latitude)
        first, second = geometry.axes(self.sidereal_time() - seen.ra, seen.dec, False)
        return op.Horizontal(wrap360(first), second)

    def from_axes(self, wanted: op.GotoAxes, wedge: bool = False) -> op.Equatorial:
        """Axis readings of an equatorial mount as a place on the sky; a fork on its ``wedge`` reads from north."""
        build = Build.WEDGE if wedge else Build.GERMAN
        hour_angle, dec = Geometry(build, self.place().latitude).sky(wanted.az, wanted.alt)
        return op.Equatorial(wrap360(self.sidereal_time() - hour_angle), dec)

    def to_mount(self, operation: op.Goto | op.Sync | op.Choose) -> op.Goto | op.Sync | op.Choose:
        """A place of date in the mount's own equinox."""
        if self.equinox != "j2000":
            return operation
        ra, dec = self.sky.to_j2000(operation.ra, operation.dec, self.site_clock.unix())
        return replace(operation, ra=ra, dec=dec)

    def from_mount(self, seen: op.Equatorial) -> op.Equatorial:
        """The mount's place as one of date."""
        if self.equinox != "j2000":
            return seen
        return op.Equatorial(*self.sky.to_of_date(seen.ra, seen.dec, self.site_clock.unix()))


class SunAvoidance:
    """The Sun while it is up; ``limit`` is how near to it the tube may come, degrees: with 0 there is no Sun at all.

    When the mount's date and this computer's differ by more than a day nobody knows which one is right, so both Suns
    count; while nobody has told a date, this computer's does, and the log says so, loudly.
    """

    def __init__(
        self, limit: float, sky: Sky, sources: BestSources, settled: asyncio.Event, note_once: Callable[[str], None]
    ) -> None:
        self.limit, self._sky, self._sources, self._settled, self._note_once = limit, sky, sources, settled, note_once
        self._key: tuple[object, ...] = ()
        self._up: list[op.Equatorial] = []

    def up(self) -> list[op.Equatorial]:
        """The places of date of every Sun that counts now."""
        if not self.limit:
            return []
        best, host, site = self._sources.best_time(), self._sources.host(), self._sources.site()
        if best.source == COMPUTER and self._settled.is_set():  # else the mount may tell one yet
            self._note_once("WARNING: nobody has told a date: the Sun is avoided by this computer's date and time")
        key = best.unix // KEPT, host // KEPT, site
        if key != self._key:
            self._key = key
            moments = [best.unix]
            if abs(best.unix - host) > DAY:
                moments.append(host)
                self._note_once("WARNING: the mount's date is not this computer's: the Sun is avoided by both")
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


# --- where things stand now: site and clock are enough ----------------------------------------------------------------


def of_date(astrometry: SiteAstrometry, wanted: op.ToEquinoxOfDate) -> op.Equatorial:
    """A catalogue place, precession and nutation counted."""
    return op.Equatorial(*astrometry.sky.to_of_date(wanted.ra, wanted.dec, astrometry.site_clock.unix()))


def of_catalog(astrometry: SiteAstrometry, wanted: op.ToJ2000) -> op.Equatorial:
    """The other way round."""
    return op.Equatorial(*astrometry.sky.to_j2000(wanted.ra, wanted.dec, astrometry.site_clock.unix()))


def zenith(astrometry: SiteAstrometry, wanted: op.Zenith) -> op.Equatorial:
    """The sidereal time and the latitude, as a J2000 place."""
    return of_catalog(astrometry, op.ToJ2000(astrometry.sidereal_time(), astrometry.place().latitude))


def planet(astrometry: SiteAstrometry, wanted: op.PlanetPlace) -> op.Equatorial:
    """From the Earth's centre: parallax (0.5' for Venus at its nearest) is less than what the series are good to."""
    seen = astrometry.sky.planet(wanted.name, astrometry.site_clock.unix())
    if seen is None:
        raise Unsupported("The positions of the planets are not available yet.")
    return op.Equatorial(*seen)


def on_moon(astrometry: SiteAstrometry, wanted: op.MoonPlace) -> op.Equatorial:
    """Only while the middle of the Moon is above the horizon."""
    site, unix = astrometry.place(), astrometry.site_clock.unix()
    ra, dec, _ = astrometry.sky.moon(unix, site.latitude, site.longitude)
    if astrometry.sky.horizon(ra, dec, site.latitude, site.longitude, unix)[1] < 0.0:
        raise BelowHorizon("The Moon is below the horizon.")
    if wanted.latitude is not None and wanted.longitude is not None:
        ra, dec = astrometry.sky.on_moon(unix, site.latitude, site.longitude, wanted.latitude, wanted.longitude)
    return op.Equatorial(ra, dec)


PLACES: dict[type[op.Operation], Callable[[SiteAstrometry, Any], op.Equatorial]] = {
    op.ToEquinoxOfDate: of_date, op.ToJ2000: of_catalog, op.Zenith: zenith, op.PlanetPlace: planet,
    op.MoonPlace: on_moon,
}  # fmt: skip
