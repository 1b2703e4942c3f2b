"""What orders and their outcomes make of what is wanted: values in, values out, no mount."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Refused
from gateway.core.motion_kinds import END_ORDERS, GOTOS
from gateway.mount.motion import changes
from gateway.mount.motion.changes import after_stop, apply_order, equal_pending_halt, without_superseded_orders
from gateway.mount.motion.wanted import Halt, HandMove, Movement, NoOrderedMove, Order, Slew, Wanted, WantedState
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import ReadingsCache
from tests.support.each import each
from tests.support.examples import some

FAST = op.Rate(name="max")
NORTH, EAST = op.Move(op.Direction.NORTH, FAST), op.Move(op.Direction.EAST, FAST)
GOTO, OTHER = op.Goto(10.0, 20.0), op.Goto(200.0, -5.0)
PULSE = op.PulseAxis(1, 1, 500)
KINDS = [
    NORTH,
    EAST,
    op.MoveAxis(2, -1, FAST),
    GOTO,
    OTHER,
    op.Park(),
    PULSE,
    op.Pulse(op.Direction.SOUTH, 200),
    op.StopAxis(1),
    op.StopAxis(2),
    op.AbortSlew(),
    op.SetTracking(on=False),
    op.TrackRate(name="lunar"),
    op.Hibernate(),
    op.Wake(),
    op.Focus(1),
    op.Sync(1.0, 2.0),
]


def ordered(number: int, operation: op.Operation, by: HostActivity | None = None) -> Order:
    return (Halt if isinstance(operation, END_ORDERS) else Order)(number, operation, by)


class Desk:
    """Orders come in, and are carried out one by one; ``done`` lists them."""

    def __init__(self) -> None:
        self.wanted, self.now, self.numbers, self.done = Wanted(), 0.0, 0, list[op.Operation]()
        self.slewing = False

    def ask(self, *operations: op.Operation, by: HostActivity | None = None) -> Desk:
        for operation in operations:
            self.numbers += 1
            self.wanted = apply_order(self.wanted, ordered(self.numbers, operation, by), self.now, self.slewing)
        return self

    def begin(self) -> Order | None:
        """What is due, which is being carried out from now on. Arrows that were tapped end when they are to."""
        for tap in self.wanted.taps:
            if tap.ends_at <= self.now:
                self.numbers += 1
                end = Halt(self.numbers, op.StopAxis(tap.axis), tap.client, came_at=tap.ends_at, ends_tap=True)
                self.wanted = apply_order(self.wanted, end, self.now, self.slewing)
        order = self.wanted.next_order(self.now)
        self.wanted = replace(self.wanted, active=order.number if order else 0)
        return order

    def finish(self, order: Order, answer: op.Pulsed | None = None, *, failed: bool = False) -> None:
        """The mount has acknowledged it, or refused."""
        if failed:
            self.wanted = changes.after_failure(self.wanted, order)
            return
        self.done.append(order.operation)
        self.wanted = changes.after_success(self.wanted, order, self.now)
        if answer is not None:
            self.numbers += 1
            self.wanted = changes.after_pulse_start(self.wanted, order, answer, self.numbers, self.now)
        self.wanted = changes.after_ack(self.wanted, order, order.operation, self.now, 4.0)
        self.slewing = isinstance(self.wanted.motion, Slew)

    def do(self, answer: op.Pulsed | None = None) -> op.Operation:
        order = self.begin()
        assert order is not None
        self.finish(order, answer)
        return order.operation


def waiting(desk: Desk) -> list[op.Operation]:
    return [order.operation for order in desk.wanted.pending]


def test_motions_are_sent_in_sequence_but_axis_stops_first() -> None:
    desk = Desk().ask(op.SetTracking(on=False), NORTH, EAST)
    assert desk.do() == op.SetTracking(on=False)
    desk.ask(op.StopAxis(2))
    assert desk.do() == op.StopAxis(2)
    assert desk.do() == EAST
    assert desk.wanted.hand_moves == {1: EAST}
    assert desk.begin() is None and desk.wanted.next_due_time() is None


def test_newer_rate_replaces_a_waiting_one_but_not_a_running_one() -> None:
    slow = op.Move(op.Direction.NORTH, op.Rate(name="center"))
    desk = Desk().ask(NORTH, slow)
    assert waiting(desk) == [slow]
    first = desk.begin()
    assert first is not None
    desk.ask(NORTH)
    assert waiting(desk) == [slow, NORTH]
    desk.finish(first)
    assert desk.do() == NORTH


def test_stop_cancels_every_queued_motion_but_no_queued_setting() -> None:
    desk = Desk().ask(NORTH, GOTO, PULSE, op.TrackRate(name="solar"), op.Sync(1.0, 1.0))
    desk.wanted = after_stop(desk.wanted)
    assert waiting(desk) == [op.TrackRate(name="solar")]
    assert desk.wanted.stop_owed and desk.wanted.stop_count == 1
    assert changes.after_acknowledged_stop(desk.wanted).motion == NoOrderedMove()
    assert not changes.after_acknowledged_stop(desk.wanted).stop_owed


@each("halt", [op.StopAxis(1), op.StopAxis(2)])
def test_axis_halt_without_an_arrow_stops_a_goto_on_both_axes(halt: op.Operation) -> None:
    for under_way in (False, True):
        desk = Desk().ask(GOTO)
        if under_way:
            desk.do()
        desk.ask(halt)
        assert desk.wanted.stop_owed and desk.wanted.stop_count == 1
        assert waiting(desk) == []


def test_release_of_an_arrow_pressed_before_a_goto_does_not_stop_the_goto() -> None:
    hand, other = HostActivity("10.0.0.1", 0.0), HostActivity("10.0.0.2", 0.0)
    desk = Desk().ask(NORTH, by=hand)
    desk.do()
    desk.ask(GOTO, by=hand)
    desk.do()
    desk.ask(op.StopAxis(2), by=hand)
    assert isinstance(desk.wanted.motion, Slew) and not desk.wanted.stop_owed
    desk.ask(op.StopAxis(2), by=other)
    assert desk.wanted.stop_owed


def test_arrow_released_during_a_refused_goto_is_stopped() -> None:
    hand = HostActivity("10.0.0.1", 0.0)
    desk = Desk().ask(NORTH, by=hand)
    desk.do()
    goto = desk.ask(GOTO, by=hand).begin()
    desk.ask(op.StopAxis(2), by=hand)
    assert goto is not None and not desk.wanted.stop_owed
    desk.finish(goto, failed=True)
    assert desk.do() == op.StopAxis(2)
    assert desk.wanted.motion == NoOrderedMove()


def test_identical_queued_axis_halts_are_joined_and_repeats_get_no_priority() -> None:
    desk = Desk().ask(op.StopAxis(1), op.StopAxis(1), op.StopAxis(1))
    assert waiting(desk) == [op.StopAxis(1)]
    ranks = []
    for _ in range(4):
        order = desk.ask(op.StopAxis(1)).begin()
        assert isinstance(order, Halt)
        ranks.append(order.keeps_repeating)
        desk.finish(order)
    assert ranks == [False, False, True, True]
    desk.ask(NORTH, op.StopAxis(1))
    assert equal_pending_halt(desk.wanted, op.StopAxis(1)) is not None
    last = desk.wanted.pending[-1]
    assert isinstance(last, Halt) and not last.keeps_repeating


def test_arrow_not_yet_sent_restarts_after_a_halt_of_the_other_axis() -> None:
    desk = Desk().ask(EAST)
    desk.begin()
    desk.ask(op.StopAxis(2))
    assert desk.wanted.active == 0
    assert desk.do() == op.StopAxis(2)
    assert desk.do() == EAST


def test_pulses_of_one_axis_run_in_sequence_and_end_in_time() -> None:
    desk = Desk().ask(PULSE, op.PulseAxis(1, -1, 300), op.PulseAxis(2, 1, 300))
    assert desk.do(op.Pulsed(0.5, ends=False)) == PULSE
    assert desk.do(op.Pulsed(0.3, ends=True)) == op.PulseAxis(2, 1, 300)
    assert desk.begin() is None
    assert desk.wanted.next_due_time() == 0.5
    desk.now = 0.5
    assert desk.do() == op.StopAxis(1)
    assert desk.do(op.Pulsed(0.3, ends=True)) == op.PulseAxis(1, -1, 300)


def test_long_guide_pulse_is_sent_in_parts_until_a_halt() -> None:
    long = op.PulseAxis(1, 1, 6000)
    desk = Desk().ask(long)
    desk.do(op.Pulsed(2.55, ends=True, left=3450))
    desk.now = 2.55
    assert desk.do(op.Pulsed(2.55, ends=True, left=900)) == op.PulseAxis(1, 1, 3450)
    desk.ask(op.StopAxis(1))
    assert waiting(desk) == [op.StopAxis(1)] and desk.wanted.pulses == ()


def test_end_of_a_guide_pulse_is_timed_from_when_it_was_sent() -> None:
    desk = Desk().ask(PULSE)
    desk.now = 7.0
    desk.do(op.Pulsed(0.5, ends=False, since=6.75))
    assert desk.wanted.next_due_time() == 7.25


def test_arrow_is_not_stopped_by_the_end_of_the_pulse_that_it_replaces() -> None:
    desk = Desk().ask(PULSE)
    desk.do(op.Pulsed(0.5, ends=False))
    desk.ask(EAST)
    assert desk.do() == EAST
    desk.now = 1.0
    assert desk.begin() is None
    assert desk.wanted.hand_moves == {1: EAST}


def test_goto_ends_guide_pulses_and_surplus_guide_pulses_are_refused() -> None:
    desk = Desk().ask(PULSE)
    desk.do(op.Pulsed(0.5, ends=False))
    desk.ask(GOTO)
    assert desk.do() == GOTO
    assert waiting(desk) == [] and desk.wanted.pulses == ()
    with pytest.raises(Refused):
        Desk().ask(*[PULSE] * 9)


@some
@given(st.lists(st.tuples(st.sampled_from(KINDS), st.booleans(), st.booleans()), max_size=30))
@example([(NORTH, False, False), (op.StopAxis(2), False, False), (NORTH, False, False)])
def test_stop_leaves_nothing_moving_after_any_orders(story: list[tuple[op.Operation, bool, bool]]) -> None:
    """And what waits ends, one after the other: nothing is kept for ever, nothing is done twice."""
    hand, desk = HostActivity("10.0.0.1", 0.0), Desk()
    for operation, carried_out, well in story:
        desk.now += 0.25
        try:
            desk.ask(operation, by=hand)
        except Refused:
            continue
        if carried_out and (order := desk.begin()) is not None:
            pulsed = op.Pulsed(0.4, ends=False) if isinstance(order.operation, op.Pulse | op.PulseAxis) else None
            desk.finish(order, pulsed, failed=not well)
            assert order.number not in {one.number for one in desk.wanted.pending}
    still = after_stop(desk.wanted)
    assert all(order.operation.survives_abort or order.number == still.active for order in still.pending)
    assert not any(isinstance(order.operation, GOTOS) for order in still.pending)
    desk.wanted = replace(desk.wanted, active=0)
    for _ in range(len(desk.wanted.pending) * 2 + 2):
        desk.now += 5.0
        if (order := desk.begin()) is not None:
            desk.finish(order)
    assert desk.wanted.pending == ()
    numbers = [order.number for order in desk.wanted.pending]
    assert len(numbers) == len(set(numbers))


@some
@given(st.lists(st.sampled_from(KINDS), max_size=12), st.sampled_from([op.StopAxis(1), op.StopAxis(2), op.AbortSlew()]))
def test_halt_cancels_the_pending_orders_that_it_would_end(asked: list[op.Operation], halt: op.Operation) -> None:
    wanted = Wanted(pending=tuple(ordered(number, one) for number, one in enumerate(asked, 1)))
    left = [order.operation for order in without_superseded_orders(wanted, halt).pending]
    if isinstance(halt, op.StopAxis):
        assert not [
            one
            for one in left
            if getattr(one, "axis", None) == halt.axis and isinstance(one, op.Move | op.MoveAxis | op.PulseAxis)
        ]
    else:
        assert not [one for one in left if isinstance(one, GOTOS)]
    assert [one for one in asked if isinstance(one, op.SetTracking)] == [
        one for one in left if isinstance(one, op.SetTracking)
    ]


def test_motion_by_hand_of_both_axes_is_reported_as_one_motion() -> None:
    desk = Desk().ask(NORTH)
    desk.do()
    desk.ask(EAST)
    desk.do()
    assert isinstance(desk.wanted.motion, HandMove)
    assert {axis for axis, _ in desk.wanted.motion} == {1, 2}
    desk.ask(op.StopAxis(2))
    desk.do()
    assert {axis for axis, _ in desk.wanted.motion} == {1}


async def test_run_on_after_a_goto_is_not_attributed_to_a_client() -> None:
    """A stopped mount that runs on reports that it slews: that is no motion that a client ordered."""
    line: Any = SimpleNamespace(state="up", times=SimpleNamespace(typical_rtt=0.02))
    wanted, cache = WantedState(), ReadingsCache(line)
    movement = Movement(wanted, cache)

    def want(motion: Any) -> None:
        wanted.value = replace(wanted.value, motion=motion)
        wanted.changed.emit(wanted.value)

    want(Slew(GOTO, None, 0.0))
    cache.put(op.Slewing, True, 1.0)
    want(NoOrderedMove())
    assert movement.ordered_by_client, "until the end of the goto is stored"
    cache.put(op.Slewing, False, 2.0)
    cache.put(op.Slewing, True, 3.0)
    assert movement.snapshot().slews_by_itself
