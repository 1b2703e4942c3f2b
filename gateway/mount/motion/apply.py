"""How orders change what is wanted, and what comes next: one small row a kind of order, pure functions.

The newest order counts: a rate replaces one that still waits, a halt takes back what would set its axis moving, a stop
all that moves. A goto is one thing with two axes: a halt of either while it waits or is under way ends it as a whole,
except the release of an arrow that the same host pressed before the goto, which is over.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Refused
from gateway.core.motion_kinds import BEGUN_ANEW, ENDS, GOTOS, axis_moved, ends_focus, survives_abort
from gateway.mount.motion.wanted import AGAIN, FIRST, IN_ORDER, RESUMED, Order, Press, Wanted
from gateway.protocols.base.driver import Schedule

#: Guide pulses that may wait for their turn; more than that is no guiding.
PULSES = 8


def apply(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """What is wanted after an order. ``slewing``: the mount is seen to carry out a goto. Raises Refused."""
    return _ROWS.get(type(order.operation), _asked)(wanted, order, now, slewing)


def stopped(wanted: Wanted) -> Wanted:
    """A stop: all that moves or would move is over, and the mount is owed the command for it."""
    pending = tuple(
        order
        for order in wanted.pending
        if survives_abort(order.operation) or (order.urgent and order.number == wanted.active)
    )
    return replace(wanted, pending=pending, pulses=(), pressed=(), owed=True, stops=wanted.stops + 1)


def does_for(wanted: Wanted, operation: op.Operation) -> Order | None:
    """The equal halt that is not done, and does for this one as well; None when there is none.

    One that is behind a goto does only for those between which nothing else was asked for.
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
    """With a follow-up of the driver's own as order ``number``; the same one planned again replaces the first."""
    order = Order(
        number,
        later.operation,
        rank=FIRST if later.urgent else IN_ORDER,
        at=now + later.seconds,
        follow_up=True,
        urgent=later.urgent,
        heard=later.heard,
    )
    others = tuple(
        one
        for one in wanted.pending
        if not (one.follow_up and one.operation == order.operation and one.number != wanted.active)
    )
    return replace(wanted, pending=(*others, order))


def too_late(wanted: Wanted, operation: op.Operation, stops: int | None) -> bool:
    """Whether a stop has come since it was asked for; ``stops`` is how many there had been then."""
    if stops is None or stops == wanted.stops:
        return False
    return not (isinstance(operation, op.StopAxis) or survives_abort(operation))


def take_back(wanted: Wanted, operation: op.Operation) -> Wanted:
    """Without what a halt, the end of gotos or a newer rate ends before it has begun."""
    pending = tuple(order for order in wanted.pending if not _ends(operation, order, order.number == wanted.active))
    return wanted if len(pending) == len(wanted.pending) else replace(wanted, pending=pending)


def interrupted(wanted: Wanted, halt: Order) -> Wanted:
    """What is only being prepared is begun anew behind a halt that goes first."""
    active = next((order for order in wanted.pending if order.number == wanted.active), None)
    if halt.rank != FIRST or active is None or not (isinstance(active.operation, BEGUN_ANEW) or active.hammered):
        return wanted
    pending = tuple(replace(order, rank=RESUMED) if order is active else order for order in wanted.pending)
    return replace(wanted, pending=pending, active=0)


def _ends(operation: op.Operation, order: Order, active: bool) -> bool:
    other = order.operation
    match operation:
        case op.StopAxis(axis=axis):
            return axis_moved(other) == axis or pulses(order) == axis
        case op.AbortSlew():
            return isinstance(other, GOTOS)
        case op.Move() | op.MoveAxis() | op.TrackRate():
            return not active and (axis_moved(other), type(other)) == (axis_moved(operation), type(operation))
    return False


def pulses(order: Order) -> int | None:
    """The axis that a guide pulse, the rest of one or its end belongs to; None for everything else."""
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
    """The order that is due; None when there is none.

    Ends come first, then what was interrupted for one, then everything else in the order in which it was asked for. A
    guide pulse waits for the one before it on its axis.
    """
    due = [order for order in wanted.pending if due_at(wanted, order) <= now]
    return min(due, key=lambda order: (order.rank, order.number), default=None)


def next_moment(wanted: Wanted) -> float | None:
    """The loop time at which the next order is due; None when nothing waits."""
    return min((due_at(wanted, order) for order in wanted.pending), default=None)


def due_at(wanted: Wanted, order: Order) -> float:
    """The loop time from which on an order may be carried out."""
    if order.follow_up or not wanted.pulses:
        return order.at
    axis = pulses(order)
    return max((order.at, *(one.until for one in wanted.pulses if one.axis == axis)))


# --- the rows -------------------------------------------------------------------------------------------------------


def _asked(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Everything in the order in which it was asked for."""
    wanted = take_back(wanted, order.operation)
    return replace(wanted, pending=(*wanted.pending, order), asked=wanted.asked + 1)


def _by_hand(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    axis = axis_moved(order.operation)
    if order.by is not None and axis is not None:
        others = tuple(press for press in wanted.pressed if (press.who, press.axis) != (order.by.who, axis))
        wanted = replace(wanted, pressed=(*others, Press(order.by.who, axis, wanted.gotos)))
    return _asked(wanted, order, now, slewing)


def _goto(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """What is pressed from now on is newer than this."""
    pending = tuple(one for one in wanted.pending if one.number == wanted.active or not _gives_way(one))
    return _asked(replace(wanted, gotos=wanted.gotos + 1, pending=pending), order, now, slewing)


def _gives_way(order: Order) -> bool:
    """Whether a newer goto ends it: a goto that waits for the mount to hear, and a guide pulse."""
    if isinstance(order.operation, GOTOS):
        return order.at > 0.0
    return pulses(order) is not None and not order.follow_up


def _pulse(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    if sum(isinstance(other.operation, op.Pulse | op.PulseAxis) for other in wanted.pending) >= PULSES:
        raise Refused(f"{PULSES} guide pulses wait already: this one is dropped.")
    return _asked(wanted, order, now, slewing)


def _halt(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """The end of one axis, or of a goto as a whole."""
    axis = axis_ended(order.operation)
    press = next(
        (one for one in wanted.pressed if order.by is not None and (one.who, one.axis) == (order.by.who, axis)), None
    )
    wanted = replace(
        wanted,
        pressed=tuple(one for one in wanted.pressed if one is not press and (order.by is not None or one.axis != axis)),
    )
    gotos = wanted.waiting_gotos
    if not gotos and (wanted.by_hand or not slewing):  # an arrow that was begun has ended the goto
        return _end(wanted, order, now, slewing)
    if press is None or press.gotos >= wanted.gotos:
        return stopped(wanted)
    return replace(wanted, pending=(*wanted.pending, replace(order, unless=gotos[-1].number))) if gotos else wanted


def _end(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """Before all that waits, except a goto that it may have to end; one that is hammered waits for its turn."""
    axis = axis_ended(order.operation)
    wanted = take_back(replace(wanted, pulses=tuple(one for one in wanted.pulses if one.axis != axis)), order.operation)
    same = does_for(wanted, order.operation)
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
    order = replace(order, rank=FIRST if order.overtakes and not order.hammered else IN_ORDER)
    return interrupted(replace(wanted, pending=(*wanted.pending, order)), order)


def axis_ended(operation: op.Operation) -> int | None:
    return operation.axis if isinstance(operation, op.StopAxis) else None


def _focus(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """The newest counts: the end of a motion before, which the mount did not hear and is to be told again, is over."""
    pending = tuple(
        other
        for other in wanted.pending
        if not (other.follow_up and ends_focus(other.operation) and other.number != wanted.active)
    )
    return _asked(replace(wanted, pending=pending), order, now, slewing)


def _sleep(wanted: Wanted, order: Order, now: float, slewing: bool) -> Wanted:
    """What sleeps holds no arrow."""
    return _asked(replace(wanted, pressed=()), order, now, slewing)


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
