"""The little spherical trigonometry the tests need to choose targets that are up.

Good to a minute of arc over decades, which is ample for that; no test judges the product by it.
"""

from __future__ import annotations

import datetime
from math import asin, atan2, cos, degrees, hypot, radians, sin
from typing import NamedTuple

import erfa


class Spot(NamedTuple):
    """A place in the sky, equinox of date, both in degrees."""

    ra: float
    dec: float


class Site(NamedTuple):
    """Degrees, north and east positive."""

    latitude: float
    longitude: float


NIGHT = datetime.datetime(2026, 1, 15, 22, 0, 0, tzinfo=datetime.UTC)
"""An hour at which it is dark at both sites."""
NORTH = Site(45.0, 10.0)
SOUTH = Site(-34.0, 18.5)


def sidereal_degrees(moment: datetime.datetime, longitude: float) -> float:
    """Mean sidereal time of a longitude (Meeus, Astronomical Algorithms, 12.4, linear terms)."""
    days = (moment - datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC)).total_seconds() / 86400.0
    return (280.46061837 + 360.98564736629 * days + longitude) % 360.0


def spot_at(azimuth: float, altitude: float, site: Site, moment: datetime.datetime) -> Spot:
    """What stands at this azimuth (from north through east) and altitude."""
    a, h, latitude = radians(azimuth), radians(altitude), radians(site.latitude)
    dec = asin(sin(h) * sin(latitude) + cos(h) * cos(latitude) * cos(a))
    hour_angle = atan2(-sin(a) * cos(h), sin(h) * cos(latitude) - cos(h) * sin(latitude) * cos(a))
    return Spot((sidereal_degrees(moment, site.longitude) - degrees(hour_angle)) % 360.0, degrees(dec))


def separation(one: Spot, other: Spot) -> float:
    """Degrees between two places, also when they are nearly the same (haversines)."""
    half_dec = sin(radians(one.dec - other.dec) / 2)
    half_ra = sin(radians(one.ra - other.ra) / 2)
    chord = hypot(half_dec, half_ra * max(0.0, cos(radians(one.dec)) * cos(radians(other.dec))) ** 0.5)
    return degrees(2 * asin(min(1.0, chord)))


def arcseconds(one: Spot, other: Spot) -> float:
    """Seconds of arc between two places."""
    return separation(one, other) * 3600.0


def same_site(one: Site, other: Site, arcminutes: float) -> bool:
    """Whether two sites agree in latitude and in longitude to so many minutes of arc."""
    return all(abs(a - b) * 60.0 <= arcminutes for a, b in zip(one, other, strict=True))


def rounded(spot: Spot) -> Spot:
    """The same place in whole seconds of time and of arc, as LX200 commands can say it."""
    return Spot(round(spot.ra * 240) % 86400 / 240, round(spot.dec * 3600) / 3600)


def target_up(start: Spot, distance: float, site: Site, moment: datetime.datetime = NIGHT) -> Spot:
    """The place 40° to 60° high whose distance from `start` is nearest to `distance` degrees."""
    grid = (spot_at(az, alt, site, moment) for alt in range(40, 65, 5) for az in range(5, 365, 10))
    away_from_poles = (spot for spot in grid if abs(spot.dec) < 70)
    return rounded(min(away_from_poles, key=lambda spot: abs(separation(spot, start) - distance)))


def _days(moment: datetime.datetime) -> tuple[float, float]:
    """A Julian date in two parts."""
    return 2440587.5, moment.timestamp() / 86400.0


def of_date(spot: Spot, moment: datetime.datetime) -> Spot:
    """A place of J2000 by the true equator and equinox of date, by erfa: precession and nutation, no aberration."""
    vector = erfa.rxp(erfa.pnm06a(*_days(moment)), erfa.s2c(radians(spot.ra), radians(spot.dec)))
    ra, dec = erfa.c2s(vector)
    return Spot(degrees(ra) % 360.0, degrees(dec))


def of_2000(spot: Spot, moment: datetime.datetime) -> Spot:
    """The other way."""
    vector = erfa.trxp(erfa.pnm06a(*_days(moment)), erfa.s2c(radians(spot.ra), radians(spot.dec)))
    ra, dec = erfa.c2s(vector)
    return Spot(degrees(ra) % 360.0, degrees(dec))


def apparent(spot: Spot, moment: datetime.datetime) -> Spot:
    """What INDI makes of a place of J2000: of date, with aberration."""
    ra, dec, origins = erfa.atci13(radians(spot.ra), radians(spot.dec), 0.0, 0.0, 0.0, 0.0, *_days(moment))
    return Spot(degrees(ra - origins) % 360.0, degrees(dec))
