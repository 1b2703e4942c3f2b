"""The sky where its tables end: before 1973, at leap seconds, after the last prediction, 2100, and back again.

Outside the table the Earth's turning is not known, so both sides are given the same UT1. Judges: Skyfield with
DE421 up to 2053, PyEphem (Moshier's Moon) to 2099.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from astropy.time import Time
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.astro.ephemeris.by_astropy import ut1_table
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import SIDEREAL_RATE, from_vector, separation, wrap180
from tests.support import exact_sky
from tests.support import sky_judge as judge
from tests.support.sampling import as_a_rule

YEAR = 365.25 * 86400.0
EXACT = Sky()
exact_sky.load(EXACT)
ARCSECOND = 1.0 / 3600.0


@pytest.fixture(scope="module")
def scale() -> Any:
    return judge.timescale()[0]


@pytest.fixture(scope="module")
def kernel() -> Iterator[Any]:
    opened = judge.ephemeris()
    yield opened
    opened.close()


def years(first: float, last: float, count: int) -> judge.Array:
    return judge.drawn(np.random.default_rng(int(first)), (first - 1970.0) * YEAR, (last - 1970.0) * YEAR, count)


@pytest.mark.parametrize(("first", "last"), [(1900.0, 1972.9), (2028.5, 2053.0), (2053.0, 2099.9), (2100.1, 2130.0)])
def test_sidereal_time_and_axes_stay_accurate_outside_the_tables(scale: Any, first: float, last: float) -> None:
    """Before 1973 and from 2100 on the closed forms answer: 0.05 s and 0.5" there."""
    tables = 1973.0 < first < 2100.0
    count = as_a_rule(24, whole=100)
    when = years(first, last, count)
    ut1_utc = np.interp(when // 86400.0, *ut1_table()) if tables else 0.0
    t = scale.ut1_jd((when + ut1_utc) / 86400.0 + 2440587.5)
    seconds, axes = (0.001, 0.001) if tables else (0.05, 0.5)
    assert np.abs(judge.sidereal_error(EXACT, when, np.zeros(count), t.gast)).max() < seconds
    dice = np.random.default_rng(7)
    ra, dec = dice.uniform(0.0, 360.0, count), dice.uniform(-90.0, 90.0, count)
    of_date = judge.turned(t.M, ra, dec)
    assert judge.apart(judge.ours(EXACT.from_j2000, ra, dec, when), of_date).max() < axes


@pytest.mark.filterwarnings("ignore:ERFA function")  # nobody knows the leap seconds to come
def test_sun_and_moon_stay_accurate_after_the_tables() -> None:
    """2028 to 2099 at equal TT: how many leap seconds will come, nobody knows."""
    ephem = pytest.importorskip("ephem")
    sun_error, moon_error = [], []
    for moment in years(2028.0, 2099.9, as_a_rule(32, whole=200)):
        tt = float(Time(moment, format="unix").tt.jd) - 2415020.0  # days since 1899-12-31 12h
        date = ephem.Date(tt - ephem.delta_t(ephem.Date(tt)) / 86400.0)
        for body, found, errors in (
            (ephem.Sun(date, epoch=date), EXACT.sun(float(moment)), sun_error),
            (ephem.Moon(date, epoch=date), from_vector(EXACT.moon_vector(float(moment))), moon_error),
        ):
            errors.append(separation(*found, *np.degrees([float(body.g_ra), float(body.g_dec)])) / ARCSECOND)
    assert max(sun_error) < 2.0
    assert max(moon_error) < 25.0  # PyEphem's own few arcseconds are in it
    assert judge.rms(np.array(moon_error)) < 5.0


def test_earth_rotation_continues_over_a_leap_second(scale: Any) -> None:
    """2016-12-31: from 23:59:59.5 to 00:00:00.5 Unix time counts one second where two pass."""
    midnight = 1483228800.0
    before, after = (EXACT.sidereal_time(midnight + s, 0.0) for s in (-0.5, 0.5))
    assert wrap180(after - before) == pytest.approx(2.0 * SIDEREAL_RATE, abs=0.005 * SIDEREAL_RATE)
    for t, found in ((scale.utc(2016, 12, 31, 23, 59, 59.5), before), (scale.utc(2017, 1, 1, 0, 0, 0.5), after)):
        assert wrap180(found - 15.0 * t.gast) * 240.0 == pytest.approx(0.0, abs=0.005)


moments = st.floats(-2.3e9, 4.2e9)
directions = st.tuples(st.floats(0.0, 360.0), st.one_of(st.floats(-90.0, 90.0), st.sampled_from([-90.0, 90.0])))
latitudes = st.one_of(st.floats(-90.0, 90.0), st.sampled_from([-90.0, 0.0, 90.0]))


@settings(derandomize=True, max_examples=as_a_rule(40, whole=100))
@given(directions, moments, st.sampled_from([EXACT, Sky()]))
def test_j2000_conversion_and_its_inverse_agree(place: tuple[float, float], moment: float, sky: Sky) -> None:
    back = sky.to_j2000(*sky.from_j2000(*place, moment), moment)
    assert separation(*back, *place) < 1e-6 * ARCSECOND


@settings(derandomize=True, max_examples=as_a_rule(40, whole=100))
@given(directions, latitudes, st.floats(-180.0, 180.0), moments, st.sampled_from([EXACT, Sky()]))
def test_horizon_conversion_and_its_inverse_agree(
    place: tuple[float, float], lat: float, lon: float, moment: float, sky: Sky
) -> None:
    back = sky.az_alt(*sky.to_ra_dec(*place, lat, lon, moment), lat, lon, moment)
    assert separation(*back, *place) < 1e-6 * ARCSECOND
