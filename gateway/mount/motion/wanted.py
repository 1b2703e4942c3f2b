"""What the gateway wants of a mount: one frozen value, which also decides which pending order is carried out next.

``Wanted.pending`` holds the orders that are not carried out yet, ``Wanted.motion`` the ordered motion that the mount
has acknowledged (``changes.py``). If there is none (``NoOrderedMove``), a person at the hand control may be moving
the mount. ``Movement`` reports which motions are under way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import END_ORDERS, GOTOS, moved_axis
from gateway.core.signals import Signal
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.site.pending_settings import IncomingSettings

#: The ranks of orders: halts (and a wake-up), orders that a halt interrupted, all other orders.
FIRST_RANK, RESUMED_RANK, USUAL_RANK = range(3)
#: How many repetitions of a halt go before all other orders, each within URGENT_REPEAT_WINDOW seconds of the last.
URGENT_REPEATS, URGENT_REPEAT_WINDOW = 1, 1.0
#: Seconds that an order waits at most while the mount accepts no commands, and seconds between two checks.
MAX_POSTPONEMENT, RECHECK_PERIOD = 15.0, 0.1
#: Seconds that a goto waits at most for a site or clock that was set before it, and an arrow for a setting under way.
MAX_SETTINGS_WAIT, MAX_EXCHANGE_WAIT = 20.0, 1.0


class Postponement(NamedTuple):
    """An order waits up to ``max_wait`` seconds. Then it fails with ``refusal``, or is carried out if that is None."""

    max_wait: float
    refusal: Fault | None


class Arrow(Struct, frozen=True):
    """An arrow key whose motion has not begun. ``held_seconds``: how long it was held; None if it is still held.

    ``then_stop``: a full stop follows at once. A tap shorter than ``min_time`` seconds is added to the next.
    """

    held_seconds: float | None = None
    then_stop: bool = False
    min_time: float = 0.0


class Order(Struct, frozen=True):
    """An operation that a client or the gateway has ordered and that is not done.

    ``number`` is its sequence number, ``client`` the client's connection. Loop times: it arrived at ``came_at``, is due
    from ``due_from``, and its client waits until ``deadline``. A ``follow_up`` is the gateway's own order; it is
    ``urgent`` if it ends a motion, and ``not_while_busy`` if it waits until the mount accepts commands.
    """

    number: int
    operation: op.Operation
    client: HostActivity | None = None
    rank: int = USUAL_RANK
    came_at: float = 0.0
    due_from: float = 0.0
    deadline: float = inf
    follow_up: bool = False
    urgent: bool = False
    not_while_busy: bool = False
    arrow: Arrow = Arrow()

    @property
    def held_for(self) -> float | None:
        """For how many seconds an arrow was held, if it was released before its motion has begun; else None."""
        return self.arrow.held_seconds

    @property
    def pulse_axis(self) -> int | None:
        """The axis of a guide pulse, its remainder or its end; None for all other orders."""
        match self.operation:
            case op.Pulse(direction=direction):
                return direction.axis
            case op.PulseAxis(axis=axis):
                return axis
            case op.StopAxis(axis=axis) if self.follow_up:
                return axis
        return None

    # --- waiting for a mount that accepts no commands -----------------------------------------------------------------

    @property
    def can_be_postponed(self) -> bool:
        """Whether the order waits while the mount accepts no commands: a goto (the newest only), a tracking mode or
        rate, and, without a time limit, a retried halt. Motions by hand and pulses never wait, because they are no
        longer wanted by then. No order waits for a line that is down.
        """
        return self.not_while_busy or (
            isinstance(self.operation, (*GOTOS, op.SetTracking, op.TrackRate)) and not self.follow_up
        )

    @property
    def client_disconnected(self) -> bool:
        """Whether the order is a goto whose client has disconnected: it is not begun any more."""
        return isinstance(self.operation, GOTOS) and self.client is not None and self.client.closed_at is not None

    def may_wait(self, now: float, max_wait: float = MAX_POSTPONEMENT) -> bool:
        """Whether the order may wait on: for ``max_wait`` seconds since it came, and no longer than its client."""
        return self.not_while_busy or now < min(self.came_at + max_wait, self.deadline)

    def needed_wait(self, now: float, mount_busy: bool, incoming: IncomingSettings) -> Postponement | None:
        """Return up to how long a due order has to wait, and its fault after that; None if it need not wait.

        The limits for a goto depend on site and clock, so it waits for those that clients have set before it.
        """
        if isinstance(self.operation, GOTOS) and not self.follow_up and (incoming.pending or incoming.deadlines):
            refusal = incoming.goto_refusal(now, mount_busy)
            if refusal is not None:
                return Postponement(MAX_SETTINGS_WAIT, refusal)
        if mount_busy and self.can_be_postponed:
            return Postponement(MAX_POSTPONEMENT, Busy())
        arrow = isinstance(self.operation, op.Move | op.MoveAxis)
        if arrow and incoming.type_being_sent and now < self.came_at + MAX_EXCHANGE_WAIT:
            return Postponement(MAX_EXCHANGE_WAIT, None)
        return None


class Halt(Order, frozen=True):
    """The order of a client, or of the gateway for it, to end the motion of an axis, or all gotos.

    ``overtakes``: it goes before pending orders. ``repeat_number``: how many equal halts came shortly before.
    ``order_count`` is ``Wanted.order_count`` at its arrival. ``ends_tap``: it ends a motion whose arrow was released
    earlier. Once the goto with the number ``voided_by`` has begun, this halt is void.
    """

    overtakes: bool = False
    repeat_number: int = 0
    order_count: int = 0
    ends_tap: bool = False
    voided_by: int = 0

    @property
    def keeps_repeating(self) -> bool:
        """Whether a client keeps repeating this halt: then it can wait for its turn."""
        return self.repeat_number > URGENT_REPEATS


class AxisMotion(Struct, frozen=True):
    """The motion by hand of an axis, at ``speed`` degrees a second: its operation and the client's connection; the loop
    times at which the mount acknowledged it, the client requested it, and its command was sent.
    """

    operation: op.Move | op.MoveAxis
    client: HostActivity | None
    began_at: float
    speed: float
    requested_at: float = 0.0
    sent_at: float = 0.0


class HandMove(Struct, frozen=True):
    """Motion by hand on one axis or both."""

    first: AxisMotion | None = None
    second: AxisMotion | None = None

    def __iter__(self) -> Iterator[tuple[int, AxisMotion]]:
        return ((axis, motion) for axis, motion in ((1, self.first), (2, self.second)) if motion is not None)


class Slew(Struct, frozen=True):
    """A goto of both axes: its operation as it was sent, the client's connection, and the loop time of its start."""

    operation: op.Goto | op.GotoHorizontal | op.GotoAxes | op.Park | op.Home
    client: HostActivity | None
    began_at: float


class NoOrderedMove(Struct, frozen=True):
    """No motion by the gateway's orders: the mount tracks, rests, or is moved at its hand control."""


class FocusMotion(Struct, frozen=True):
    """A motion of the focuser; a stop of the mount leaves it alone."""

    client: HostActivity | None
    began_at: float


class GuidePulse(Struct, frozen=True):
    """A guide pulse on an axis that is under way until the loop time ``ends_at``."""

    axis: int
    ends_at: float
    operation: op.Pulse | op.PulseAxis | None = None


class Tap(Struct, frozen=True):
    """A motion by hand that goes on for a while after its arrow was released: its axis, client, and end (loop time)."""

    axis: int
    client: HostActivity | None
    ends_at: float


class PressedArrow(Struct, frozen=True):
    """An arrow of an axis that a host has pressed, and how many gotos had been ordered by then."""

    host: str
    axis: int
    gotos_before: int


class DoneHalt(Struct, frozen=True):
    """A halt that was carried out at loop time ``at``. ``order_count`` is ``Wanted.order_count`` at its arrival,
    ``repeat_number`` how many halts with the same operation came shortly before it.
    """

    operation: op.Operation
    at: float
    order_count: int
    repeat_number: int


class Wanted(Struct, frozen=True):
    """All that the gateway wants of a mount now. ``active``: the order that is being carried out, 0 for none.

    ``short_taps`` are taps that are too short for this mount, and are added to the next ones. ``stop_count`` and
    ``goto_count`` count the orders of these kinds so far, ``gotos_begun`` the gotos that the mount has acknowledged,
    ``motions_begun`` the acknowledged motions of each axis, ``order_count`` all orders except halts. ``stop_owed``: the
    mount has not acknowledged a stop yet. ``homed``: the mount was sent home, and no order has moved it since.
    ``goto_failure`` is why the last goto ended before its goal, until the next order of a client. Guide pulses wait
    until the mount is at rest, but not beyond the loop time ``pulses_from``.
    """

    motion: NoOrderedMove | Slew | HandMove = NoOrderedMove()
    focus_motion: FocusMotion | None = None
    pending: tuple[Order, ...] = ()
    pulses: tuple[GuidePulse, ...] = ()
    arrows: tuple[PressedArrow, ...] = ()
    taps: tuple[Tap, ...] = ()
    short_taps: tuple[Order, ...] = ()
    halts: tuple[DoneHalt, ...] = ()
    stop_owed: bool = False
    homed: bool = False
    pulses_from: float = 0.0
    active: int = 0
    stop_count: int = 0
    goto_count: int = 0
    gotos_begun: int = 0
    motions_begun: tuple[int, int] = (0, 0)
    order_count: int = 0
    goto_failure: str = ""

    @property
    def hand_moves(self) -> dict[int, op.Move | op.MoveAxis]:
        """The motions by hand, by axis."""
        motion, motions = self.motion, {}
        if isinstance(motion, HandMove):  # without a loop, because every position calls this a dozen times
            if motion.first is not None:
                motions[1] = motion.first.operation
            if motion.second is not None:
                motions[2] = motion.second.operation
        return motions

    @property
    def active_order(self) -> Order | None:
        """The order that is being carried out; None if there is none."""
        return next((order for order in self.pending if order.number == self.active), None)

    @property
    def waiting_gotos(self) -> list[Order]:
        """The gotos that were ordered and that the mount has not acknowledged."""
        return [order for order in self.pending if isinstance(order.operation, GOTOS)]

    # --- what comes next ----------------------------------------------------------------------------------------------

    def next_order(self, now: float) -> Order | None:
        """Return the order to carry out now; None if none is due.

        Halts and ends of pulses come first, then orders that a halt interrupted, then all others as they arrived. A
        guide pulse waits for the pulse before it on its axis.
        """
        due = [order for order in self.pending if self.due_at(order) <= now]
        return min(due, key=lambda order: (order.rank, order.number), default=None)

    def next_due_time(self) -> float | None:
        """Return the loop time at which the next order is due; None if every pending order waits for another."""
        moment = min((self.due_at(order) for order in self.pending), default=inf)
        return moment if moment < inf else None

    def due_at(self, order: Order) -> float:
        """Return the loop time from which an order may be carried out; infinite while a tap on its axis continues."""
        if self.taps and (axis := moved_axis(order.operation)) and any(tap.axis == axis for tap in self.taps):
            return inf
        axis = None if order.follow_up else order.pulse_axis
        if axis is None:
            return order.due_from
        return max((order.due_from, self.pulses_from, *(pulse.ends_at for pulse in self.pulses if pulse.axis == axis)))

    def postpone(self, order: Order, now: float) -> Wanted:
        pending = tuple(
            replace(other, due_from=now + RECHECK_PERIOD) if other.number == order.number else other
            for other in self.pending
        )
        return replace(self, pending=pending, active=0 if self.active == order.number else self.active)


class WantedState:
    """Holds the present `Wanted`, which only the reconciler replaces; ``changed`` is emitted then."""

    def __init__(self) -> None:
        self.value = Wanted()
        #: The client that ordered the last stop, to explain why a motion has ended; empty if unknown.
        self.stopped_by = ""
        self.changed: Signal[Wanted] = Signal()

    @property
    def hand_moves(self) -> dict[int, op.Move | op.MoveAxis]:
        """The motions by hand, by axis."""
        return self.value.hand_moves

    @property
    def axes_moved_by_hand(self) -> set[int]:
        return set(self.value.hand_moves)

    @property
    def goto_event_count(self) -> int:
        """A number that grows whenever a goto is ordered, and when the mount has acknowledged it."""
        return self.value.goto_count + self.value.gotos_begun

    @property
    def stop_owed(self) -> bool:
        """Whether the mount has not acknowledged a stop yet."""
        return self.value.stop_owed

    @property
    def is_ending(self) -> bool:
        """Whether a stop or a halt is not done yet."""
        return self.value.stop_owed or any(isinstance(order.operation, END_ORDERS) for order in self.value.pending)

    @property
    def goto_pending(self) -> bool:
        """Whether a goto was ordered that the mount has not acknowledged yet."""
        return bool(self.value.waiting_gotos)

    @property
    def wake_up_pending(self) -> bool:
        """Whether a wake-up was ordered that the mount has not acknowledged yet."""
        return any(isinstance(order.operation, op.Wake) for order in self.value.pending)


class MotionState(Struct, frozen=True):
    """The motions under way. ``slewing``: the mount reports a goto. ``hand_moves``: those by hand, by axis.
    ``end_pending``: a stop or a halt is not acknowledged yet. ``ordered_by_client``: clients ordered them, not the
    hand control.
    """

    slewing: bool
    hand_moves: Mapping[int, op.Move | op.MoveAxis]
    end_pending: bool = False
    ordered_by_client: bool = True

    @property
    def slews_by_itself(self) -> bool:
        """Whether the mount does a goto that no client ordered: from its hand control, or its own meridian flip."""
        return self.slewing and not self.ordered_by_client

    @property
    def any_motion(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return self.slewing or bool(self.hand_moves)


class Movement:
    """Reports the present motion, from the orders and the mount's last replies."""

    def __init__(self, wanted: WantedState, cache: ReadingsCache) -> None:
        self._wanted, self._ordered_by_client = wanted, False
        #: Whether the mount reports a goto.
        self.slewing = False
        cache.slewing_changed.connect(self._note_slewing)
        #: Loop time until which the mount counts as moved at its hand control or by itself; ``LimitWatch`` sets it.
        self.moved_by_others_until = -1e9

    @property
    def any_motion(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return bool(self._wanted.value.hand_moves) or self.slewing

    def _note_slewing(self, slewing: bool) -> None:
        self.slewing = slewing
        self._ordered_by_client = self.ordered_by_client

    @property
    def ordered_by_client(self) -> bool:
        """Whether a motion ordered by a client is under way.

        A goto counts until the reading that shows its end is stored, because its last position is read before that.
        """
        return not isinstance(self._wanted.value.motion, NoOrderedMove) or (self._ordered_by_client and self.slewing)

    def snapshot(self) -> MotionState:
        return MotionState(self.slewing, self._wanted.value.hand_moves, self._wanted.is_ending, self.ordered_by_client)
