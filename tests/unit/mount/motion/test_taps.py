"""Taps as values: what a release does to an arrow that waits, is being carried out, or moves."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.motion import taps
from gateway.mount.motion.changes import apply_order
from gateway.mount.motion.wanted import Arrow, AxisMotion, Halt, HandMove, Order, Tap, Wanted
from gateway.mount.presence import HostActivity

ME, OTHER = HostActivity("10.0.0.1", 0.0), HostActivity("10.0.0.2", 0.0)
EAST, WEST = op.Move(op.Direction.EAST, op.Rate(key=7)), op.Move(op.Direction.WEST, op.Rate(key=7))
STOP = op.StopAxis(1)


def press(number: int, since: float, operation: op.Move = EAST, held: float | None = None) -> Order:
    return Order(number, operation, ME, came_at=since, arrow=Arrow(held))


def release(number: int, since: float, by: HostActivity | None = ME, ends_tap: bool = False) -> Halt:
    return Halt(number, STOP, by, came_at=since, ends_tap=ends_tap)


def after(wanted: Wanted, order: Order) -> Wanted:
    return apply_order(wanted, order, order.came_at, False)


def moves(operation: op.Move, since: float, asked: float = 0.0) -> HandMove:
    return HandMove(AxisMotion(operation, ME, since, 1.0, asked, since - 0.1))


def test_early_release_of_a_queued_arrow_leaves_a_short_move() -> None:
    for active in (0, 1):
        [tap] = after(Wanted(pending=(press(1, 0.0),), active=active), release(2, 0.125)).pending
        assert (tap.number, tap.held_for) == (1, 0.125)


def test_other_clients_halt_or_late_release_cancels_a_queued_arrow_press() -> None:
    waiting = Wanted(pending=(press(1, 0.0),))
    for order in (release(2, 0.1, OTHER), release(2, 0.1, None), release(2, taps.MAX_TAP_TIME + 0.1)):
        assert [one.operation for one in after(waiting, order).pending] == [STOP]
    late = release(2, taps.MAX_TAP_TIME + 0.1)
    assert taps.dropped_press(waiting, after(waiting, late), late) == waiting.pending[0]


def test_end_of_a_short_arrow_press_does_not_cancel_the_next_press() -> None:
    wanted = Wanted(motion=moves(EAST, 1.0), taps=(Tap(1, ME, 2.0),), pending=(press(3, 0.5, WEST),))
    end = release(4, 2.0, ends_tap=True)
    changed = after(wanted, end)
    assert [one.number for one in changed.pending] == [3, 4]
    assert taps.dropped_press(wanted, changed, end) is None
    assert wanted.due_at(wanted.pending[0]) == float("inf")


def test_released_arrow_runs_on_only_to_complete_a_short_press() -> None:
    for seconds, until in ((0.2, 0.5), (0.3, 0.6), (0.5, 0.675), (2.0, None)):
        changed = after(Wanted(motion=moves(EAST, 0.4)), release(2, seconds + 0.2 if until is None else seconds))
        if until is None:
            assert [one.operation for one in changed.pending] == [STOP] and not changed.taps
        else:
            assert [round(tap.ends_at, 6) for tap in changed.taps] == [until] and not changed.pending


def test_short_arrow_presses_are_joined_only_in_the_same_direction() -> None:
    first = press(1, 0.0, held=0.1)
    joined = after(Wanted(pending=(first, press(2, 0.2))), release(3, 0.4))
    assert [(one.number, round(one.held_for or 0.0, 6), one.came_at) for one in joined.pending] == [(1, 0.3, 0.2)]
    assert taps.was_fulfilled_otherwise(press(2, 0.2, held=0.2), joined)
    other = after(Wanted(pending=(first, press(2, 0.2, WEST))), release(3, 0.4))
    assert [one.number for one in other.pending] == [1, 2]
    begun = Wanted(motion=moves(EAST, 0.4), taps=(Tap(1, ME, 0.5),), pending=(press(2, 0.3),))
    assert [round(tap.ends_at, 6) for tap in after(begun, release(3, 0.45)).taps] == [0.65]


def test_axis_belongs_to_the_client_of_its_newest_unreleased_arrow() -> None:
    assert taps.arrow_holder(Wanted(motion=moves(EAST, 0.4)), 1) is ME
    assert taps.arrow_holder(Wanted(motion=moves(EAST, 0.4), pending=(Order(1, WEST, OTHER),)), 1) is OTHER
    assert taps.arrow_holder(Wanted(motion=moves(EAST, 0.4), taps=(Tap(1, ME, 0.5),)), 1) is None
    assert taps.arrow_holder(Wanted(pending=(press(1, 0.0, held=0.1),)), 1) is None


def test_repeated_release_leaves_a_short_arrow_move_alone() -> None:
    wanted = Wanted(pending=(press(1, 0.0, held=0.1),))
    assert after(wanted, release(2, 0.2)) == wanted
