"""How the Moon is turned and where its places stand, against Meeus' worked example and against PyEphem."""

from __future__ import annotations

import calendar
import math
import random

import ephem
import pytest

from gateway.astro.ephemeris import closed_forms
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import from_vector, rotate, separation, transpose, wrap180, wrap360
from tests.support import exact_sky
from tests.support.sampling import as_a_rule

UNIX_AT_DUBLIN = 2415020.0 - 2440587.5  # PyEphem counts days from 1899-12-31 noon
COUNT = as_a_rule(16, whole=60)
SITES = [(48.2, 16.4), (-33.9, 18.5), (0.3, -78.5), (64.1, -21.9), (-45.9, 170.5)]


@pytest.fixture(scope="module")
def sky() -> Sky:
    exact = Sky()
    exact_sky.load(exact)
    assert exact.has_tables
    return exact


def _moments(count: int) -> list[float]:
    dice = random.Random(53)
    return [
        dice.uniform(calendar.timegm((1990, 1, 1, 0, 0, 0)), calendar.timegm((2040, 1, 1, 0, 0, 0)))
        for _ in range(count)
    ]


def _ephem(unix: float) -> ephem.Date:
    return ephem.Date(unix / 86400.0 - UNIX_AT_DUBLIN)


def libration(moon: tuple[float, float, float], unix: float) -> tuple[float, float, float]:
    """(longitude, latitude) of the disc's centre, and the position angle of the Moon's axis, degrees, for such a Moon.

    The angle is that of the northern half of the axis, from celestial north through east, in [0, 360).
    """
    axes = closed_forms.moon_orientation(unix)
    longitude, latitude = from_vector(rotate(transpose(axes), (-moon[0], -moon[1], -moon[2])))
    ra, dec = (math.radians(angle) for angle in from_vector(moon))
    pole = rotate(axes, (0.0, 0.0, 1.0))
    east = pole[1] * math.cos(ra) - pole[0] * math.sin(ra)
    north = pole[2] * math.cos(dec) - (pole[0] * math.cos(ra) + pole[1] * math.sin(ra)) * math.sin(dec)
    return wrap180(longitude), latitude, wrap360(math.degrees(math.atan2(east, north)))


def test_lunar_orientation_matches_meeus_example_53a() -> None:
    """1992 April 12, 0h TD: l' = -1.206, b' = +4.194; his Moon is at 133.167265, -3.229127, 368409.7 km."""
    unix = calendar.timegm((1992, 4, 12, 0, 0, 0)) - 69.184
    longitude, latitude, tilt = math.radians(133.167265), math.radians(-3.229127), math.radians(23.440636)
    x = math.cos(latitude) * math.cos(longitude)
    y = math.cos(latitude) * math.sin(longitude) * math.cos(tilt) - math.sin(latitude) * math.sin(tilt)
    z = math.cos(latitude) * math.sin(longitude) * math.sin(tilt) + math.sin(latitude) * math.cos(tilt)
    moon = (368409.7 * x, 368409.7 * y, 368409.7 * z)
    assert libration(moon, unix) == pytest.approx((-1.206, 4.194, 15.07), abs=0.006)


@pytest.mark.parametrize("site", SITES)
def test_lunar_feature_is_where_an_orthographic_map_shows_it(sky: Sky, site: tuple[float, float]) -> None:
    """The textbook's map of the disc, turned by the axis' angle, laid around PyEphem's topocentric Moon."""
    observer = ephem.Observer()
    observer.lat, observer.lon, observer.pressure = str(site[0]), str(site[1]), 0
    dice = random.Random(17)
    for unix in _moments(COUNT):
        observer.date = _ephem(unix)
        moon = ephem.Moon(observer)
        seen = sky._moon_from_site(unix, *site)
        longitude, latitude, angle = (math.radians(value) for value in libration(seen, unix))
        place = math.radians(dice.uniform(-60, 60)), math.radians(dice.uniform(-60, 60))
        across = math.cos(place[0]) * math.sin(place[1] - longitude)
        up = math.sin(place[0]) * math.cos(latitude) - math.cos(place[0]) * math.sin(latitude) * math.cos(
            place[1] - longitude
        )
        towards = math.sin(place[0]) * math.sin(latitude) + math.cos(place[0]) * math.cos(latitude) * math.cos(
            place[1] - longitude
        )
        radius = math.degrees(1737.4 / (math.hypot(*seen) - 1737.4 * towards))
        north = radius * (up * math.cos(angle) + across * math.sin(angle))
        east = radius * (up * math.sin(angle) - across * math.cos(angle))
        dec = math.degrees(moon.dec) + north
        ra = math.degrees(moon.ra) + east / math.cos(math.radians(dec))
        ours = sky.moon_spot(unix, *site, math.degrees(place[0]), math.degrees(place[1]))
        assert separation(*ours, ra, dec) < 30.0 / 3600.0


@pytest.mark.parametrize("name", ["Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"])
def test_planet_positions_match_pyephem(sky: Sky, name: str) -> None:
    for unix in _moments(as_a_rule(4, whole=60)):
        body = getattr(ephem, name)(_ephem(unix), epoch="2000")
        wanted = sky.from_j2000(math.degrees(body.a_ra), math.degrees(body.a_dec), unix)
        place = sky.planet(name, unix)
        assert place is not None
        assert separation(*place, *wanted) < (45.0 if name in ("Mercury", "Venus", "Mars") else 90.0) / 3600.0
