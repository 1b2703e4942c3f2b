"""The rules over what is going on, one by one: values in, a verdict out. No mount, no loop."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.mount.motion.seen import Changes, Observed, PositionSample, add_first_position, add_position, begin_motion
from gateway.mount.motion.wanted import Moving
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.motions import needs_alignment
from gateway.mount.safety.allow import PastNow, StopTiming, View, allow, farthest, first_stretch
from gateway.mount.safety.watch import why_blind
from tests.support.each import each

HERE = op.Equatorial(10.0, 20.0)
DOWN = op.Move(op.Direction.SOUTH, op.Rate(name="max"))
#: An exchange of 50 ms, a look every 0.4 s: 0.4 + 3 * 0.05 + 0.5 s from one look to rest.
TIMING = StopTiming(0.05, 1, 0.4)
EQUATORIAL = op.Status(op.Tracking.EQ_NORTH, aligned=True, equatorial=True)


def seen(*samples: PositionSample) -> Observed:
    """One position a second, long after the motion began."""
    now = add_first_position(Observed(), samples[0])
    for sample in samples[1:]:
        now = add_position(now, sample)
    return now


def sinking(start: float, rate: float, step: float = 0.5) -> Observed:
    """Two looks at a tube that sinks by so many degrees a second."""
    return seen(PositionSample(100.0, HERE, start), PositionSample(100.0 + step, HERE, start - rate * step))


def view(now: Observed, limits: Limits, moving: Moving = Moving(False, {2: DOWN})) -> View:
    return View(now, limits, TIMING, moving, limits.sun, EQUATORIAL)


@each(("lowest", "stops"), [(20.0, True), (10.0, False)])
def test_sinking_mount_is_stopped_where_the_next_reading_would_be_too_late(lowest: float, stops: bool) -> None:
    """4 degrees a second from 23 degrees: 1.15 s at least until it rests, so 4.6 degrees and more are needed."""
    verdict = allow(view(sinking(25.0, 4.0), Limits(lowest=lowest)))
    assert bool(verdict.reason) is stops
    if not stops:
        assert verdict.within == pytest.approx((23.0 - 10.0) / 4.0 - TIMING.to_stop)


@each(("moving", "ends"), [(Moving(False, {2: DOWN}), True), (Moving(True, {}), False), (Moving(False, {}), False)])
def test_contradicting_clock_ends_only_arrows_at_a_configured_limit(moving: Moving, ends: bool) -> None:
    sunk = seen(PositionSample(0.0, HERE, 60.0, further=(23.0,)), PositionSample(0.5, HERE, 59.0, further=(22.0,)))
    assert bool(allow(view(sunk, Limits(lowest=20.0), moving)).reason) is ends


def test_motion_out_of_a_forbidden_place_is_allowed() -> None:
    assert not allow(view(sinking(5.0, -4.0), Limits(lowest=20.0))).reason


def test_running_goto_above_the_limit_is_not_stopped_for_its_speed() -> None:
    assert not allow(view(sinking(22.0, 4.0), Limits(lowest=19.99), Moving(True, {}))).reason


def test_slow_approach_to_the_sun_is_judged_from_the_farthest_distance() -> None:
    far = seen(PositionSample(0.0, HERE, suns=(60.0,)), PositionSample(1.0, HERE, suns=(59.0,)))
    assert not allow(view(far, Limits())).reason
    assert farthest(view(far, Limits())) == (59.0,)
    near = replace(
        seen(PositionSample(0.0, HERE, suns=(19.0,)), PositionSample(1.0, HERE, suns=(18.96,))),
        farthest_from_suns=(19.0,),
    )
    assert not allow(view(near, Limits())).reason
    creeping = add_position(
        replace(near, farthest_from_suns=farthest(view(near, Limits()))), PositionSample(2.0, HERE, suns=(18.92,))
    )
    assert allow(view(creeping, Limits())).reason == "the Sun (19 degrees from it)"


@each(("distance", "stops"), [(24.0, True), (25.0, False)])
def test_fast_approach_to_the_sun_ends_before_the_next_reading(distance: float, stops: bool) -> None:
    """4 degrees a second: 4.2 degrees until it rests, if the next position is waited for."""
    fast = seen(PositionSample(0.0, HERE, suns=(distance + 2.0,)), PositionSample(0.5, HERE, suns=(distance,)))
    verdict = allow(view(fast, Limits()))
    assert bool(verdict.reason) is stops
    if not stops:
        assert verdict.within == pytest.approx((distance - 20.0) / 4.0 - TIMING.to_stop)


@each(
    ("past", "reason"),
    [(PastNow(29.0, 1.0), True), (PastNow(29.0, -1.0), False), (PastNow(20.0, 1.0), False), (None, False)],
)
def test_only_motion_towards_the_pier_is_stopped_past_the_meridian(past: PastNow | None, reason: bool) -> None:
    moved = seen(PositionSample(0.0, HERE, 40.0), PositionSample(1.0, HERE, 40.0))
    assert bool(allow(replace(view(moved, Limits(hour_angle=30.0)), past=past)).reason) is reason


@each("moving", [Moving(True, {}), Moving(True, {}, ordered=False)])
def test_goto_is_not_judged_by_its_hour_angle(moving: Moving) -> None:
    moved = seen(PositionSample(0.0, HERE, 40.0), PositionSample(1.0, HERE, 40.0))
    assert not allow(replace(view(moved, Limits(hour_angle=30.0), moving), past=PastNow(60.0, 4.0))).reason


def test_goto_of_the_mount_itself_may_end_just_before_a_limit() -> None:
    """At 4 degrees a second it may brake in the remaining 2; it is stopped when it gets there."""
    by_itself = Moving(True, {}, ordered=False)
    verdict = allow(view(sinking(24.0, 4.0), Limits(lowest=20.0), by_itself))
    assert not verdict.reason and verdict.within == pytest.approx(2.75 / 4.0 - TIMING.exchange)
    assert allow(view(sinking(21.9, 4.0), Limits(lowest=20.0), by_itself)).reason


@each(
    ("limits", "lowest", "highest"),
    [
        (Limits(), -90.0, 90.0),
        (Limits(20.0, 80.0, at_keys=(20.0, 80.0)), 20.0, 80.0),
        (Limits(20.0, at_keys=(20.0, 90.0)).at_any_altitude(), -90.0, 90.0),
        (Limits(20.0, at_keys=(20.0, 90.0)).narrowed(30.0, 60.0), 20.0, 90.0),
    ],
)
def test_motion_at_the_mounts_keys_is_judged_by_configured_limits_only(
    limits: Limits, lowest: float, highest: float
) -> None:
    assert (limits.for_keys().lowest, limits.for_keys().highest) == (lowest, highest)


def test_soonest_of_several_stop_deadlines_applies() -> None:
    moved = seen(PositionSample(0.0, HERE, 60.0, 0.0, (80.0,)), PositionSample(1.0, HERE, 59.0, 0.0, (79.0,)))
    verdict = allow(view(moved, Limits(lowest=0.0)))
    assert (verdict.reason, verdict.limit) == ("", "the altitude limit")
    assert verdict.within == pytest.approx(59.0 - TIMING.to_stop)


def test_first_reading_of_a_motion_is_due_before_it_can_reach_a_limit() -> None:
    looked = view(seen(PositionSample(50.0, HERE, 30.0)), Limits(lowest=10.0, sun=0.0))
    assert first_stretch(looked, 50.0, 2.0).within == pytest.approx(20.0 / 2.0 - TIMING.to_stop)
    assert first_stretch(looked, 50.0, 0.05).within is None


def test_motion_from_rest_starts_at_the_last_reading_and_forgets_its_rate() -> None:
    before = sinking(40.0, 1.0)
    assert begin_motion(before, 130.0, 4.0, at_rest=True).last == replace(before.last, at=130.0)
    assert begin_motion(before, 130.0, 4.0, at_rest=False).last == before.last
    assert begin_motion(before, 130.0, 4.0, at_rest=False).changes == Changes()


@each(
    ("moving", "age", "since", "ends"),
    [
        (Moving(False, {2: DOWN}), 1.5, 9.0, True),
        (Moving(False, {2: DOWN}), 0.5, 9.0, False),
        (Moving(False, {2: DOWN}), 1.5, 0.5, False),
        (Moving(True, {}), 1.5, 9.0, False),
    ],
)
def test_only_motion_by_hand_ends_without_positions(moving: Moving, age: float, since: float, ends: bool) -> None:
    assert bool(why_blind(moving, age, since)) is ends


def test_axis_readings_need_an_alignment_unless_the_owner_allows_them() -> None:
    assert needs_alignment(op.Park(), sync_aligns=False, unaligned="refuse")
    assert not needs_alignment(op.Park(), sync_aligns=False, unaligned="allow")
    assert needs_alignment(op.Sync(1.0, 2.0), sync_aligns=False, unaligned="allow")
    assert not needs_alignment(op.Sync(1.0, 2.0), sync_aligns=True, unaligned="refuse")
    assert not needs_alignment(op.Move(op.Direction.SOUTH, op.Rate(key=1)), sync_aligns=False, unaligned="refuse")


def test_mount_that_runs_on_longer_is_stopped_earlier() -> None:
    longer = StopTiming(0.05, 1, 0.4, run_on=2.5)
    assert longer.to_stop - TIMING.to_stop == pytest.approx(2.0)
    assert longer.overdue(9.0) - TIMING.overdue(9.0) == pytest.approx(2.0)
