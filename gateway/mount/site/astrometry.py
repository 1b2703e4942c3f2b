"""What no mount is asked for because it follows from other things: horizon places, axis readings, equinox, planets.

All of it needs the site, some of it the clock; without a site it is refused in words.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import wrap360
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Unsupported


class SiteAndTime(Protocol):
    """Where and when: a site, and UTC as Unix seconds."""

    def site(self) -> op.Place | None: ...
    def unix(self) -> float: ...


class SiteAstrometry:
    """Astronomy at this mount's site and by its clock. ``equinox`` is what the mount's coordinates mean."""

    def __init__(self, sky: Sky, site_clock: SiteAndTime, equinox: str) -> None:
        self.sky, self.site_clock, self.equinox = sky, site_clock, equinox

    def means(self, equinox: str) -> None:
        """The mount has told its version: this is what its coordinates mean."""
        self.equinox = equinox

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
