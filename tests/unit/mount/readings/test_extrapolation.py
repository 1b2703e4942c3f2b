"""Reckoning as pure functions: never past a goal, never longer than a second, without a jump, over 0h."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gateway.astro.spherical import wrap180
from gateway.mount.readings.extrapolation import Reading, extrapolate, predict
from tests.support.each import each
from tests.support.examples import some

FAST = 8.0 * 2.0**0.5


def at(first: float, second: float, when: float, late: float = 0.0) -> Reading:
    """``late`` is how much earlier the first angle was told."""
    return Reading((first, second), (when - late, when))


def two(rates: tuple[float, float], last: tuple[float, float] = (120.0, 30.0)) -> tuple[Reading, Reading]:
    apart = 0.5
    return (at((last[0] - rates[0] * apart) % 360.0, last[1] - rates[1] * apart, 100.0 - apart), at(*last, 100.0))


def test_extrapolated_position_continues_at_the_rate_of_two_readings() -> None:
    going = extrapolate(*two((4.0, -2.0)), max_speed=FAST)
    assert predict(going, 100.0) == pytest.approx((120.0, 30.0))
    assert predict(going, 100.25) == pytest.approx((121.0, 29.5))
    assert predict(going, 101.0) == predict(going, 160.0) == pytest.approx((124.0, 28.0))
    assert predict(going, 99.98) == pytest.approx((119.92, 30.04))
    assert predict(going, 99.0) == predict(going, 99.95) == pytest.approx((119.8, 30.1)), "nobody is told of what was"


def test_extrapolated_right_ascension_wraps_at_0h_both_ways() -> None:
    east = extrapolate(*two((4.0, 0.0), (359.0, 0.0)), max_speed=FAST)
    west = extrapolate(*two((-4.0, 0.0), (1.0, 0.0)), max_speed=FAST)
    assert predict(east, 100.5) == pytest.approx((1.0, 0.0))
    assert predict(west, 100.5) == pytest.approx((359.0, 0.0))


def test_ra_and_dec_read_one_after_the_other_are_extrapolated_to_one_time() -> None:
    before, last = at(100.0, 10.0, 99.5, late=0.2), at(104.0, 14.0, 100.0, late=0.2)
    assert predict(extrapolate(before, last, max_speed=FAST * 2), 100.0) == pytest.approx((105.6, 14.0))


@each(
    ("before", "last", "why"),
    [
        (None, at(120.0, 30.0, 100.0), "one reading"),
        (at(119.9, 30.0, 99.95), at(120.0, 30.0, 100.0), "readings too near to each other"),
        (at(110.0, 30.0, 90.0), at(120.0, 30.0, 100.0), "readings too far from each other"),
        (at(120.0, 10.0, 99.5), at(120.0, 30.0, 100.0), "faster than any motor"),
        (at(120.0, 84.0, 99.5), at(120.0, 86.0, 100.0), "near the pole"),
        (at(120.0, -86.0, 99.5), at(120.0, -84.0, 100.0), "away from the other pole"),
        (at(100.0, 84.0, 99.5), at(140.0, 84.0, 100.0), "round the pole"),
    ],
)
def test_extrapolation_without_a_rate_repeats_the_last_position(
    before: Reading | None, last: Reading, why: str
) -> None:
    going = extrapolate(before, last, max_speed=FAST)
    assert {predict(going, 100.0 + n / 10.0) for n in range(20)} == {last.angles}, why


def test_extrapolated_axis_readings_wrap_and_have_no_pole() -> None:
    going = extrapolate(*two((0.0, 8.0), (10.0, 178.0)), max_speed=FAST, on_sphere=False)
    assert predict(going, 100.5) == pytest.approx((10.0, -178.0))
    jump = extrapolate(at(10.0, 100.0, 99.5), at(10.0, 110.0, 100.0), max_speed=FAST, on_sphere=False)
    assert predict(jump, 101.0) == (10.0, 110.0)


def test_extrapolation_near_the_target_covers_at_most_half_of_the_rest() -> None:
    going = extrapolate(*two((4.0, 0.0)), max_speed=FAST, goal=(121.0, 30.0))
    assert predict(going, 100.1)[0] == pytest.approx(120.4)
    assert predict(going, 101.0)[0] == pytest.approx(120.5)
    there = extrapolate(*two((4.0, 0.0)), max_speed=FAST, goal=(119.0, 30.0))
    assert predict(there, 101.0)[0] == 120.0, "it has come past it between the readings"


def test_motion_away_from_the_target_is_extrapolated_the_other_way_round() -> None:
    assert predict(extrapolate(*two((4.0, 0.0)), max_speed=FAST, goal=(60.0, 30.0)), 101.0)[0] == pytest.approx(124.0)


def test_change_of_one_resolution_step_is_not_extrapolated() -> None:
    going = extrapolate(*two((4.0, 0.02)), max_speed=FAST, resolution=20.0 / 3600.0)
    assert predict(going, 101.0) == (pytest.approx(124.0), 30.0)


RATE = st.floats(-8.0, 8.0)
RA, DEC = st.floats(0.0, 359.999), st.floats(-80.0, 80.0)


@some
@given(
    rates=st.tuples(RATE, RATE),
    last=st.tuples(RA, DEC),
    apart=st.floats(0.1, 2.0),
    late=st.floats(0.0, 0.5),
    goal=st.none() | st.tuples(RA, DEC),
    now=st.floats(-1.0, 5.0),
)
def test_extrapolation_never_passes_the_target_or_a_second_of_motion(
    rates: tuple[float, float],
    last: tuple[float, float],
    apart: float,
    late: float,
    goal: tuple[float, float] | None,
    now: float,
) -> None:
    assume(abs(last[1] - rates[1] * apart) <= 84.0)
    before = at((last[0] - rates[0] * apart) % 360.0, last[1] - rates[1] * apart, 100.0 - apart, late)
    here = at(*last, 100.0, late)
    going = extrapolate(before, here, max_speed=20.0, goal=goal)
    told = predict(going, 100.0 + now)
    assert 0.0 <= told[0] < 360.0 and -85.5 <= told[1] <= 85.5
    turned = wrap180(told[0] - last[0]), told[1] - last[1]
    for which in (0, 1):
        gone = 1.0 + (late if which == 0 else 0.0)
        assert abs(turned[which]) <= abs(rates[which]) * gone + 1e-6, "for a second at most"
        if goal is not None:
            left = wrap180(goal[which] - last[which])
            was = wrap180(goal[which] - before.angles[which])
            if was * left > 0.0 and abs(left) <= abs(was):
                assert abs(turned[which]) <= abs(left) / 2.0 + 1e-6, "never past the goal"
    assert told == predict(going, 100.0 + min(max(now, -0.05), 1.0)), "no longer than a second"
    soon = predict(going, 100.0 + now + 0.01)
    assert abs(wrap180(soon[0] - told[0])) <= abs(rates[0]) * 0.01 + 1e-6, "without a jump"
    assert abs(soon[1] - told[1]) <= abs(rates[1]) * 0.01 + 1e-6
