"""How the outcome of an order changes `Wanted`: done by the mount, refused, superseded, or postponed.

The counterpart of ``apply``, and again pure functions. What the mount has acknowledged becomes ``motion``. A guide
pulse leaves its end or its remainder behind as an order of the gateway. A release that waited for a goto takes effect
if the goto was refused. A goto that arrives while the mount is calculating is postponed, but not for long.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import BY_HAND, ENDS, GOTOS, MOVING
from gateway.mount.motion.apply import pulse_axis
from gateway.mount.motion.taps import begin
from gateway.mount.motion.wanted import (
    FIRST,
    RESUMED,
    AxisMotion,
    ByHand,
    FocusMotion,
    GuidePulse,
    Halted,
    NotOrdered,
    Order,
    Slew,
    Wanted,
)
from gateway.mount.site.pending_settings import IncomingSettings

#: Seconds after which a program that guides has measured what a guide pulse has done.
SEEN_AFTER = 10.0
#: Seconds that an order waits at most while the mount accepts no commands, and seconds between two checks.
LONGEST, LOOK = 15.0, 0.1
#: Seconds that a goto waits at most for a site or clock that was set before it, and an arrow for one on its way.
FOR_SETTINGS, FOR_EXCHANGE = 20.0, 1.0


class PulseEnded(NamedTuple):
    """A guide pulse that the gateway times was ended, ``late`` seconds later than planned."""

    axis: int
    late: float


class Done(NamedTuple):
    """An operation that the mount has acknowledged; ``before`` is what was wanted until then."""

    operation: op.Operation
    before: Wanted


def removed(wanted: Wanted, order: Order) -> Wanted:
    """Remove an order that has ended in any way."""
    pending = tuple(other for other in wanted.pending if other.number != order.number)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)


def carried_out(wanted: Wanted, order: Order, now: float, answer: object = None) -> Wanted:
    """Remove an order that the mount has carried out; note the time if it was a halt."""
    wanted = removed(wanted, order)
    if isinstance(answer, PulseEnded):
        wanted = pulse_ended(wanted, answer)
    if not isinstance(order.operation, ENDS) or order.follow_up:
        return wanted
    others = tuple(one for one in wanted.halted if one.operation != order.operation)
    return replace(wanted, halted=(*others, Halted(order.operation, now, order.asked, order.repeats)))


def failed(wanted: Wanted, order: Order) -> Wanted:
    """Remove an order that failed. If it was a goto, releases of arrows that waited for it take effect after all."""
    wanted = removed(wanted, order)
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
    """Whether a failed order may move the mount nevertheless: its acknowledgement was lost, or it had begun before."""
    unheard = isinstance(order.operation, BY_HAND) and isinstance(error, NoAnswer) and error.sent
    return order.then_stop or unheard or (order.rank == RESUMED and isinstance(order.operation, MOVING))


def acknowledged(
    wanted: Wanted, order: Order, operation: op.Operation, now: float, speed: float, sent: float = 0.0
) -> Wanted:
    """Return what is wanted once the mount has acknowledged an operation, in the form in which it was admitted.

    ``speed`` is that of a motion by hand, degrees a second; it was ``sent`` at this loop time.
    """
    match operation:
        case op.Goto() | op.GotoHorizontal() | op.GotoAxes() | op.Park() | op.Home():
            void = {other.number for other in wanted.pending if other.unless == order.number or pulse_axis(other)}
            pending = tuple(other for other in wanted.pending if other.number not in void)
            slew, homed = Slew(operation, order.by, now), isinstance(operation, op.Home)
            moved = replace(wanted, motion=slew, homed=homed, slews=wanted.slews + 1, pulses=(), taps=())
            return replace(moved, pending=pending)
        case op.Move() | op.MoveAxis():
            wanted = replace(_without_pulses(wanted, operation.axis), homed=False)
            motion = AxisMotion(operation, order.by, now, speed, order.since, max(sent, order.since))
            moved = _with(wanted, operation.axis, motion)
            return moved if order.held is None else begin(moved, motion, operation.axis, order.held)
        case op.StopAxis() if order.follow_up:
            return wanted
        case op.StopAxis():
            return _with(wanted, operation.axis, None)
        case op.AbortMotion():
            return at_rest(wanted)
        case op.AbortSlew():
            return replace(wanted, motion=NotOrdered()) if isinstance(wanted.motion, Slew) else wanted
        case op.Hibernate():
            return replace(wanted, motion=NotOrdered())
        case op.Focus(direction=direction):
            return replace(wanted, focus=FocusMotion(order.by, now) if direction else None)
    return wanted


def at_rest(wanted: Wanted) -> Wanted:
    return replace(wanted, motion=NotOrdered(), owed=False)


def arrived(wanted: Wanted) -> Wanted:
    """Note that the goto under way has ended, wherever it did."""
    return replace(wanted, motion=NotOrdered()) if isinstance(wanted.motion, Slew) else wanted


def ended_short(wanted: Wanted, words: str) -> Wanted:
    """Note that the mount ended a goto elsewhere than at its goal; not if a stop has ended it."""
    return wanted if wanted.owed or wanted.short else replace(wanted, short=words)


def pulsed(wanted: Wanted, order: Order, pulse: op.Pulsed, number: int, now: float) -> Wanted:
    """Note a guide pulse that began, and add the order for its end or its remainder, with this ``number``."""
    if isinstance(order.operation, op.Move):  # a tap at guide rate
        order = replace(order, operation=op.Pulse(order.operation.direction, order.operation.ms or 0))
    axis, until = pulse_axis(order), (now if pulse.since is None else pulse.since) + pulse.seconds
    assert axis is not None and isinstance(order.operation, op.Pulse | op.PulseAxis)
    others = tuple(one for one in wanted.pulses if one.axis != axis)
    wanted = replace(wanted, pulses=(*others, GuidePulse(axis, until, order.operation)))
    if not pulse.ends:
        end = Order(number, op.StopAxis(axis), rank=FIRST, at=until, follow_up=True, urgent=True)
        return replace(wanted, pending=(*wanted.pending, end))
    if pulse.left:
        operation = replace(order.operation, ms=pulse.left)
        rest = replace(order, number=number, operation=operation, at=until, follow_up=True)
        return replace(wanted, pending=(*wanted.pending, rest))
    return wanted


def pulse_ended(wanted: Wanted, ended: PulseEnded) -> Wanted:
    """Note by how much a guide pulse was too long."""
    return replace(
        wanted,
        pulses=tuple(
            replace(one, excess=max(0.0, ended.late)) if one.axis == ended.axis else one for one in wanted.pulses
        ),
    )


def without_excess(wanted: Wanted, order: Order, now: float) -> tuple[Wanted, Order]:
    """Take what the last guide pulse of an axis was too long from the next one in the same direction.

    Later the program that guides has seen where the star is.
    """
    pulse, axis = order.operation, pulse_axis(order)
    last = next((one for one in wanted.pulses if one.axis == axis and now < one.until + SEEN_AFTER), None)
    if order.follow_up or not isinstance(pulse, op.Pulse | op.PulseAxis) or last is None or last.operation is None:
        return wanted, order
    taken = min(pulse.ms, round(1000.0 * last.excess)) if replace(last.operation, ms=pulse.ms) == pulse else 0
    pulses = tuple(
        replace(one, excess=max(0.0, one.excess - taken / 1000.0)) if one is last else one for one in wanted.pulses
    )
    return replace(wanted, pulses=pulses), replace(order, operation=replace(pulse, ms=pulse.ms - taken))


def _with(wanted: Wanted, axis: int, motion: AxisMotion | None) -> Wanted:
    """Replace the motion by hand of one axis; None if it has ended."""
    by_hand = wanted.motion if isinstance(wanted.motion, ByHand) else ByHand()
    by_hand = replace(by_hand, first=motion) if axis == 1 else replace(by_hand, second=motion)
    if isinstance(wanted.motion, Slew) and motion is None:
        return wanted
    wanted = replace(wanted, taps=tuple(tap for tap in wanted.taps if tap.axis != axis))
    return replace(wanted, motion=by_hand if by_hand.first or by_hand.second else NotOrdered())


def _without_pulses(wanted: Wanted, axis: int) -> Wanted:
    """Remove the guide pulses of an axis, and their ends, which would end the motion by hand that replaces them."""
    pending = tuple(order for order in wanted.pending if pulse_axis(order) != axis or order.number == wanted.active)
    return replace(wanted, pending=pending, pulses=tuple(one for one in wanted.pulses if one.axis != axis))


# --- orders that wait for a mount that accepts no commands ------------------------------------------------------------


def can_be_postponed(order: Order) -> bool:
    """Whether the order waits while the mount accepts no commands: a goto (the newest only), a tracking mode or rate.

    A retried end waits too, for as long as it takes. Motions by hand and pulses never wait, because they are no longer
    wanted by then. No order waits for a line that is down.
    """
    return order.not_while_busy or (
        isinstance(order.operation, (*GOTOS, op.SetTracking, op.TrackRate)) and not order.follow_up
    )


def may_wait(order: Order, now: float, longest: float = LONGEST) -> bool:
    """Whether the order may wait longer; if not, it is refused while the client still waits for its outcome."""
    return order.not_while_busy or now < min(order.since + longest, order.until)


class Wait(NamedTuple):
    """Why an order is postponed: the refusal after ``longest`` seconds; without one it is carried out then."""

    longest: float
    refusal: Fault | None


def why_wait(order: Order, now: float, occupied: bool, incoming: IncomingSettings) -> Wait | None:
    """Return why an order that is due has to wait; None if it need not.

    A goto is judged by site and clock, so it waits for those that programs were promised before it.
    """
    if isinstance(order.operation, GOTOS) and not order.follow_up and (incoming.pending or incoming.unfinished):
        refusal = incoming.holds_up(now, occupied)
        if refusal is not None:
            return Wait(FOR_SETTINGS, refusal)
    if occupied and can_be_postponed(order):
        return Wait(LONGEST, Busy())
    arrow = isinstance(order.operation, op.Move | op.MoveAxis)
    if arrow and incoming.sending and incoming.waits and now < order.since + FOR_EXCHANGE:
        return Wait(FOR_EXCHANGE, None)
    return None


def client_disconnected(order: Order) -> bool:
    """Whether the order is a goto whose client has disconnected: it is not begun any more."""
    return isinstance(order.operation, GOTOS) and order.by is not None and order.by.closed is not None


def postponed(wanted: Wanted, order: Order, now: float) -> Wanted:
    pending = tuple(replace(one, at=now + LOOK) if one.number == order.number else one for one in wanted.pending)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)
