"""What is wanted once an order has come to its end: done by the mount, refused, taken back, or put off.

The counterpart of ``apply``: pure functions again. What the mount has acknowledged becomes ``motion``; a guide pulse
leaves its end or its rest behind as an order of the gateway's own; a release that waited for a goto counts if that was
refused. A goto that comes while a telescope calculates is put off until it hears again, and not for long.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.core.motion_kinds import BY_HAND, ENDS, GOTOS, MOVING
from gateway.mount.motion.apply import pulses
from gateway.mount.motion.wanted import (
    FIRST,
    RESUMED,
    AxisMotion,
    ByHand,
    FocusMotion,
    GuidePulse,
    Halted,
    Order,
    Slew,
    Theirs,
    Wanted,
)

#: Seconds from the order on that one waits for a mount that does not hear; and between two looks whether it does.
LONGEST, LOOK = 15.0, 0.1


class Done(NamedTuple):
    """The mount has acknowledged an operation; ``before`` is what was wanted until then."""

    operation: op.Operation
    before: Wanted


def over(wanted: Wanted, order: Order) -> Wanted:
    """Without an order that has come to its end, however it did."""
    pending = tuple(other for other in wanted.pending if other.number != order.number)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)


def done(wanted: Wanted, order: Order, now: float) -> Wanted:
    """The same of one that the mount has carried out; of a halt it is noted when."""
    wanted = over(wanted, order)
    if not isinstance(order.operation, ENDS) or order.follow_up:
        return wanted
    others = tuple(one for one in wanted.halted if one.operation != order.operation)
    return replace(wanted, halted=(*others, Halted(order.operation, now, order.asked, order.repeats)))


def refused(wanted: Wanted, order: Order) -> Wanted:
    """The same of one that came to nothing; an arrow that was released meanwhile is to be released after all."""
    wanted = over(wanted, order)
    if isinstance(order.operation, ENDS):
        wanted = replace(wanted, halted=tuple(one for one in wanted.halted if one.operation != order.operation))
    released = [other for other in wanted.pending if other.unless == order.number]
    if not released:
        return wanted
    pending = tuple(
        replace(other, unless=0, rank=FIRST) if other.unless == order.number else other
        for other in wanted.pending
        if other.unless != order.number or getattr(other.operation, "axis", 0) in wanted.by_hand
    )
    return replace(wanted, pending=pending)


def may_have_begun(order: Order, error: BaseException) -> bool:
    """Whether what failed may move the mount all the same: its acknowledgement was lost, or it was begun before."""
    unheard = isinstance(order.operation, BY_HAND) and isinstance(error, NoAnswer) and error.sent
    return unheard or (order.rank == RESUMED and isinstance(order.operation, MOVING))


def taken(wanted: Wanted, order: Order, operation: op.Operation, now: float, speed: float) -> Wanted:
    """What moves, once the mount has acknowledged an operation in the form in which it was admitted.

    ``speed``: of a motion by hand, degrees a second.
    """
    match operation:
        case op.Goto() | op.GotoHorizontal() | op.GotoAxes() | op.Park() | op.Home():
            void = {other.number for other in wanted.pending if other.unless == order.number or pulses(other)}
            pending = tuple(other for other in wanted.pending if other.number not in void)
            motion, homed = Slew(operation, order.by, now), isinstance(operation, op.Home)
            return replace(wanted, motion=motion, homed=homed, slews=wanted.slews + 1, pulses=(), pending=pending)
        case op.Move() | op.MoveAxis():
            wanted = replace(_without_pulses(wanted, operation.axis), homed=False)
            return _with(wanted, operation.axis, AxisMotion(operation, order.by, now, speed))
        case op.StopAxis() if order.follow_up:
            return wanted
        case op.StopAxis():
            return _with(wanted, operation.axis, None)
        case op.AbortSlew():
            return replace(wanted, motion=Theirs()) if isinstance(wanted.motion, Slew) else wanted
        case op.Hibernate():
            return replace(wanted, motion=Theirs())
        case op.Focus(direction=direction):
            return replace(wanted, focus=FocusMotion(order.by, now) if direction else None)
    return wanted


def at_rest(wanted: Wanted) -> Wanted:
    return replace(wanted, motion=Theirs(), owed=False)


def arrived(wanted: Wanted) -> Wanted:
    """The goto under way is over, wherever it ended."""
    return replace(wanted, motion=Theirs()) if isinstance(wanted.motion, Slew) else wanted


def pulsed(wanted: Wanted, order: Order, pulse: op.Pulsed, number: int, now: float) -> Wanted:
    """A guide pulse was begun: its end, or its rest, becomes due; ``number`` is that of the order for it."""
    axis, until = pulses(order), now + pulse.seconds
    assert axis is not None
    others = tuple(one for one in wanted.pulses if one.axis != axis)
    wanted = replace(wanted, pulses=(*others, GuidePulse(axis, until)))
    if not pulse.ends:
        end = Order(number, op.StopAxis(axis), rank=FIRST, at=until, follow_up=True, urgent=True)
        return replace(wanted, pending=(*wanted.pending, end))
    if pulse.left:
        operation = replace(order.operation, ms=pulse.left)
        rest = replace(order, number=number, operation=operation, at=until, follow_up=True)
        return replace(wanted, pending=(*wanted.pending, rest))
    return wanted


def _with(wanted: Wanted, axis: int, motion: AxisMotion | None) -> Wanted:
    """What moves by hand, with one axis as it is now."""
    by_hand = wanted.motion if isinstance(wanted.motion, ByHand) else ByHand()
    by_hand = replace(by_hand, first=motion) if axis == 1 else replace(by_hand, second=motion)
    if isinstance(wanted.motion, Slew) and motion is None:
        return wanted
    return replace(wanted, motion=by_hand if by_hand.first or by_hand.second else Theirs())


def _without_pulses(wanted: Wanted, axis: int) -> Wanted:
    """An arrow takes the place of a guide pulse: its end must not end the arrow."""
    pending = tuple(order for order in wanted.pending if pulses(order) != axis or order.number == wanted.active)
    return replace(wanted, pending=pending, pulses=tuple(one for one in wanted.pulses if one.axis != axis))


# --- what waits for a mount that does not hear ------------------------------------------------------------------------


def patient(order: Order) -> bool:
    """Whether it waits for a mount that cannot hear: a goto, of which the newest one only, a tracking mode or rate.

    So does, for as long as it takes, an end that is sent a second time. Arrows and pulses never wait: by then they are
    no longer meant. A line that is down is waited for by nobody.
    """
    return order.heard or (isinstance(order.operation, (*GOTOS, op.SetTracking, op.TrackRate)) and not order.follow_up)


def may_wait(order: Order, now: float) -> bool:
    """Whether it has not waited for too long; whoever waits for its outcome is told no while he still listens."""
    return order.heard or now < min(order.since + LONGEST, order.until)


def forsaken(order: Order) -> bool:
    """Whether it is a goto whose program has gone: it is not begun after its connection has closed."""
    return isinstance(order.operation, GOTOS) and order.by is not None and order.by.closed is not None


def postponed(wanted: Wanted, order: Order, now: float) -> Wanted:
    pending = tuple(replace(one, at=now + LOOK) if one.number == order.number else one for one in wanted.pending)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)
