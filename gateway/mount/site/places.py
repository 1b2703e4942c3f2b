"""Operations that need only site and clock, and not the mount: equinoxes, the zenith, planets, places on the Moon."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gateway.astro.ephemeris.almanac import SKY_PARTS
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Invalid, Unsupported
from gateway.mount.site.astrometry import SiteAstrometry


def to_equinox_of_date(astrometry: SiteAstrometry, operation: op.ToEquinoxOfDate) -> op.Equatorial:
    """Convert a J2000 position to the equinox of date: precession and nutation."""
    return op.Equatorial(*astrometry.sky.from_j2000(operation.ra, operation.dec, astrometry.site_clock.unix()))


def to_j2000(astrometry: SiteAstrometry, operation: op.ToJ2000) -> op.Equatorial:
    """Convert a position of date to J2000."""
    return op.Equatorial(*astrometry.sky.to_j2000(operation.ra, operation.dec, astrometry.site_clock.unix()))


def zenith_position(astrometry: SiteAstrometry, operation: op.Zenith) -> op.Equatorial:
    """Return the zenith as a J2000 position."""
    return to_j2000(astrometry, op.ToJ2000(astrometry.sidereal_time(), astrometry.site().latitude))


def planet_position(astrometry: SiteAstrometry, operation: op.PlanetPlace) -> op.Equatorial:
    """Return a planet's geocentric position of date; its parallax, at most 0.5' (Venus), is neglected.

    Raises Invalid for an unknown name, Unsupported while no table gives the positions of planets.
    """
    name = operation.name.capitalize()
    if name not in SKY_PARTS[1:]:
        raise Invalid(f"There is no planet {operation.name!r}; write {', '.join(SKY_PARTS[3:-1])} or {SKY_PARTS[-1]}.")
    position = astrometry.sky.planet(name, astrometry.site_clock.unix())
    if position is None:
        raise Unsupported("The positions of the planets are not available yet.")
    return op.Equatorial(*position)


def moon_position(astrometry: SiteAstrometry, operation: op.MoonPlace) -> op.Equatorial:
    """Return the position of date of the Moon or a point on it. Raises BelowHorizon if the Moon's centre is below."""
    site, unix = astrometry.site(), astrometry.site_clock.unix()
    ra, dec, _ = astrometry.sky.moon(unix, site.latitude, site.longitude)
    if astrometry.sky.az_alt(ra, dec, site.latitude, site.longitude, unix)[1] < 0.0:
        raise BelowHorizon("The Moon is below the horizon.")
    if operation.latitude is not None and operation.longitude is not None:
        ra, dec = astrometry.sky.moon_spot(unix, site.latitude, site.longitude, operation.latitude, operation.longitude)
    return op.Equatorial(ra, dec)


POSITION_FUNCTIONS: dict[type[op.Operation], Callable[[SiteAstrometry, Any], op.Equatorial]] = {
    op.ToEquinoxOfDate: to_equinox_of_date, op.ToJ2000: to_j2000, op.Zenith: zenith_position,
    op.PlanetPlace: planet_position, op.MoonPlace: moon_position,
}  # fmt: skip
