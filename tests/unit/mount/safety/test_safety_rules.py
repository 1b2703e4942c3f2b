"""The rules over what is going on, one by one: values in, a verdict out. No mount, no loop."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.mount.motion.seen import (
    ObservedMotion,
    PositionSample,
    Rates,
    add_first_position,
    add_position,
    begin_motion,
)
from gateway.mount.motion.wanted import MotionState
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.motions import needs_alignment
from gateway.mount.safety.allow import (
    JudgedState,
    PastMeridianState,
    StopTiming,
    farthest_from_suns,
    first_position_deadline,
    judge_motion,
)
from gateway.mount.safety.watch import blind_reason
from tests.support.each import each

HERE = op.Equatorial(10.0, 20.0)
DOWN = op.Move(op.Direction.SOUTH, op.Rate(name="max"))
#: An exchange of 50 ms, a look every 0.4 s: 0.4 + 3 * 0.05 + 0.5 s from one look to rest.
TIMING = StopTiming(0.05, 1, 0.4)
EQUATORIAL = op.Status(op.Tracking.EQ_NORTH, aligned=True, equatorial=True)


def seen(*samples: PositionSample) -> ObservedMotion:
    """One position a second, long after the motion began."""
    now = add_first_position(ObservedMotion(), samples[0])
    for sample in samples[1:]:
        now = add_position(now, sample)
    return now


def sinking(start: float, rate: float, step: float = 0.5) -> ObservedMotion:
    """Two looks at a tube that sinks by so many degrees a second."""
    return seen(PositionSample(100.0, HERE, start), PositionSample(100.0 + step, HERE, start - rate * step))


def view(now: ObservedMotion, limits: Limits, moving: MotionState = MotionState(False, {2: DOWN})) -> JudgedState:
    return JudgedState(now, limits, TIMING, moving, limits.sun, EQUATORIAL)


@each(("lowest", "stops"), [(20.0, True), (10.0, False)])
def test_sinking_mount_is_stopped_where_the_next_reading_would_be_too_late(lowest: float, stops: bool) -> None:
    """4 degrees a second from 23 degrees: 1.15 s at least until it rests, so 4.6 degrees and more are needed."""
    verdict = judge_motion(view(sinking(25.0, 4.0), Limits(lowest=lowest)))
    assert bool(verdict.reason) is stops
    if not stops:
        assert verdict.stop_in == pytest.approx((23.0 - 10.0) / 4.0 - TIMING.stop_time)


@each(
    ("moving", "ends"),
    [(MotionState(False, {2: DOWN}), True), (MotionState(True, {}), False), (MotionState(False, {}), False)],
)
def test_altitude_limit_ends_arrows_but_no_goto_when_the_clocks_disagree(moving: MotionState, ends: bool) -> None:
    sunk = seen(
        PositionSample(0.0, HERE, 60.0, other_altitudes=(23.0,)),
        PositionSample(0.5, HERE, 59.0, other_altitudes=(22.0,)),
    )
    assert bool(judge_motion(view(sunk, Limits(lowest=20.0), moving)).reason) is ends


def test_motion_out_of_a_forbidden_place_is_allowed() -> None:
    assert not judge_motion(view(sinking(5.0, -4.0), Limits(lowest=20.0))).reason


def test_running_goto_above_the_limit_is_not_stopped_for_its_speed() -> None:
    assert not judge_motion(view(sinking(22.0, 4.0), Limits(lowest=19.99), MotionState(True, {}))).reason


def test_slow_approach_to_the_sun_is_stopped_though_each_step_is_tiny() -> None:
    far = seen(PositionSample(0.0, HERE, sun_distances=(60.0,)), PositionSample(1.0, HERE, sun_distances=(59.0,)))
    assert not judge_motion(view(far, Limits())).reason
    assert farthest_from_suns(view(far, Limits())) == (59.0,)
    near = replace(
        seen(PositionSample(0.0, HERE, sun_distances=(19.0,)), PositionSample(1.0, HERE, sun_distances=(18.96,))),
        farthest_from_suns=(19.0,),
    )
    assert not judge_motion(view(near, Limits())).reason
    creeping = add_position(
        replace(near, farthest_from_suns=farthest_from_suns(view(near, Limits()))),
        PositionSample(2.0, HERE, sun_distances=(18.92,)),
    )
    assert judge_motion(view(creeping, Limits())).reason == "the Sun (19 degrees from it)"


@each(("distance", "stops"), [(24.0, True), (25.0, False)])
def test_fast_approach_to_the_sun_ends_before_the_next_reading(distance: float, stops: bool) -> None:
    """4 degrees a second: 4.2 degrees until it rests, if the next position is waited for."""
    fast = seen(
        PositionSample(0.0, HERE, sun_distances=(distance + 2.0,)), PositionSample(0.5, HERE, sun_distances=(distance,))
    )
    verdict = judge_motion(view(fast, Limits()))
    assert bool(verdict.reason) is stops
    if not stops:
        assert verdict.stop_in == pytest.approx((distance - 20.0) / 4.0 - TIMING.stop_time)


@each(
    ("past", "reason"),
    [
        (PastMeridianState(29.0, 1.0), True),
        (PastMeridianState(29.0, -1.0), False),
        (PastMeridianState(20.0, 1.0), False),
        (None, False),
    ],
)
def test_only_motion_towards_the_pier_is_stopped_past_the_meridian(
    past: PastMeridianState | None, reason: bool
) -> None:
    moved = seen(PositionSample(0.0, HERE, 40.0), PositionSample(1.0, HERE, 40.0))
    assert bool(judge_motion(replace(view(moved, Limits(hour_angle=30.0)), past_meridian=past)).reason) is reason


@each("moving", [MotionState(True, {}), MotionState(True, {}, ordered_by_client=False)])
def test_goto_is_not_judged_by_its_hour_angle(moving: MotionState) -> None:
    moved = seen(PositionSample(0.0, HERE, 40.0), PositionSample(1.0, HERE, 40.0))
    assert not judge_motion(
        replace(view(moved, Limits(hour_angle=30.0), moving), past_meridian=PastMeridianState(60.0, 4.0))
    ).reason


def test_goto_begun_at_the_mount_itself_may_brake_just_before_a_limit() -> None:
    """At 4 degrees a second it may brake in the remaining 2; it is stopped when it gets there."""
    by_itself = MotionState(True, {}, ordered_by_client=False)
    verdict = judge_motion(view(sinking(24.0, 4.0), Limits(lowest=20.0), by_itself))
    assert not verdict.reason and verdict.stop_in == pytest.approx(2.75 / 4.0 - TIMING.round_trip)
    assert judge_motion(view(sinking(21.9, 4.0), Limits(lowest=20.0), by_itself)).reason


@each(
    ("limits", "lowest", "highest"),
    [
        (Limits(), -90.0, 90.0),
        (Limits(20.0, 80.0, key_limits=(20.0, 80.0)), 20.0, 80.0),
        (Limits(20.0, key_limits=(20.0, 90.0)).without_altitudes(), -90.0, 90.0),
        (Limits(20.0, key_limits=(20.0, 90.0)).narrowed(30.0, 60.0), 20.0, 90.0),
    ],
)
def test_motion_by_the_hand_control_is_stopped_only_at_configured_limits(
    limits: Limits, lowest: float, highest: float
) -> None:
    assert (limits.for_keypad().lowest, limits.for_keypad().highest) == (lowest, highest)


def test_soonest_of_several_stop_deadlines_applies() -> None:
    moved = seen(PositionSample(0.0, HERE, 60.0, 0.0, (80.0,)), PositionSample(1.0, HERE, 59.0, 0.0, (79.0,)))
    verdict = judge_motion(view(moved, Limits(lowest=0.0)))
    assert (verdict.reason, verdict.limit_name) == ("", "the altitude limit")
    assert verdict.stop_in == pytest.approx(59.0 - TIMING.stop_time)


def test_first_reading_of_a_motion_is_due_before_it_can_reach_a_limit() -> None:
    looked = view(seen(PositionSample(50.0, HERE, 30.0)), Limits(lowest=10.0, sun=0.0))
    assert first_position_deadline(looked, 50.0, 2.0).stop_in == pytest.approx(20.0 / 2.0 - TIMING.stop_time)
    assert first_position_deadline(looked, 50.0, 0.05).stop_in is None


def test_motion_from_rest_is_timed_from_its_start_without_an_old_rate() -> None:
    before = sinking(40.0, 1.0)
    assert begin_motion(before, 130.0, 4.0, at_rest=True).last == replace(before.last, time=130.0)
    assert begin_motion(before, 130.0, 4.0, at_rest=False).last == before.last
    assert begin_motion(before, 130.0, 4.0, at_rest=False).rates == Rates()


@each(
    ("moving", "age", "since", "ends"),
    [
        (MotionState(False, {2: DOWN}), 1.5, 9.0, True),
        (MotionState(False, {2: DOWN}), 0.5, 9.0, False),
        (MotionState(False, {2: DOWN}), 1.5, 0.5, False),
        (MotionState(True, {}), 1.5, 9.0, False),
    ],
)
def test_arrow_but_no_goto_is_stopped_if_positions_are_missing(
    moving: MotionState, age: float, since: float, ends: bool
) -> None:
    assert bool(blind_reason(moving, age, since)) is ends


def test_park_and_sync_of_an_unaligned_mount_are_refused_unless_permitted() -> None:
    assert needs_alignment(op.Park(), sync_aligns=False, unaligned_policy="refuse")
    assert not needs_alignment(op.Park(), sync_aligns=False, unaligned_policy="allow")
    assert needs_alignment(op.Sync(1.0, 2.0), sync_aligns=False, unaligned_policy="allow")
    assert not needs_alignment(op.Sync(1.0, 2.0), sync_aligns=True, unaligned_policy="refuse")
    assert not needs_alignment(
        op.Move(op.Direction.SOUTH, op.Rate(key=1)), sync_aligns=False, unaligned_policy="refuse"
    )


def test_mount_that_runs_on_longer_is_stopped_earlier() -> None:
    longer = StopTiming(0.05, 1, 0.4, run_on=2.5)
    assert longer.stop_time - TIMING.stop_time == pytest.approx(2.0)
    assert longer.reaction_time_after(9.0) - TIMING.reaction_time_after(9.0) == pytest.approx(2.0)
