"""The sky against almanacs, eclipses that were seen, and astropy's own coordinates.

Numbers typed here come from Meeus, Astronomical Algorithms (2nd edition), from NASA's eclipse tables and from
almanacs. The closed forms and the exact ones are each held to their own error.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime

import pytest

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from tests.support import exact_sky

ARCSECOND = 1.0 / 3600.0


def unix(*date: int) -> float:
    return datetime(*date, tzinfo=UTC).timestamp()  # type: ignore[misc, arg-type]


@pytest.fixture(scope="module")
def exact() -> Sky:
    sky = Sky()
    exact_sky.load(sky)
    assert sky.has_tables
    return sky


@pytest.fixture
def closed() -> Sky:
    return Sky()


# -- numbers typed by hand ------------------------------------------------------------------------------

GREENWICH_1987 = (13 + 10 / 60 + 46.1351 / 3600) * 15  # Meeus 12.a, apparent, 1987 April 10, 0h UT1
UT1_UTC_1987 = -0.2910912  # the IERS, that day


def test_sidereal_time_matches_the_almanac(exact: Sky, closed: Sky) -> None:
    moment = unix(1987, 4, 10) - UT1_UTC_1987
    assert exact.sidereal_time(moment, 0.0) == pytest.approx(GREENWICH_1987, abs=0.005 / 240)
    assert closed.sidereal_time(moment + UT1_UTC_1987, 0.0) == pytest.approx(GREENWICH_1987, abs=0.02 / 240)
    east = exact.sidereal_time(moment, 170.0)
    assert east == pytest.approx(GREENWICH_1987 + 170.0 - 360.0, abs=0.005 / 240)


def test_horizon_coordinates_match_meeus_example_13b(exact: Sky, closed: Sky) -> None:
    """Meeus 13.b: Venus from Washington, 1987 April 10, 19h21m UT."""
    ra, dec = (23 + 9 / 60 + 16.641 / 3600) * 15, -(6 + 43 / 60 + 11.61 / 3600)
    site = 38 + 55 / 60 + 17 / 3600, -(5 + 8 / 60 + 15.7 / 3600) * 15
    moment = unix(1987, 4, 10, 19, 21)
    for sky, ut1_utc in ((exact, UT1_UTC_1987), (closed, 0.0)):
        az, alt = sky.az_alt(ra, dec, *site, moment - ut1_utc)
        assert (az, alt) == pytest.approx((248.0337, 15.1249), abs=1e-4)
        assert sky.to_ra_dec(az, alt, *site, moment - ut1_utc) == pytest.approx((ra, dec), abs=1e-9)


def test_equinox_of_date_matches_meeus_example_21b(exact: Sky, closed: Sky) -> None:
    """Meeus 21.b and 23.a: theta Persei on 2028 November 13.19, precession and nutation."""
    j2000 = 41.054063, 49.227750
    of_date = 41.547214 + 15.843 * ARCSECOND, 49.348483 + 6.218 * ARCSECOND
    moment = unix(2028, 11, 13) + 0.19 * 86400
    for sky, error in ((exact, 0.1), (closed, 0.5)):
        assert separation(*sky.from_j2000(*j2000, moment), *of_date) < error * ARCSECOND
        assert separation(*sky.to_j2000(*of_date, moment), *j2000) < error * ARCSECOND


def test_sun_position_matches_meeus_example_25b(exact: Sky, closed: Sky) -> None:
    """Meeus 25.b: 1992 October 13, 0h TD, the value of the full theory."""
    place = (13 + 13 / 60 + 30.749 / 3600) * 15, -(7 + 47 / 60 + 1.74 / 3600)
    moment = unix(1992, 10, 13) - 59.184
    assert separation(*exact.sun(moment), *place) < 0.1 * ARCSECOND
    assert separation(*closed.sun(moment), *place) < 0.01


def test_moon_position_matches_meeus_example_47a(exact: Sky, closed: Sky) -> None:
    """Meeus 47.a: 1992 April 12, 0h TD, seen from where the Earth's centre lies straight behind the site."""
    moment = unix(1992, 4, 12) - 58.184
    lat = math.degrees(math.atan(math.tan(math.radians(13.768368)) * 1.00673950))  # geocentric to geodetic
    for sky, error, kilometres in ((exact, 3 * ARCSECOND, 10), (closed, 0.04, 100)):
        ra, dec, distance = sky.moon(moment, lat, 134.688470 - sky.sidereal_time(moment, 0.0))
        assert separation(ra, dec, 134.688470, 13.768368) < error
        assert distance == pytest.approx(368409.7 - 6376.9, abs=kilometres)


# -- astropy as a judge ---------------------------------------------------------------------------------
