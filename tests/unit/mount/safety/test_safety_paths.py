"""The way of two axes past the Sun, and the pure rules of the limits."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, to_vector
from gateway.core.errors import PastMeridian
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.slew_paths import PATH_STEP, is_clear, readings_after
from gateway.mount.safety.allow import is_moving_out
from gateway.mount.safety.hour_angle import angle_from_pier_side, check_past_meridian, past_meridian
from tests.support.each import each
from tests.support.examples import some

angles = st.floats(-180.0, 180.0)
readings = st.tuples(angles, st.floats(-180.0, 180.0))


def nearest(start: Pair, turn: Pair, sun: Pair, looks: int = 500) -> float:
    """The least distance, by looking everywhere; with vectors, so that it shares no formula."""
    target = to_vector(*sun)
    length = max(map(abs, turn))
    best = -1.0
    for n in range(looks + 1):
        here = to_vector(*readings_after(start, turn, length * n / looks))
        best = max(best, sum(a * b for a, b in zip(here, target, strict=True)))
    return math.degrees(math.acos(max(-1.0, min(1.0, best))))


@some
@given(readings, st.tuples(angles, angles), st.tuples(angles, st.floats(-90.0, 90.0)), st.floats(1.0, 60.0))
def test_path_is_allowed_only_if_it_keeps_the_distance_from_the_sun(
    start: Pair, turn: Pair, sun: Pair, limit: float
) -> None:
    least = nearest(start, turn, sun)
    if least > limit + PATH_STEP:
        assert is_clear(start, turn, sun, limit)
    elif least < limit - PATH_STEP:
        assert not is_clear(start, turn, sun, limit)


@some
@given(readings, st.tuples(angles, angles))
def test_computed_path_begins_and_ends_at_the_given_positions(start: Pair, turn: Pair) -> None:
    length = max(map(abs, turn))
    end = start[0] + turn[0], start[1] + turn[1]
    assert separation(*readings_after(start, turn, 0.0), *start) < 1e-6
    assert separation(*readings_after(start, turn, length), *end) < 1e-6


@each(
    ("turn", "sun", "free"),
    [
        ((90.0, 0.0), (45.0, 25.0), True),
        ((90.0, 0.0), (45.0, 15.0), False),
        ((90.0, 30.0), (30.0, 35.0), False),  # one axis rests: 30 degrees of both first, right under the Sun
        ((90.0, 30.0), (60.0, 5.0), True),  # at its end 30 degrees up, it passes 25 degrees above
        ((-90.0, 0.0), (45.0, 15.0), True),
    ],
)
def test_path_past_a_20_degree_circle_is_clear_only_outside_the_circle(turn: Pair, sun: Pair, free: bool) -> None:
    assert is_clear((0.0, 0.0), turn, sun, 20.0) is free


@each(
    ("hour_angle", "side", "past"),
    [
        (10.0, "W", 10.0), (-10.0, "W", -10.0), (-10.0, "E", 10.0), (10.0, "E", -10.0),  # German: towards the pier
        (170.0, "E", -10.0), (-170.0, "E", 10.0), (-170.0, "W", -10.0), (170.0, "W", 10.0),  # under the pole, too
        (10.0, None, 10.0), (-100.0, None, 100.0), (350.0, None, 10.0),  # a fork: both ways
    ],
)  # fmt: skip
def test_distance_past_the_meridian_is_computed_for_each_pier_side(
    hour_angle: float, side: str | None, past: float
) -> None:
    assert past_meridian(angle_from_pier_side(hour_angle, side), german=side is not None) == pytest.approx(past)


def test_hour_angle_exactly_at_the_limit_is_allowed() -> None:
    limits = Limits(hour_angle=75.0)
    check_past_meridian(limits, 75.0, german=False)
    check_past_meridian(limits, 285.0, german=False)
    check_past_meridian(limits, 165.0, german=True)
    check_past_meridian(Limits(), 170.0, german=False)
    for beyond in (75.2, -75.2):
        with pytest.raises(PastMeridian):
            check_past_meridian(limits, beyond, german=False)
        with pytest.raises(PastMeridian):
            check_past_meridian(limits, beyond + 90.0 if beyond > 0.0 else beyond - 90.0, german=True)


@some
@given(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0))
def test_motion_back_from_a_limit_is_never_stopped(before: float, now: float) -> None:
    limits = Limits(lowest=10.0, highest=80.0)
    if is_moving_out(limits, before, now):
        assert (now < before and now < 10.0) or (now > before and now > 80.0)
    assert not is_moving_out(Limits(lowest=-90.0, highest=90.0), before, now)


NUMBERS = st.one_of(st.floats(), st.floats(-400, 400))


@some
@given(st.tuples(NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS), NUMBERS)
def test_path_with_infinite_or_nan_values_is_not_allowed_past_the_sun(
    start: tuple[float, float], turn: tuple[float, float], place: tuple[float, float], limit: float
) -> None:
    free = is_clear(start, turn, place, limit)  # it ends
    if not all(map(math.isfinite, (*start, *turn, *place, limit))):
        assert not free
