"""Astronomy from site and clock, without asking the mount: positions, axis readings, planets, and the Sun to avoid.

Without a site, operations that need one raise ``Unsupported``, and the Sun counts as up.
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
#: Seconds; the Sun moves a twenty-thousandth of a degree a second against the stars, so a position is good for a
#: minute.
CACHE_FOR = 60.0
#: Degrees; a Sun this low may still shine into a tube: refraction, its disk, and a horizon below eye level.
SUN_IS_UP = -1.0


class SiteAstrometry:
    """Astronomy at the site of this mount and by its clock. ``equinox`` is that of the mount's coordinates."""

    def __init__(self, sky: Sky, site_clock: SiteClock | BestSources, equinox: str) -> None:
        self.sky, self.site_clock, self.equinox = sky, site_clock, equinox

    def place(self) -> op.Place:
        """Return the site in force. Raises Unsupported if it is unknown."""
        place = self.site_clock.site()
        if place is None:
            raise Unsupported("The site is not known.")
        return place

    def sidereal_time(self) -> float:
        """Local apparent sidereal time, degrees."""
        return self.sky.sidereal_time(self.site_clock.unix(), self.place().longitude)

    def altitude(self, ra: float, dec: float) -> float | None:
        """Return the altitude now, degrees; None if the site is unknown."""
        place = self.site_clock.site()
        if place is None:
            return None
        return self.sky.horizon(ra, dec, place.latitude, place.longitude, self.site_clock.unix())[1]

    def horizon(self, seen: op.Equatorial) -> op.Horizontal:
        """Return azimuth and altitude of a position (equinox of date)."""
        place = self.place()
        unix = self.site_clock.unix()
        return op.Horizontal(*self.sky.horizon(seen.ra, seen.dec, place.latitude, place.longitude, unix))

    def equatorial(self, seen: op.Horizontal | op.GotoHorizontal | op.GotoAxes) -> op.Equatorial:
        """Return the position (equinox of date) that is at an azimuth and altitude now."""
        place = self.place()
        unix = self.site_clock.unix()
        return op.Equatorial(*self.sky.equatorial(seen.az, seen.alt, place.latitude, place.longitude, unix))

    def axes(self, seen: op.Equatorial, wedge: bool = False) -> op.Horizontal:
        """Return the axis readings of an equatorial mount for a position; a fork on its ``wedge`` reads from north."""
        geometry = Geometry(Build.WEDGE if wedge else Build.GERMAN, self.place().latitude)
        first, second = geometry.axes(self.sidereal_time() - seen.ra, seen.dec, False)
        return op.Horizontal(wrap360(first), second)

    def from_axes(self, wanted: op.GotoAxes, wedge: bool = False) -> op.Equatorial:
        """Return the position for axis readings of an equatorial mount; a fork on its ``wedge`` reads from north."""
        build = Build.WEDGE if wedge else Build.GERMAN
        hour_angle, dec = Geometry(build, self.place().latitude).sky(wanted.az, wanted.alt)
        return op.Equatorial(wrap360(self.sidereal_time() - hour_angle), dec)

    def to_mount(self, operation: op.Goto | op.Sync | op.Choose) -> op.Goto | op.Sync | op.Choose:
        """Convert the target of an operation from the equinox of date to the mount's equinox."""
        if self.equinox != "j2000":
            return operation
        ra, dec = self.sky.to_j2000(operation.ra, operation.dec, self.site_clock.unix())
        return replace(operation, ra=ra, dec=dec)

    def from_mount(self, seen: op.Equatorial) -> op.Equatorial:
        """Convert a position from the mount's equinox to the equinox of date."""
        if self.equinox != "j2000":
            return seen
        return op.Equatorial(*self.sky.to_of_date(seen.ra, seen.dec, self.site_clock.unix()))


class SunAvoidance:
    """The Sun while it is up. ``limit`` is the smallest allowed distance, degrees; 0 turns Sun avoidance off.

    If the mount's date and this computer's differ by more than a day, it is unknown which is right, so the Sun of both
    dates is avoided. Until the mount reports a date this computer's is used, and the log warns of it; if this computer
    has lost its clock, a client's.
    """

    def __init__(
        self, limit: float, sky: Sky, sources: BestSources, settled: asyncio.Event, note_once: Callable[[str], None]
    ) -> None:
        self.limit, self._sky, self._sources, self._settled, self._note_once = limit, sky, sources, settled, note_once
        self._key: tuple[object, ...] = ()
        self._up: list[op.Equatorial] = []

    def up(self) -> list[op.Equatorial]:
        """Return the positions (equinox of date) of every Sun to be avoided now."""
        if not self.limit:
            return []
        best, host, site = self._sources.best_time(), self._sources.host(), self._sources.site()
        if best.source == COMPUTER and self._settled.is_set():  # before that the mount may still report one
            self._note_once("WARNING: the mount has reported no date: this computer's is used to avoid the Sun")
        key = best.unix // CACHE_FOR, host // CACHE_FOR, site
        if key != self._key:
            self._key = key
            moments = [best.unix]
            if abs(best.unix - host) > DAY:
                moments.append(host)
                self._note_once("WARNING: the mount's date differs from this computer's: the Sun is avoided by both")
            self._up = [place for place in (self._place(unix, site) for unix in moments) if place is not None]
        return self._up

    def _place(self, unix: float, site: op.Place | None) -> op.Equatorial | None:
        """Return the Sun's position at ``unix``; None if it is down. Without a site it counts as up."""
        sky = self._sky
        ra, dec = sky.sun(unix)
        if site is not None and sky.horizon(ra, dec, site.latitude, site.longitude, unix)[1] < SUN_IS_UP:
            return None
        return op.Equatorial(ra, dec)

    def distances(self, seen: op.Equatorial) -> list[float]:
        """Return the distances of a position from every Sun to be avoided, degrees."""
        return [separation(seen.ra, seen.dec, sun.ra, sun.dec) for sun in self.up()]


# --- operations that are answered from site and clock alone -----------------------------------------------------------


def of_date(astrometry: SiteAstrometry, wanted: op.ToEquinoxOfDate) -> op.Equatorial:
    """Convert a J2000 position to the equinox of date: precession and nutation."""
    return op.Equatorial(*astrometry.sky.to_of_date(wanted.ra, wanted.dec, astrometry.site_clock.unix()))


def of_catalog(astrometry: SiteAstrometry, wanted: op.ToJ2000) -> op.Equatorial:
    """Convert a position of date to J2000."""
    return op.Equatorial(*astrometry.sky.to_j2000(wanted.ra, wanted.dec, astrometry.site_clock.unix()))


def zenith(astrometry: SiteAstrometry, wanted: op.Zenith) -> op.Equatorial:
    """Return the zenith as a J2000 position."""
    return of_catalog(astrometry, op.ToJ2000(astrometry.sidereal_time(), astrometry.place().latitude))


def planet(astrometry: SiteAstrometry, wanted: op.PlanetPlace) -> op.Equatorial:
    """Return a geocentric position: parallax (0.5' for Venus at its nearest) is below the error of the series."""
    seen = astrometry.sky.planet(wanted.name, astrometry.site_clock.unix())
    if seen is None:
        raise Unsupported("The positions of the planets are not available yet.")
    return op.Equatorial(*seen)


def on_moon(astrometry: SiteAstrometry, wanted: op.MoonPlace) -> op.Equatorial:
    """Return the Moon, or a point on it. Raises BelowHorizon if the centre of the Moon is below the horizon."""
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
