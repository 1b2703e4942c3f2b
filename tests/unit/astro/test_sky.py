"""The sky against almanacs, eclipses that were seen, and astropy's own coordinates.

Numbers typed here come from Meeus, Astronomical Algorithms (2nd edition), from NASA's eclipse tables and from
almanacs. The closed forms and the exact ones are each held to their own error.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from gateway.astro.ephemeris import by_astropy
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation, wrap180
from tests.support import exact_sky
from tests.support.sampling import as_a_rule

ARCSECOND = 1.0 / 3600.0


def unix(*date: int) -> float:
    return datetime(*date, tzinfo=UTC).timestamp()  # type: ignore[misc, arg-type]


@pytest.fixture(scope="module")
def exact() -> Sky:
    sky = Sky()
    exact_sky.load(sky)
    assert sky.ready
    return sky


@pytest.fixture
def closed() -> Sky:
    return Sky()


# -- numbers typed by hand ------------------------------------------------------------------------------

GREENWICH_1987 = (13 + 10 / 60 + 46.1351 / 3600) * 15  # Meeus 12.a, apparent, 1987 April 10, 0h UT1
UT1_UTC_1987 = -0.2910912  # the IERS, that day


def test_sidereal_time(exact: Sky, closed: Sky) -> None:
    moment = unix(1987, 4, 10) - UT1_UTC_1987
    assert exact.sidereal_time(moment, 0.0) == pytest.approx(GREENWICH_1987, abs=0.005 / 240)
    assert closed.sidereal_time(moment + UT1_UTC_1987, 0.0) == pytest.approx(GREENWICH_1987, abs=0.02 / 240)
    east = exact.sidereal_time(moment, 170.0)
    assert east == pytest.approx(GREENWICH_1987 + 170.0 - 360.0, abs=0.005 / 240)


def test_sidereal_time_runs_evenly_over_the_minute(exact: Sky) -> None:
    """The anchor is taken anew each minute: no step there."""
    before, after = (exact.sidereal_time(unix(2026, 11, 21) + s, 0.0) for s in (59.999, 60.001))
    assert after - before == pytest.approx(0.002 * 1.00273791 / 240, abs=1e-7)


def test_horizon(exact: Sky, closed: Sky) -> None:
    """Meeus 13.b: Venus from Washington, 1987 April 10, 19h21m UT."""
    ra, dec = (23 + 9 / 60 + 16.641 / 3600) * 15, -(6 + 43 / 60 + 11.61 / 3600)
    site = 38 + 55 / 60 + 17 / 3600, -(5 + 8 / 60 + 15.7 / 3600) * 15
    moment = unix(1987, 4, 10, 19, 21)
    for sky, ut1_utc in ((exact, UT1_UTC_1987), (closed, 0.0)):
        az, alt = sky.horizon(ra, dec, *site, moment - ut1_utc)
        assert (az, alt) == pytest.approx((248.0337, 15.1249), abs=1e-4)
        assert sky.equatorial(az, alt, *site, moment - ut1_utc) == pytest.approx((ra, dec), abs=1e-9)


def test_equinox_of_date(exact: Sky, closed: Sky) -> None:
    """Meeus 21.b and 23.a: theta Persei on 2028 November 13.19, precession and nutation."""
    j2000 = 41.054063, 49.227750
    of_date = 41.547214 + 15.843 * ARCSECOND, 49.348483 + 6.218 * ARCSECOND
    moment = unix(2028, 11, 13) + 0.19 * 86400
    for sky, error in ((exact, 0.1), (closed, 0.5)):
        assert separation(*sky.to_of_date(*j2000, moment), *of_date) < error * ARCSECOND
        assert separation(*sky.to_j2000(*of_date, moment), *j2000) < error * ARCSECOND


def test_sun(exact: Sky, closed: Sky) -> None:
    """Meeus 25.b: 1992 October 13, 0h TD, the value of the full theory."""
    place = (13 + 13 / 60 + 30.749 / 3600) * 15, -(7 + 47 / 60 + 1.74 / 3600)
    moment = unix(1992, 10, 13) - 59.184
    assert separation(*exact.sun(moment), *place) < 0.1 * ARCSECOND
    assert separation(*closed.sun(moment), *place) < 0.01


@pytest.mark.parametrize(
    ("moment", "ra", "dec"),
    [
        (unix(2024, 3, 20, 3, 6, 21), 0.0, 0.0),  # equinox
        (unix(2024, 6, 20, 20, 51, 0), 90.0, 23.4382),  # solstice, to the minute
    ],
)
def test_seasons(exact: Sky, closed: Sky, moment: float, ra: float, dec: float) -> None:
    assert separation(*exact.sun(moment), ra, dec) < 2 * ARCSECOND
    assert separation(*closed.sun(moment), ra, dec) < 0.01


def test_moon_from_the_centre_of_the_earth(exact: Sky, closed: Sky) -> None:
    """Meeus 47.a: 1992 April 12, 0h TD, seen from where the Earth's centre lies straight behind the site."""
    moment = unix(1992, 4, 12) - 58.184
    lat = math.degrees(math.atan(math.tan(math.radians(13.768368)) * 1.00673950))  # geocentric to geodetic
    for sky, error, kilometres in ((exact, 3 * ARCSECOND, 10), (closed, 0.04, 100)):
        ra, dec, distance = sky.moon(moment, lat, 134.688470 - sky.sidereal_time(moment, 0.0))
        assert separation(ra, dec, 134.688470, 13.768368) < error
        assert distance == pytest.approx(368409.7 - 6376.9, abs=kilometres)


@pytest.mark.parametrize(
    ("moment", "lat", "lon"),
    [
        (unix(2024, 4, 8, 18, 17, 16), 25.2867, -104.1383),
        (unix(2017, 8, 21, 18, 25, 32), 36.9667, -87.6717),
        (unix(2019, 7, 2, 19, 22, 58), -17.3900, -108.9870),
        (unix(2010, 7, 11, 19, 33, 31), -19.7500, -121.8800),
    ],
)
def test_at_greatest_eclipse_the_moon_covers_the_sun(
    exact: Sky, closed: Sky, moment: float, lat: float, lon: float
) -> None:
    """NASA's points of greatest eclipse: Sun, Moon, parallax and sidereal time in one."""
    for sky, error in ((exact, 15 * ARCSECOND), (closed, 0.04)):
        ra, dec, _ = sky.moon(moment, lat, lon)
        assert separation(ra, dec, *sky.sun(moment)) < error


def test_the_height_of_the_sun_at_an_eclipse(exact: Sky, closed: Sky) -> None:
    """NASA, 2024 April 8: the Sun stood 69.8 degrees high in azimuth 149.4."""
    moment = unix(2024, 4, 8, 18, 17, 16)
    for sky in (exact, closed):
        az, alt = sky.horizon(*sky.sun(moment), 25.2867, -104.1383, moment)
        assert (az, alt) == pytest.approx((149.4, 69.8), abs=0.06)


# -- astropy as a judge ---------------------------------------------------------------------------------

EDGES = [(90.0, 0.0), (-90.0, 0.0), (0.0, 180.0), (-33.0, -180.0), (51.5, 0.0), (-0.2, -78.5)]


def scenes(count: int) -> Iterator[tuple[float, float, float, float, float]]:
    """(unix, lat, lon, ra, dec): poles, date line, both hemispheres, 1975 to 2024."""
    dice = random.Random(1975)
    for number in range(count):
        anywhere = math.degrees(math.asin(dice.uniform(-1.0, 1.0))), dice.uniform(-180.0, 180.0)
        lat, lon = EDGES[number] if number < len(EDGES) else anywhere
        dec = math.degrees(math.asin(dice.uniform(-1.0, 1.0)))
        yield dice.uniform(unix(1975, 1, 1), unix(2024, 1, 1)), lat, lon, dice.uniform(0.0, 360.0), dec


def table_of_astropy(path: Path, moments: list[float]) -> Any:
    """The IERS' records around these moments as astropy reads them: the whole table takes it as long as all else.

    It wants predictions (P) too.
    """
    days = {math.floor(moment / 86400.0) + 40587 + beside for moment in moments for beside in (-1, 0, 1, 2)}
    with open(by_astropy.astropy_iers_data.IERS_A_FILE, "rb") as file:
        path.write_bytes(b"".join(line for line in file if float(line[7:15]) in days or line[57:58] == b"P"))
    return pytest.importorskip("astropy.utils.iers").IERS_A.read(str(path))


def test_astropy_agrees(exact: Sky, closed: Sky, tmp_path: Path) -> None:
    """All scenes at once: astropy takes as long for one."""
    units = pytest.importorskip("astropy.units")
    coordinates = pytest.importorskip("astropy.coordinates")
    time = pytest.importorskip("astropy.time")
    iers = pytest.importorskip("astropy.utils.iers")
    drawn = list(scenes(as_a_rule(14, whole=24)))
    moments, lats, lons, ras, decs = map(list, zip(*drawn, strict=True))
    table = table_of_astropy(tmp_path / "finals", moments)
    with iers.conf.set_temp("auto_download", False), iers.earth_orientation_table.set(table):
        at = time.Time(moments, format="unix")
        place = coordinates.EarthLocation.from_geodetic(lons, lats)
        star = coordinates.SkyCoord(ras, decs, unit=units.deg, frame=coordinates.GCRS(obstime=at))
        of_date = star.transform_to(coordinates.TETE(obstime=at))
        seen_from = coordinates.TETE(obstime=at, location=place)
        seen = coordinates.SkyCoord(of_date.ra, of_date.dec, frame=seen_from).transform_to(
            coordinates.AltAz(obstime=at, location=place)
        )
        sun = coordinates.get_sun(at).transform_to(coordinates.TETE(obstime=at))
        moon = coordinates.get_body("moon", at, place).transform_to(seen_from)
        sidereal = at.sidereal_time("apparent", lons * units.deg).deg
    limits = (exact, 0.01, 0.1, 0.1, 0.7, 45), (closed, 0.95, 0.5, 36.0, 150.0, 150)
    for index, (moment, lat, lon, ra, dec) in enumerate(drawn):
        date = of_date.ra.deg[index], of_date.dec.deg[index]
        for sky, seconds, axes, sunny, lunar, kilometres in limits:
            assert abs(wrap180(sky.sidereal_time(moment, lon) - sidereal[index])) < seconds / 240
            assert separation(*sky.to_of_date(ra, dec, moment), *date) < axes * ARCSECOND
            assert separation(*sky.to_j2000(*date, moment), ra, dec) < axes * ARCSECOND
            horizon = sky.horizon(*date, lat, lon, moment)
            # the diurnal aberration (0.3") and polar motion (0.5") are astropy's alone
            assert separation(*horizon, seen.az.deg[index], seen.alt.deg[index]) < seconds / 240 + 1.0 * ARCSECOND
            back = sky.equatorial(*horizon, lat, lon, moment)
            assert separation(*back, *date) < 1e-9
            assert separation(*sky.sun(moment), sun.ra.deg[index], sun.dec.deg[index]) < sunny * ARCSECOND
            found = sky.moon(moment, lat, lon)
            assert separation(*found[:2], moon.ra.deg[index], moon.dec.deg[index]) < lunar * ARCSECOND
            # astropy's distance counts the 39 km that the Earth goes while the light is on its way
            assert found[2] == pytest.approx(moon.distance.km[index], abs=kilometres)


def test_exact_and_closed_agree_within_the_tables(exact: Sky, closed: Sky) -> None:
    dice = random.Random(1900)
    for _ in range(as_a_rule(30, whole=300)):
        moment = dice.uniform(unix(1973, 1, 2), unix(2099, 12, 31))
        ra, dec = dice.uniform(0.0, 360.0), dice.uniform(-90.0, 90.0)
        of_date = exact.to_of_date(ra, dec, moment)
        assert separation(*of_date, *closed.to_of_date(ra, dec, moment)) < 0.5 * ARCSECOND
        turn = exact.sidereal_time(moment, 0.0) - closed.sidereal_time(moment, 0.0)
        assert abs(wrap180(turn)) < 0.95 / 240
        assert separation(*exact.sun(moment), *closed.sun(moment)) < 0.02
