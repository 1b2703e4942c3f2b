"""An end is owed until the position shows it, and not a moment longer."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.mount.motion.ends import (
    LATER_RETRY_PERIOD,
    MIN_VISIBLE_SPEED,
    RETRY_DELAYS,
    TRIES_BEFORE_WARNING,
    AxisSample,
    EndStep,
    MotionEnd,
    is_end_visible,
    next_step,
    speed_since_end,
)
from tests.support.examples import some

FAST = MotionEnd(frozenset({1, 2}), 4.0, (100.0,))


def looks(*places: tuple[float, float], axis: int = 1, resolution: float = 1 / 3600) -> list[AxisSample]:
    """Positions of one axis at these times; the other stands still."""
    return [AxisSample(at, (place, 0.0) if axis == 1 else (0.0, place), resolution) for at, place in places]


def test_stop_check_ends_only_when_the_axes_have_come_to_rest() -> None:
    going = looks((99.6, 10.0), (100.0, 11.6), (100.4, 12.9), (100.8, 13.4))
    assert next_step(FAST, going[:2], 100.1) is EndStep.READ_POSITION, "the looks before the end say nothing"
    assert next_step(FAST, going[:3], 100.4) is EndStep.READ_POSITION, "it runs on"
    assert next_step(FAST, going, 100.8) is EndStep.DONE


def test_lost_stop_is_sent_again_at_growing_intervals_and_then_reported() -> None:
    ending, now, sent, told = FAST, 100.0, [100.0], []
    samples: list[AxisSample] = []
    while now < 160.0:
        now = round(now + 0.4, 3)
        samples = [*samples, *looks((now, (now * 4.0) % 360.0))][-8:]
        step = next_step(ending, samples, now)
        assert step is not EndStep.DONE
        if step in (EndStep.SEND_AGAIN, EndStep.SEND_AND_WARN):
            sent.append(now)
            told += [now] * (step is EndStep.SEND_AND_WARN)
            ending = ending.with_retry(now)
    pauses = [round(later - before, 1) for before, later in itertools.pairwise(sent)]
    assert all(pause >= wanted - 1e-6 for pause, wanted in zip(pauses, RETRY_DELAYS, strict=False))
    assert len(sent) > TRIES_BEFORE_WARNING and len(told) == len(sent) - TRIES_BEFORE_WARNING
    assert all(pause >= LATER_RETRY_PERIOD for pause in pauses[len(RETRY_DELAYS) :])


def test_stop_check_looks_only_at_the_axes_that_should_rest() -> None:
    one = MotionEnd(frozenset({1}), 4.0, (100.0,))
    assert next_step(one, looks((100.1, 0.0), (100.5, 1.6), (100.9, 3.2), axis=2), 103.0) is EndStep.DONE
    assert next_step(one, looks((100.1, 0.0), (100.5, 1.6), (100.9, 3.2), axis=1), 103.0) is EndStep.SEND_AGAIN


def test_azimuth_passing_north_is_not_computed_as_a_fast_motion() -> None:
    assert speed_since_end(FAST, looks((100.1, 359.99), (100.5, 0.01))) == pytest.approx(0.05)


def test_coarse_position_is_not_judged_before_it_could_change() -> None:
    """Low precision: a tenth of a minute of right ascension is 90 arcseconds."""
    slow = MotionEnd(frozenset({1}), 0.1, (100.0,))
    coarse = looks((100.4, 5.0), (100.8, 5.0), resolution=90 / 3600)
    assert next_step(slow, coarse, 103.0) is EndStep.READ_POSITION
    assert next_step(slow, [*coarse[:1], *looks((103.0, 5.0), resolution=90 / 3600)], 103.0) is EndStep.DONE


@some
@given(st.floats(0.0, 2 * MIN_VISIBLE_SPEED - 1e-9))
def test_end_of_a_motion_too_slow_to_be_seen_is_not_checked_by_positions(rate: float) -> None:
    ending = MotionEnd(frozenset({1}), rate, (0.0,))
    assert not is_end_visible(ending)
    assert next_step(ending, [], 100.0) is EndStep.DONE


@some
@given(st.floats(0.2, 8.0), st.floats(0.1, 1.0), st.floats(0.0, 2.0))
def test_run_on_of_up_to_a_second_causes_no_second_stop(rate: float, every: float, begins: float) -> None:
    """The motor loses its speed evenly, and its position is told at even intervals."""
    ending = MotionEnd(frozenset({1}), rate, (0.0,))

    def place(at: float) -> float:
        moving = min(at, 1.0)
        return rate * (moving - moving * moving / 2.0)

    samples, now = [], begins * every
    while now < 5.0:
        samples.append(AxisSample(now, (place(now), 0.0)))
        step = next_step(ending, samples, now)
        assert step in (EndStep.READ_POSITION, EndStep.DONE)
        if step is EndStep.DONE:
            return
        now += every
    raise AssertionError("it never came to rest")
