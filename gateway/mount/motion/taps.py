"""Taps: arrow keys (or buttons) that are released before the mount has begun the motion that they order.

The motion is carried out all the same: it lasts as long as the arrow was held, and at least until the mount has
acknowledged it. A tap that has waited too long is dropped. Taps follow one another; only a stop, a goto or a halt by
somebody else cancels them. If the motion has begun, the release ends it at once, but a short motion keeps its length.
Pure functions over frozen values; times are seconds of the loop's clock.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy
from gateway.core.motion_kinds import END_ORDERS, moved_axis
from gateway.mount.motion.wanted import FIRST_RANK, Arrow, AxisMotion, Halt, HandMove, NoOrderedMove, Order, Tap, Wanted
from gateway.mount.presence import HostActivity

#: Seconds: a press that has waited for its turn longer than MAX_TAP_WAIT is dropped together with its release; so is a
#: press whose arrow was held longer than MAX_TAP_TIME before its turn came.
MAX_TAP_WAIT, MAX_TAP_TIME = 1.5, 1.0
#: If a motion has begun when its arrow is released, at most MAX_TAP_TIME after the press, it lasts at least this part
#: of the time for which the arrow was held; all of that time if that is no longer than SHORT_TAP_TIME.
MIN_TAP_FRACTION, SHORT_TAP_TIME = 0.75, 0.3
#: Seconds: an arrow pressed no longer ago still moves the mount if its program releases it by a full stop.
RECENT_PRESS_AGE = 0.5
#: A tap at guide rate lasts no longer than this multiple of the time that its arrow was held.
MAX_TAP_FACTOR = 1.5


class TapDropped(Busy):
    """The mount was busy for so long that a tap would come too late."""

    default_text = "The mount was busy: this tap came too late to be carried out."


def released(wanted: Wanted, release: Order) -> Wanted | None:
    """Return the new ``Wanted`` if the motion of a released arrow continues for a while; None if it ends at once."""
    axis = axis_of(release)
    waiting = waiting_arrows(wanted, release)
    if waiting:
        return (
            _release_waiting(wanted, waiting, release)
            if is_free_or_ending(wanted, axis) and not _waited_too_long(waiting[-1], release)
            else None
        )
    if any(order.held_for is not None and _same_arrow(release, order) for order in wanted.pending):
        return wanted  # a program that releases an arrow twice
    begun = motion_of(wanted, axis)
    if begun is None or is_free_or_ending(wanted, axis) or not _same_host(begun.client, release.client):
        return None
    held = release.came_at - begun.requested_at
    if held > MAX_TAP_TIME:
        return None
    # A release may have waited since it was read: then its motion had not begun. At guide rate the length counts.
    whole = release.came_at < begun.began_at or is_at_guide_rate(begun.operation)
    least = held if whole else max(min(held, SHORT_TAP_TIME), held * MIN_TAP_FRACTION)
    return begin_tap(wanted, begun, axis, least) if begun.sent_at + least > release.came_at else None


def _release_waiting(wanted: Wanted, orders: list[Order], release: Order) -> Wanted:
    """Return the new ``Wanted`` after the release of an arrow that waits: how long it was held is known now."""
    newest = orders[-1]
    first = orders[0] if orders[0].number == wanted.active else newest
    spans = [(first, release)] if first.operation == newest.operation else [(first, newest), (newest, release)]
    taps = {order.number: _with_holding_time(order, max(0.0, end.came_at - order.came_at)) for order, end in spans}
    remaining = (order for order in wanted.pending if order not in orders or order.number in taps)
    wanted = replace(wanted, pending=tuple(taps.get(order.number, order) for order in remaining))
    last = taps[spans[-1][0].number]
    if is_at_guide_rate(last.operation) and last.number != wanted.active:
        return _tap_to_pulse(wanted, last)
    return _join_taps(wanted, last)


def _tap_to_pulse(wanted: Wanted, tap: Order) -> Wanted:
    """Turn a tap at guide rate into a guide pulse; if it is too short for the mount, add its time to the next tap."""
    before = sum(other.held_for or 0.0 for other in wanted.short_taps if other.operation == tap.operation)
    others_kept = tuple(other for other in wanted.short_taps if axis_of(other) != axis_of(tap))
    tap = replace(_with_holding_time(tap, before + (tap.held_for or 0.0)), due_from=0.0)
    others = tuple(other for other in wanted.pending if other.number != tap.number)
    if (tap.held_for or 0.0) < tap.arrow.min_time:
        return replace(wanted, pending=others, short_taps=(*others_kept, tap))
    pulse = replace(tap, operation=replace(tap.operation, ms=round((tap.held_for or 0.0) * 1000.0)))
    return replace(wanted, pending=(*others, pulse), short_taps=others_kept)


def is_at_guide_rate(operation: op.Operation) -> bool:
    """Whether an operation is an arrow at the guide rate."""
    return isinstance(operation, op.Move) and operation.rate.name == "guide"


def _join_taps(wanted: Wanted, tap: Order) -> Wanted:
    """Join a tap with an equal tap before it that has not ended, so that a slow line carries out both in time."""
    axis, begun = axis_of(tap), motion_of(wanted, axis_of(tap))
    others = tuple(other for other in wanted.pending if other is not tap)
    before = next((other for other in reversed(others) if _same_arrow(tap, other) and other.number < tap.number), None)
    if before is not None:
        held = (before.held_for or 0.0) + (tap.held_for or 0.0)
        if before.operation == tap.operation and tap.number != wanted.active and held <= MAX_TAP_TIME:
            joined = replace(_with_holding_time(before, held), came_at=tap.came_at)
            return replace(wanted, pending=tuple(joined if other is before else other for other in others))
    elif (
        begun is not None and begun.operation == tap.operation and has_tap(wanted, axis) and not _has_halt(wanted, axis)
    ):
        longer = [
            replace(other, ends_at=other.ends_at + (tap.held_for or 0.0)) for other in wanted.taps if other.axis == axis
        ]
        if _same_host(begun.client, tap.client) and longer[0].ends_at - begun.sent_at <= MAX_TAP_TIME:
            taps = (*(other for other in wanted.taps if other.axis != axis), *longer)
            return replace(wanted, pending=others, taps=taps)
    return wanted


def was_fulfilled_otherwise(order: Order, wanted: Wanted) -> bool:
    """Whether an order that is no longer pending was fulfilled in another way. This is so for a halt, because whatever
    removes it ends the motion, too; and for an arrow that was replaced by, or joined with, another of the same client.
    """
    if isinstance(order.operation, END_ORDERS):
        return True
    axis = moved_axis(order.operation)
    begun = motion_of(wanted, axis or 0)
    joined = has_tap(wanted, axis) and begun is not None and _same_host(begun.client, order.client)
    return axis is not None and (
        joined or any(_same_arrow(order, waiting_order) for waiting_order in (*wanted.pending, *wanted.short_taps))
    )


def begin_tap(wanted: Wanted, motion: AxisMotion, axis: int, held_seconds: float) -> Wanted:
    """Note that the mount has acknowledged the motion of an arrow that was released after ``held_seconds``."""
    others = tuple(tap for tap in wanted.taps if tap.axis != axis)
    return replace(wanted, taps=(*others, Tap(axis, motion.client, motion.sent_at + held_seconds)))


def after_stop_as_release(wanted: Wanted, activity: HostActivity, now: float) -> Wanted | None:
    """Return the new ``Wanted`` after a full stop by which a program releases an arrow: a short motion, then the stop.
    This requires that nothing moves and that a single order waits: the same host's recent, unreleased press of an
    arrow. Otherwise return None: the stop must be sent at once.
    """
    waiting = [other for other in wanted.pending if not other.follow_up]
    moving = not isinstance(wanted.motion, NoOrderedMove) or wanted.stop_owed or wanted.pulses or wanted.taps
    if moving or len(waiting) != 1:
        return None
    [press] = waiting
    if moved_axis(press.operation) is None or press.held_for is not None or not _same_host(press.client, activity):
        return None
    if now - press.came_at > RECENT_PRESS_AGE:
        return None
    tap = replace(press, arrow=Arrow(held_seconds=0.0, then_stop=True))
    pending = tuple(tap if other is press else other for other in wanted.pending)
    return replace(wanted, pending=pending, arrows=(), stop_count=wanted.stop_count + 1)


def end_tap(wanted: Wanted, halt: Halt) -> Wanted:
    """Add the halt that ends a tap; it cancels no later order. If a goto is being sent, its start voids the halt."""
    goto = next((other.number for other in wanted.waiting_gotos if other.number == wanted.active), 0)
    halt = replace(halt, rank=FIRST_RANK, overtakes=True, order_count=wanted.order_count, voided_by=goto)
    return replace(wanted, pending=(*wanted.pending, halt))


def dropped_press(wanted: Wanted, wanted_after: Wanted, release: Order) -> Order | None:
    """Return the press that the release has dropped, because it waited or was held too long; None if there is none."""
    waiting = waiting_arrows(wanted, release)
    if not waiting or not is_free_or_ending(wanted, axis_of(release)) or not _waited_too_long(waiting[-1], release):
        return None
    return None if any(other.number == waiting[-1].number for other in wanted_after.pending) else waiting[-1]


def without_waiting_arrows(wanted: Wanted) -> Wanted:
    """Remove the arrows that wait for their turn; an arrow that is being carried out stays."""
    waiting = [order for order in wanted.pending if moved_axis(order.operation) and order.number != wanted.active]
    tapped = {
        (order.client.host, moved_axis(order.operation))
        for order in waiting
        if order.client is not None and order.held_for is not None
    }
    return replace(
        wanted,
        pending=tuple(order for order in wanted.pending if order not in waiting),
        arrows=tuple(order for order in wanted.arrows if (order.host, order.axis) not in tapped),
    )


def waiting_arrows(wanted: Wanted, release: Order) -> list[Order]:
    """Return the arrows of an axis that this client holds and whose motion has not begun, in their order."""
    return [order for order in wanted.pending if order.held_for is None and _same_arrow(release, order)]


def arrow_holder(wanted: Wanted, axis: int) -> HostActivity | None:
    """Return the client that has pressed the newest arrow of an axis and has not released it; None if none has."""
    for order in reversed(wanted.pending):
        if moved_axis(order.operation) == axis and order.held_for is None:
            return order.client
    begun = motion_of(wanted, axis)
    return None if begun is None or is_free_or_ending(wanted, axis) else begun.client


def is_free_or_ending(wanted: Wanted, axis: int) -> bool:
    """Whether no motion by hand turns the axis, or that motion is ending: it is a tap, or a halt is pending."""
    return motion_of(wanted, axis) is None or _has_halt(wanted, axis) or wanted.stop_owed or has_tap(wanted, axis)


def _has_halt(wanted: Wanted, axis: int) -> bool:
    return any(isinstance(order, Halt) and order.operation == op.StopAxis(axis) for order in wanted.pending)


def has_tap(wanted: Wanted, axis: int | None) -> bool:
    """Whether a tap on this axis has begun and not ended: the next motion by hand waits for its end."""
    return any(tap.axis == axis for tap in wanted.taps)


def motion_of(wanted: Wanted, axis: int) -> AxisMotion | None:
    """Return the acknowledged motion by hand of an axis; None if there is none."""
    motion = wanted.motion
    return None if not isinstance(motion, HandMove) else motion.first if axis == 1 else motion.second


def axis_of(order: Order) -> int:
    """Return the axis of an arrow, or of its release; 0 for any other order."""
    return getattr(order.operation, "axis", 0)


def _with_holding_time(press: Order, seconds: float) -> Order:
    """Return the press of an arrow that was held for these seconds."""
    return replace(press, arrow=replace(press.arrow, held_seconds=seconds))


def _waited_too_long(press: Order, release: Order) -> bool:
    return release.came_at - press.came_at > MAX_TAP_TIME


def _same_arrow(order: Order, other: Order) -> bool:
    """Whether ``other`` is an arrow of the same axis and host as ``order``, which is an arrow or a release."""
    return moved_axis(other.operation) == axis_of(order) and _same_host(other.client, order.client)


def _same_host(press: HostActivity | None, release: HostActivity | None) -> bool:
    """Whether a press and a release are of the same host: some programs open a connection for every command."""
    return press is not None and release is not None and press.host == release.host
