"""How each kind of order changes `Wanted`, and which order is carried out next: pure functions, one row per kind.

The newest order counts: a rate replaces one that still waits, a halt removes the waiting orders that would move its
axis, a stop removes all motions. A goto moves both axes as one: a halt of either axis, while the goto waits or is under
way, ends all of it. The exception is the release of an arrow that the same host pressed before the goto.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Refused
from gateway.core.motion_kinds import ENDS, GOTOS, RESTARTED_AFTER_END, axis_moved, ends_focus, survives_abort
from gateway.mount.motion.taps import ended, released, waits_for, without_presses
from gateway.mount.motion.wanted import AGAIN, FIRST, IN_ORDER, RESUMED, Order, Press, Slew, Wanted
from gateway.protocols.base.driver import Schedule

#: The number of guide pulses that may wait; with more of them guiding makes no sense.
PULSES = 8


def apply(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Return what is wanted after an order. ``slewing``: the mount reports a goto under way. Raises Refused."""
    if wanted.short and order.by is not None:  # of a client
        wanted = replace(wanted, short="")
    return _ROWS.get(type(order.operation), _append)(wanted, order, now, slewing)


def stopped(wanted: Wanted, why: str | None = None) -> Wanted:
    """Return what is wanted after a stop: no motion, and the mount is owed the stop command.

    ``why`` is the reason if the gateway itself stops the mount, empty if a client does, None for a stop that follows.
    """
    pending = tuple(
        order
        for order in wanted.pending
        if survives_abort(order.operation) or (order.urgent and order.number == wanted.active)
    )
    short = f"the goto ended before its goal: {why}" if why and isinstance(wanted.motion, Slew) else wanted.short
    return replace(
        wanted, pending=pending, pulses=(), pressed=(), taps=(), owed=True, stops=wanted.stops + 1,
        short="" if why == "" else short,
    )  # fmt: skip


def equal_pending_halt(wanted: Wanted, operation: op.Operation) -> Order | None:
    """Return the pending equal halt that serves for this one as well; None if there is none.

    A halt that waits behind a goto serves only if no other order came between the two.
    """
    if not isinstance(operation, ENDS):
        return None
    overtakes = not wanted.waiting_gotos
    for one in wanted.pending:
        equal = one.operation == operation and not one.follow_up and not one.unless
        if equal and one.overtakes is overtakes and (overtakes or one.asked == wanted.asked):
            return one
    return None


def planned(wanted: Wanted, later: Schedule, number: int, now: float) -> Wanted:
    """Add a follow-up of the driver as order ``number``; it replaces an equal one that still waits."""
    order = Order(
        number,
        later.operation,
        rank=FIRST if later.urgent else IN_ORDER,
        at=now + later.seconds,
        follow_up=True,
        urgent=later.urgent,
        not_while_busy=later.not_while_busy,
    )
    others = tuple(
        one
        for one in wanted.pending
        if not (one.follow_up and one.operation == order.operation and one.number != wanted.active)
    )
    return replace(wanted, pending=(*others, order))


def too_late(wanted: Wanted, operation: op.Operation, stops: int | None) -> bool:
    """Whether a stop came after the client asked for the operation; ``stops`` is how many stops there had been then."""
    if stops is None or stops == wanted.stops:
        return False
    return not (isinstance(operation, op.StopAxis) or survives_abort(operation))


def without_superseded(wanted: Wanted, operation: op.Operation) -> Wanted:
    """Remove the pending orders that a halt, the end of gotos or a newer rate ends before they have begun."""
    pending = tuple(order for order in wanted.pending if not _ends(operation, order, order.number == wanted.active))
    return wanted if len(pending) == len(wanted.pending) else replace(wanted, pending=pending)


def interrupted(wanted: Wanted, halt: Order) -> Wanted:
    """Let a halt interrupt the active order, if that can be begun again after it."""
    active = next((order for order in wanted.pending if order.number == wanted.active), None)
    if (
        halt.rank != FIRST
        or active is None
        or not (isinstance(active.operation, RESTARTED_AFTER_END) or active.keeps_repeating)
    ):
        return wanted
    pending = tuple(replace(order, rank=RESUMED) if order is active else order for order in wanted.pending)
    return replace(wanted, pending=pending, active=0)


def _ends(operation: op.Operation, order: Order, active: bool) -> bool:
    other = order.operation
    match operation:
        case op.StopAxis(axis=axis):
            return axis_moved(other) == axis or pulse_axis(order) == axis
        case op.AbortSlew():
            return isinstance(other, GOTOS)
        case op.Move() | op.MoveAxis() | op.TrackRate():
            held = not active and order.held is None
            return held and (axis_moved(other), type(other)) == (axis_moved(operation), type(operation))
    return False


def pulse_axis(order: Order) -> int | None:
    """Return the axis of a guide pulse, its remainder or its end; None for all other orders."""
    match order.operation:
        case op.Pulse(direction=direction):
            return direction.axis
        case op.PulseAxis(axis=axis):
            return axis
        case op.StopAxis(axis=axis) if order.follow_up:
            return axis
    return None


# --- what comes next ---------------------------------------------------------------------------------------------


def next_operation(wanted: Wanted, now: float) -> Order | None:
    """Return the order to carry out now; None if none is due.

    Ends come first, then what an end interrupted, then all other orders in the order of their arrival. A guide pulse
    waits for the one before it on its axis.
    """
    due = [order for order in wanted.pending if due_at(wanted, order) <= now]
    return min(due, key=lambda order: (order.rank, order.number), default=None)


def next_moment(wanted: Wanted) -> float | None:
    """Return the loop time at which the next order is due; None if nothing waits but for another order."""
    moment = min((due_at(wanted, order) for order in wanted.pending), default=inf)
    return moment if moment < inf else None


def due_at(wanted: Wanted, order: Order) -> float:
    """Return the loop time from which an order may be carried out."""
    if wanted.taps and waits_for(wanted, axis_moved(order.operation)):
        return inf
    axis = None if order.follow_up else pulse_axis(order)
    if axis is None:
        return order.at
    return max((order.at, wanted.rests_by, *(one.until for one in wanted.pulses if one.axis == axis)))


# --- the rows -------------------------------------------------------------------------------------------------------


def _append(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the order, after removing what it supersedes."""
    wanted = without_superseded(wanted, order.operation)
    return replace(wanted, pending=(*wanted.pending, order), asked=wanted.asked + 1)


def _by_hand(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the arrow. It cancels gotos that are postponed: whoever presses it wants to move the mount himself."""
    axis = axis_moved(order.operation)
    pending = tuple(one for one in wanted.pending if one.number == wanted.active or not _is_postponed(one))
    wanted = wanted if len(pending) == len(wanted.pending) else replace(wanted, pending=pending)
    if order.by is not None and axis is not None:
        others = tuple(press for press in wanted.pressed if (press.who, press.axis) != (order.by.who, axis))
        wanted = replace(wanted, pressed=(*others, Press(order.by.who, axis, wanted.gotos)))
    return _append(wanted, order, now, slewing)


def _goto(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Append the goto in place of postponed gotos, arrows and pulses, and count it: later arrows are newer."""
    if any(isinstance(one.operation, op.Move | op.MoveAxis) for one in wanted.pending):
        wanted = without_presses(wanted)
    pending = tuple(one for one in wanted.pending if one.number == wanted.active or not _replaced_by_goto(one))
    return _append(replace(wanted, gotos=wanted.gotos + 1, pending=pending), order, now, slewing)


def _is_postponed(order: Order) -> bool:
    """Whether the order is a goto that waits until the mount accepts commands, or for a site or clock."""
    return isinstance(order.operation, GOTOS) and not order.follow_up and order.at > 0.0


def _replaced_by_goto(order: Order) -> bool:
    """Whether a newer goto replaces the order: a guide pulse, or a goto postponed until the mount accepts commands."""
    if isinstance(order.operation, GOTOS):
        return _is_postponed(order)
    return pulse_axis(order) is not None and not order.follow_up


def _pulse(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    if sum(isinstance(other.operation, op.Pulse | op.PulseAxis) for other in wanted.pending) >= PULSES:
        raise Refused(f"{PULSES} guide pulses wait already: this one is dropped.")
    return _append(wanted, order, now, slewing)


def _halt(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Apply the halt of one axis, which may end a whole goto, or be the release of an arrow that is still to move."""
    if order.ends_tap:
        return ended(wanted, order)
    if not wanted.waiting_gotos and (wanted.by_hand or not slewing) and (tapped := released(wanted, order)) is not None:
        return tapped
    axis = axis_ended(order.operation)
    press = next(
        (one for one in wanted.pressed if order.by is not None and (one.who, one.axis) == (order.by.who, axis)), None
    )
    wanted = replace(
        wanted,
        pressed=tuple(one for one in wanted.pressed if one is not press and (order.by is not None or one.axis != axis)),
    )
    gotos = wanted.waiting_gotos
    if not gotos and (wanted.by_hand or not slewing):  # motion by hand means that the goto has ended
        return _end(wanted, order, now, slewing)
    if press is None or press.gotos >= wanted.gotos:
        return stopped(wanted)
    return replace(wanted, pending=(*wanted.pending, replace(order, unless=gotos[-1].number))) if gotos else wanted


def _end(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Put an end first, but behind a goto that it may have to end, and in order if a client keeps repeating it."""
    axis = axis_ended(order.operation)
    wanted = without_superseded(
        replace(wanted, pulses=tuple(one for one in wanted.pulses if one.axis != axis)), order.operation
    )
    same = equal_pending_halt(wanted, order.operation)
    if same is not None:
        return interrupted(wanted, same)
    before = next((one for one in wanted.halted if one.operation == order.operation), None)
    again = before is not None and before.asked == wanted.asked and now - before.at <= AGAIN
    order = replace(
        order,
        overtakes=not wanted.waiting_gotos,
        asked=wanted.asked,
        repeats=before.repeats + 1 if before is not None and again else 0,
    )
    order = replace(order, rank=FIRST if order.overtakes and not order.keeps_repeating else IN_ORDER)
    return interrupted(replace(wanted, pending=(*wanted.pending, order)), order)


def axis_ended(operation: op.Operation) -> int | None:
    return operation.axis if isinstance(operation, op.StopAxis) else None


def _focus(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Replace the retry of a focuser halt: the newest order for the focuser counts."""
    pending = tuple(
        other
        for other in wanted.pending
        if not (other.follow_up and ends_focus(other.operation) and other.number != wanted.active)
    )
    return _append(replace(wanted, pending=pending), order, now, slewing)


def _sleep(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Forget the pressed arrows: a hibernating mount does not move."""
    return _append(replace(wanted, pressed=()), order, now, slewing)


_ROWS: dict[type[op.Operation], Callable[[Wanted, Order, float, bool], Wanted]] = {
    **dict.fromkeys(GOTOS, _goto),
    op.Move: _by_hand,
    op.MoveAxis: _by_hand,
    op.Pulse: _pulse,
    op.PulseAxis: _pulse,
    op.StopAxis: _halt,
    op.AbortSlew: _end,
    op.Focus: _focus,
    op.Hibernate: _sleep,
}
