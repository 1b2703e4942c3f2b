"""How each kind of order, and its outcome, changes `Wanted`: pure functions, one per kind of order or outcome.

The newest order counts: a rate replaces a pending rate, a halt removes the pending orders that would move its axis, a
stop removes all motions. A goto moves both axes together: a halt of either axis, while the goto is pending or under
way, ends the whole goto. The exception is the release of an arrow key that the same host pressed before the goto; it
takes effect only if the goto is refused. A motion that the mount has acknowledged becomes ``Wanted.motion``. A guide
pulse adds an order of the gateway itself, for its end or its remainder.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Refused
from gateway.core.motion_kinds import (
    END_ORDERS,
    GOTOS,
    HAND_MOTIONS,
    MOVERS,
    RESUMABLE_ORDERS,
    moved_axis,
    stops_focuser,
    survives_abort,
)
from gateway.mount.motion.taps import begin_tap, end_tap, released, without_waiting_arrows
from gateway.mount.motion.wanted import (
    FIRST_RANK,
    RESUMED_RANK,
    URGENT_REPEAT_WINDOW,
    USUAL_RANK,
    AxisMotion,
    DoneHalt,
    FocusMotion,
    GuidePulse,
    Halt,
    HandMove,
    NoOrderedMove,
    Order,
    PressedArrow,
    Slew,
    Wanted,
)
from gateway.protocols.base.driver import Schedule

#: The number of guide pulses that may wait; with more of them guiding makes no sense.
MAX_WAITING_PULSES = 8


def apply_order(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Return the new ``Wanted`` after an order. ``slewing``: the mount reports a goto under way. Raises Refused."""
    if wanted.goto_failure and order.client is not None:  # of a client
        wanted = replace(wanted, goto_failure="")
    return _APPLY_BY_OPERATION.get(type(order.operation), _append_order)(wanted, order, now, slewing)


def after_stop(wanted: Wanted, reason: str | None = None) -> Wanted:
    """Return the new ``Wanted`` after a stop was ordered: it is owed to the mount, and pending motions are removed.

    A ``reason`` becomes the ``goto_failure`` of a goto under way. "" (a client's stop) clears that text, None keeps it.
    """
    pending = tuple(
        order
        for order in wanted.pending
        if survives_abort(order.operation) or (order.urgent and order.number == wanted.active)
    )
    ends_goto = bool(reason) and isinstance(wanted.motion, Slew)
    failure = f"the goto ended before its goal: {reason}" if ends_goto else wanted.goto_failure
    return replace(
        wanted, pending=pending, pulses=(), arrows=(), taps=(), stop_owed=True, stop_count=wanted.stop_count + 1,
        goto_failure="" if reason == "" else failure,
    )  # fmt: skip


def equal_pending_halt(wanted: Wanted, operation: op.Operation) -> Halt | None:
    """Return a pending halt that makes this halt redundant; None if there is none.

    A halt that waits behind a goto counts only if no other order than halts arrived since.
    """
    if not isinstance(operation, END_ORDERS):
        return None
    overtakes = not wanted.waiting_gotos
    for other in wanted.pending:
        if not isinstance(other, Halt) or other.operation != operation or other.voided_by:
            continue
        if other.overtakes is overtakes and (overtakes or other.order_count == wanted.order_count):
            return other
    return None


def add_follow_up(wanted: Wanted, schedule: Schedule, order_number: int, now: float) -> Wanted:
    """Add a follow-up of the driver as order ``order_number``; it replaces an equal pending follow-up."""
    order = Order(
        order_number,
        schedule.operation,
        rank=FIRST_RANK if schedule.urgent else USUAL_RANK,
        due_from=now + schedule.seconds,
        follow_up=True,
        urgent=schedule.urgent,
        not_while_busy=schedule.not_while_busy,
    )
    others = tuple(
        other
        for other in wanted.pending
        if not (other.follow_up and other.operation == order.operation and other.number != wanted.active)
    )
    return replace(wanted, pending=(*others, order))


def was_stopped_since(wanted: Wanted, operation: op.Operation, stop_count: int | None) -> bool:
    """Whether a stop since the request voids the operation. ``stop_count``: stops before the request; None: never."""
    if stop_count is None or stop_count == wanted.stop_count:
        return False
    return not (isinstance(operation, op.StopAxis) or survives_abort(operation))


def without_superseded_orders(wanted: Wanted, operation: op.Operation) -> Wanted:
    """Remove the pending orders that the operation cancels if it is a halt, an end of all gotos, or a newer rate."""
    pending = tuple(order for order in wanted.pending if not _cancels(operation, order, order.number == wanted.active))
    return wanted if len(pending) == len(wanted.pending) else replace(wanted, pending=pending)


def interrupt_order(wanted: Wanted, halt: Halt) -> Wanted:
    """Let a halt interrupt the active order, if that order can begin again after it."""
    active = wanted.active_order
    if (
        halt.rank != FIRST_RANK
        or active is None
        or not (isinstance(active.operation, RESUMABLE_ORDERS) or (isinstance(active, Halt) and active.keeps_repeating))
    ):
        return wanted
    pending = tuple(replace(order, rank=RESUMED_RANK) if order is active else order for order in wanted.pending)
    return replace(wanted, pending=pending, active=0)


def _cancels(operation: op.Operation, order: Order, is_active: bool) -> bool:
    other = order.operation
    match operation:
        case op.StopAxis(axis=axis):
            return moved_axis(other) == axis or order.pulse_axis == axis
        case op.AbortSlew():
            return isinstance(other, GOTOS)
        case op.Move() | op.MoveAxis() | op.TrackRate():
            held = not is_active and order.held_for is None
            return held and (moved_axis(other), type(other)) == (moved_axis(operation), type(operation))
    return False


# --- the rows -------------------------------------------------------------------------------------------------------


def _append_order(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the order, after removing what it supersedes."""
    wanted = without_superseded_orders(wanted, order.operation)
    return replace(wanted, pending=(*wanted.pending, order), order_count=wanted.order_count + 1)


def _apply_arrow(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the motion of an arrow key. It cancels postponed gotos: its user wants to move the mount himself."""
    axis = moved_axis(order.operation)
    pending = tuple(other for other in wanted.pending if other.number == wanted.active or not _is_postponed(other))
    wanted = wanted if len(pending) == len(wanted.pending) else replace(wanted, pending=pending)
    if order.client is not None and axis is not None:
        others = tuple(press for press in wanted.arrows if (press.host, press.axis) != (order.client.host, axis))
        wanted = replace(wanted, arrows=(*others, PressedArrow(order.client.host, axis, wanted.goto_count)))
    return _append_order(wanted, order, now, slewing)


def _apply_goto(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the goto in place of postponed gotos, arrows and pulses. Count it, to recognise arrows pressed before."""
    if any(isinstance(other.operation, op.Move | op.MoveAxis) for other in wanted.pending):
        wanted = without_waiting_arrows(wanted)
    pending = tuple(other for other in wanted.pending if other.number == wanted.active or not _replaced_by_goto(other))
    return _append_order(replace(wanted, goto_count=wanted.goto_count + 1, pending=pending), order, now, slewing)


def _is_postponed(order: Order) -> bool:
    """Whether the order is a goto that waits until the mount accepts commands, or for a site or clock."""
    return isinstance(order.operation, GOTOS) and not order.follow_up and order.due_from > 0.0


def _replaced_by_goto(order: Order) -> bool:
    """Whether a newer goto replaces the order: a guide pulse that is no remainder, or a postponed goto."""
    if isinstance(order.operation, GOTOS):
        return _is_postponed(order)
    return order.pulse_axis is not None and not order.follow_up


def _apply_pulse(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    if sum(isinstance(other.operation, op.Pulse | op.PulseAxis) for other in wanted.pending) >= MAX_WAITING_PULSES:
        raise Refused(f"{MAX_WAITING_PULSES} guide pulses wait already: this one is dropped.")
    return _append_order(wanted, order, now, slewing)


def _apply_halt(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Apply the halt of an axis, which may end a whole goto, or release an arrow whose motion has not begun."""
    assert isinstance(order, Halt)
    if order.ends_tap:
        return end_tap(wanted, order)
    if (
        not wanted.waiting_gotos
        and (wanted.hand_moves or not slewing)
        and (tapped := released(wanted, order)) is not None
    ):
        return tapped
    axis = halted_axis(order.operation)
    presser = None if order.client is None else (order.client.host, axis)
    press = next((arrow for arrow in wanted.arrows if (arrow.host, arrow.axis) == presser), None)
    others = (arrow for arrow in wanted.arrows if arrow is not press)
    wanted = replace(wanted, arrows=tuple(arrow for arrow in others if order.client is not None or arrow.axis != axis))
    gotos = wanted.waiting_gotos
    if not gotos and (wanted.hand_moves or not slewing):  # motion by hand means that the goto has ended
        return _queue_halt(wanted, order, now, slewing)
    if press is None or press.gotos_before >= wanted.goto_count:
        return after_stop(wanted)
    return replace(wanted, pending=(*wanted.pending, replace(order, voided_by=gotos[-1].number))) if gotos else wanted


def _queue_halt(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Queue a halt: before all other orders, but in its turn if a goto is pending or a client keeps repeating it."""
    assert isinstance(order, Halt)
    axis = halted_axis(order.operation)
    wanted = without_superseded_orders(
        replace(wanted, pulses=tuple(pulse for pulse in wanted.pulses if pulse.axis != axis)), order.operation
    )
    same = equal_pending_halt(wanted, order.operation)
    if same is not None:
        return interrupt_order(wanted, same)
    before = next((halt for halt in wanted.halts if halt.operation == order.operation), None)
    again = before is not None and before.order_count == wanted.order_count and now - before.at <= URGENT_REPEAT_WINDOW
    order = replace(
        order,
        overtakes=not wanted.waiting_gotos,
        order_count=wanted.order_count,
        repeat_number=before.repeat_number + 1 if before is not None and again else 0,
    )
    order = replace(order, rank=FIRST_RANK if order.overtakes and not order.keeps_repeating else USUAL_RANK)
    return interrupt_order(replace(wanted, pending=(*wanted.pending, order)), order)


def halted_axis(operation: op.Operation) -> int | None:
    return operation.axis if isinstance(operation, op.StopAxis) else None


def _apply_focus(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the order, and remove the retry of a focuser halt: the newest order for the focuser counts."""
    pending = tuple(
        other
        for other in wanted.pending
        if not (other.follow_up and stops_focuser(other.operation) and other.number != wanted.active)
    )
    return _append_order(replace(wanted, pending=pending), order, now, slewing)


def _apply_hibernate(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the order, and forget the pressed arrows: a hibernating mount does not move."""
    return _append_order(replace(wanted, arrows=()), order, now, slewing)


_APPLY_BY_OPERATION: dict[type[op.Operation], Callable[[Wanted, Order, float, bool], Wanted]] = {
    **dict.fromkeys(GOTOS, _apply_goto),
    op.Move: _apply_arrow,
    op.MoveAxis: _apply_arrow,
    op.Pulse: _apply_pulse,
    op.PulseAxis: _apply_pulse,
    op.StopAxis: _apply_halt,
    op.AbortSlew: _queue_halt,
    op.Focus: _apply_focus,
    op.Hibernate: _apply_hibernate,
}


# --- outcomes -------------------------------------------------------------------------------------------------------


def remove_order(wanted: Wanted, order: Order) -> Wanted:
    """Remove an order that has ended in any way."""
    pending = tuple(other for other in wanted.pending if other.number != order.number)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)


def after_success(wanted: Wanted, order: Order, now: float) -> Wanted:
    """Remove an order that the mount has carried out; note the time if it was a halt."""
    wanted = remove_order(wanted, order)
    if not isinstance(order, Halt):
        return wanted
    others = tuple(halt for halt in wanted.halts if halt.operation != order.operation)
    return replace(wanted, halts=(*others, DoneHalt(order.operation, now, order.order_count, order.repeat_number)))


def after_failure(wanted: Wanted, order: Order) -> Wanted:
    """Remove an order that failed. If it was a goto, waiting releases of axes that still move by hand take effect."""
    wanted = remove_order(wanted, order)
    if isinstance(order.operation, END_ORDERS):
        wanted = replace(wanted, halts=tuple(halt for halt in wanted.halts if halt.operation != order.operation))
    pending = tuple(
        replace(other, voided_by=0, rank=FIRST_RANK) if _is_void_after(other, order) else other
        for other in wanted.pending
        if not _is_void_after(other, order) or getattr(other.operation, "axis", 0) in wanted.hand_moves
    )
    return replace(wanted, pending=pending)


def _is_void_after(halt: Order, goto: Order) -> bool:
    """Whether this is a halt that becomes void once the goto has begun."""
    return isinstance(halt, Halt) and halt.voided_by == goto.number


def may_have_begun(order: Order, error: BaseException) -> bool:
    """Whether a failed motion may move the mount: it got no reply, a halt interrupted it, or a stop was to follow."""
    unheard = isinstance(order.operation, HAND_MOTIONS) and isinstance(error, NoAnswer) and error.is_sent
    return order.arrow.then_stop or unheard or (order.rank == RESUMED_RANK and isinstance(order.operation, MOVERS))


def after_ack(
    wanted: Wanted, order: Order, operation: op.Operation, now: float, speed: float, sent_at: float = 0.0
) -> Wanted:
    """Return the new ``Wanted`` after the mount has acknowledged ``operation``, the form in which the order was sent.

    ``speed`` is the speed of a motion by hand, degrees a second; ``sent_at`` is the loop time of its command.
    """
    match operation:
        case op.Goto() | op.GotoHorizontal() | op.GotoAxes() | op.Park() | op.Home():
            void = {other.number for other in wanted.pending if _is_void_after(other, order) or other.pulse_axis}
            pending = tuple(other for other in wanted.pending if other.number not in void)
            slew, homed = Slew(operation, order.client, now), isinstance(operation, op.Home)
            moved = replace(wanted, motion=slew, homed=homed, gotos_begun=wanted.gotos_begun + 1, pulses=(), taps=())
            return replace(moved, pending=pending, motions_begun=_add_motions(wanted, 1, 2))
        case op.Move() | op.MoveAxis():
            wanted = replace(
                _without_pulses(wanted, operation.axis), homed=False, motions_begun=_add_motions(wanted, operation.axis)
            )
            motion = AxisMotion(operation, order.client, now, speed, order.came_at, max(sent_at, order.came_at))
            moved = _with_axis_motion(wanted, operation.axis, motion)
            return moved if order.held_for is None else begin_tap(moved, motion, operation.axis, order.held_for)
        case op.StopAxis() if order.follow_up:
            return wanted
        case op.StopAxis():
            return _with_axis_motion(wanted, operation.axis, None)
        case op.AbortMotion():
            return after_acknowledged_stop(wanted)
        case op.AbortSlew():
            return replace(wanted, motion=NoOrderedMove()) if isinstance(wanted.motion, Slew) else wanted
        case op.Hibernate():
            return replace(wanted, motion=NoOrderedMove())
        case op.Focus(direction=direction):
            return replace(wanted, focus_motion=FocusMotion(order.client, now) if direction else None)
    return wanted


def refuse_earlier_orders(wanted: Wanted) -> Wanted:
    """Count a stop, which voids the orders of clients that still wait in a connection."""
    return replace(wanted, stop_count=wanted.stop_count + 1)


def after_acknowledged_stop(wanted: Wanted) -> Wanted:
    return replace(wanted, motion=NoOrderedMove(), stop_owed=False)


def after_goto_end(wanted: Wanted) -> Wanted:
    """Note that the goto under way has ended, at its goal or elsewhere."""
    return replace(wanted, motion=NoOrderedMove()) if isinstance(wanted.motion, Slew) else wanted


def after_goto_failure(wanted: Wanted, reason: str) -> Wanted:
    """Note that the mount ended a goto elsewhere than at its goal; not if a stop has ended it."""
    return wanted if wanted.stop_owed or wanted.goto_failure else replace(wanted, goto_failure=reason)


def after_pulse_start(wanted: Wanted, order: Order, pulse: op.Pulsed, order_number: int, now: float) -> Wanted:
    """Note a guide pulse that began, and add order ``order_number`` for its end or its remainder."""
    if isinstance(order.operation, op.Move):  # a tap at guide rate
        order = replace(order, operation=op.Pulse(order.operation.direction, order.operation.ms or 0))
    axis, until = order.pulse_axis, (now if pulse.since is None else pulse.since) + pulse.seconds
    assert axis is not None and isinstance(order.operation, op.Pulse | op.PulseAxis)
    others = tuple(other for other in wanted.pulses if other.axis != axis)
    wanted = replace(wanted, pulses=(*others, GuidePulse(axis, until, order.operation)))
    if not pulse.ends:
        end = Order(order_number, op.StopAxis(axis), rank=FIRST_RANK, due_from=until, follow_up=True, urgent=True)
        return replace(wanted, pending=(*wanted.pending, end))
    if pulse.left:
        operation = replace(order.operation, ms=pulse.left)
        remainder = replace(order, number=order_number, operation=operation, due_from=until, follow_up=True)
        return replace(wanted, pending=(*wanted.pending, remainder))
    return wanted


def _add_motions(wanted: Wanted, *axes: int) -> tuple[int, int]:
    """Return ``motions_begun``, increased by one motion of each of these axes."""
    first, second = wanted.motions_begun
    return first + (1 in axes), second + (2 in axes)


def _with_axis_motion(wanted: Wanted, axis: int, motion: AxisMotion | None) -> Wanted:
    """Replace the motion by hand of an axis. If ``motion`` is None, it has ended; a goto then continues."""
    by_hand = wanted.motion if isinstance(wanted.motion, HandMove) else HandMove()
    by_hand = replace(by_hand, first=motion) if axis == 1 else replace(by_hand, second=motion)
    if isinstance(wanted.motion, Slew) and motion is None:
        return wanted
    wanted = replace(wanted, taps=tuple(tap for tap in wanted.taps if tap.axis != axis))
    return replace(wanted, motion=by_hand if by_hand.first or by_hand.second else NoOrderedMove())


def _without_pulses(wanted: Wanted, axis: int) -> Wanted:
    """Remove the guide pulses of an axis, and their ends, which would end the motion by hand that replaces them."""
    pending = tuple(order for order in wanted.pending if order.pulse_axis != axis or order.number == wanted.active)
    return replace(wanted, pending=pending, pulses=tuple(pulse for pulse in wanted.pulses if pulse.axis != axis))
