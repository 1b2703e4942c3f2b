"""Spherical astronomy against worked examples of the literature, and its laws over the whole sphere."""

from __future__ import annotations

import math
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import (
    fold_declination,
    from_vector,
    horizon_to_hour_angle,
    hour_angle_to_horizon,
    rotate,
    separation,
    to_vector,
    transpose,
    wrap180,
    wrap360,
)
from tests.support.each import each

finite = st.floats(allow_nan=False, allow_infinity=False)
turns = st.floats(-720.0, 720.0)
latitudes = st.floats(-90.0, 90.0)


@each(
    ("angle", "positive", "signed"),
    [
        (0.0, 0.0, 0.0),
        (-0.0, 0.0, 0.0),
        (-1e-20, 0.0, -1e-20),
        (180.0, 180.0, -180.0),
        (-180.0, 180.0, -180.0),
        (359.5, 359.5, -0.5),
        (360.0, 0.0, 0.0),
        (-90.0, 270.0, -90.0),
        (765.0, 45.0, 45.0),
    ],
)
def test_angles_wrap_into_their_range(angle: float, positive: float, signed: float) -> None:
    assert wrap360(angle) == positive
    assert wrap180(angle) == signed
    assert math.copysign(1.0, wrap360(angle)) == 1.0


@each(
    ("ra", "dec", "folded"),
    [
        (10.0, 20.0, (10.0, 20.0)),
        (10.0, 90.0, (10.0, 90.0)),
        (10.0, 100.0, (190.0, 80.0)),
        (200.0, -100.0, (20.0, -80.0)),
        (10.0, 180.0, (190.0, 0.0)),
        (10.0, 270.0, (10.0, -90.0)),
        (10.0, 350.0, (10.0, -10.0)),
        (-5.0, 0.0, (355.0, 0.0)),
    ],
)
def test_declination_past_the_pole_folds_back(ra: float, dec: float, folded: tuple[float, float]) -> None:
    assert fold_declination(ra, dec) == folded


@given(turns, turns)
def test_folding_a_declination_keeps_the_direction(ra: float, dec: float) -> None:
    assert to_vector(*fold_declination(ra, dec)) == pytest.approx(to_vector(ra, dec), abs=1e-12)


@each(
    ("hour_angle", "dec", "lat", "az", "alt"),
    [
        (64.352133, -6.719892, 38.921389, 248.0337, 15.1249),  # Meeus 13.b, Venus from Washington
        (0.0, 0.0, 45.0, 180.0, 45.0),  # culmination in the north
        (0.0, 0.0, -45.0, 0.0, 45.0),  # and in the south
        (90.0, 0.0, 45.0, 270.0, 0.0),  # the equator sets due west
        (-90.0, 0.0, -33.0, 90.0, 0.0),  # and rises due east
        (123.0, 90.0, 51.5, 0.0, 51.5),  # the pole stands as high as the latitude
        (30.0, 20.0, 90.0, 210.0, 20.0),  # at the north pole altitude is declination
        (30.0, -20.0, -90.0, 330.0, 20.0),
    ],
)
def test_hour_angle_converts_to_horizon_coordinates(
    hour_angle: float, dec: float, lat: float, az: float, alt: float
) -> None:
    found_az, found_alt = hour_angle_to_horizon(hour_angle, dec, lat)
    assert wrap180(found_az - az) == pytest.approx(0.0, abs=1e-4)
    assert found_alt == pytest.approx(alt, abs=1e-4)


def test_horizon_coordinates_of_venus_convert_to_its_hour_angle() -> None:
    place = horizon_to_hour_angle(248.0337, 15.1249, 38.921389)
    assert place == pytest.approx((64.352133, -6.719892), abs=2e-4)


@given(turns, latitudes, latitudes)
def test_hour_angle_horizon_conversion_is_reversible(hour_angle: float, dec: float, lat: float) -> None:
    back = horizon_to_hour_angle(*hour_angle_to_horizon(hour_angle, dec, lat), lat)
    assert separation(*back, hour_angle, dec) < 1e-11


@each(
    ("first", "second", "angle"),
    [
        ((213.9154, 19.1825), (201.2983, -11.1614), 32.7930),  # Meeus 17.a, Arcturus and Spica
        ((359.9, 0.0), (0.1, 0.0), 0.2),
        ((0.0, 89.0), (180.0, 89.0), 2.0),
        ((17.0, 90.0), (200.0, -90.0), 180.0),
        ((50.0, 40.0), (50.0, 40.0), 0.0),
        ((50.0, 0.0), (50.0, 1e-9), 1e-9),
    ],
)
def test_separation_of_two_directions_matches_worked_examples(
    first: tuple[float, float], second: tuple[float, float], angle: float
) -> None:
    assert separation(*first, *second) == pytest.approx(angle, abs=5e-5, rel=1e-3)
    assert separation(*second, *first) == pytest.approx(separation(*first, *second), abs=1e-12)


def test_direction_vectors_convert_both_ways() -> None:
    assert to_vector(90.0, 0.0) == pytest.approx((0.0, 1.0, 0.0))
    assert from_vector((0.0, -3.0, 0.0)) == (270.0, 0.0)
    quarter = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert rotate(quarter, (1.0, 2.0, 3.0)) == (2.0, -1.0, 3.0)
    assert rotate(transpose(quarter), (2.0, -1.0, 3.0)) == (1.0, 2.0, 3.0)


def unix(*date: int) -> float:
    return datetime(*date, tzinfo=UTC).timestamp()  # type: ignore[misc, arg-type]


def test_sidereal_time_at_greenwich_matches_meeus_example_12a() -> None:
    """Meeus 12.a: 1987 April 10, 0h UT1; apparent 13h10m46.1351s. UTC was 0.291 s ahead of UT1."""
    ahead = 0.2910912
    expected = (13 + 10 / 60 + 46.1351 / 3600) * 15
    moment = unix(1987, 4, 10)
    assert sidereal_time(moment, 0.0) == pytest.approx(expected, abs=0.02 / 240)  # UTC taken as UT1
    error = sidereal_time(moment + ahead, 0.0) - expected
    assert error == pytest.approx(ahead / 240, abs=0.02 / 240)


def test_sidereal_time_at_a_site_matches_meeus_examples() -> None:
    """Meeus 12.b and 13.b: 19h21m UT, mean 8h34m57.0896s (apparent 0.237 s less); 77d03'56" west."""
    expected = (8 + 34 / 60 + (57.0896 - 0.2366) / 3600) * 15
    moment = unix(1987, 4, 10, 19, 21)
    assert sidereal_time(moment, 0.0) == pytest.approx(expected, abs=0.05 / 240)
    west = 77 + 3 / 60 + 56 / 3600
    assert sidereal_time(moment, -west) == pytest.approx(expected - west, abs=0.05 / 240)
    assert sidereal_time(moment, 360 - west) == pytest.approx(expected - west, abs=0.05 / 240)


@given(finite, finite, finite, finite)
def test_spherical_functions_stay_in_range_for_any_finite_input(a: float, b: float, c: float, d: float) -> None:
    assert 0.0 <= wrap360(a) < 360.0
    assert -180.0 <= wrap180(a) < 180.0
    for lon, lat in (fold_declination(a, b), hour_angle_to_horizon(a, b, c)):
        assert 0.0 <= lon < 360.0 and -90.0 <= lat <= 90.0
    hour_angle, dec = horizon_to_hour_angle(a, b, c)
    assert -180.0 <= hour_angle < 180.0 and -90.0 <= dec <= 90.0
    assert 0.0 <= separation(a, b, c, d) <= 180.0
    assert 0.0 <= sidereal_time(a, b) < 360.0
