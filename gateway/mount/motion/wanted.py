"""What is wanted of a mount: one frozen value, which also decides which of its orders comes next.

``pending`` holds the orders that are not carried out yet, ``motion`` the motion that the mount has acknowledged. Orders
change ``pending``, outcomes move them to ``motion`` (``changes.py``). Any other motion belongs to the person at the
mount, and the gateway wants nothing of it (``NotOrdered``). ``Movement`` reports which motions are under way by its
orders.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import END_ORDERS, GOTOS, axis_moved
from gateway.core.signals import Signal
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.site.pending_settings import IncomingSettings

#: The ranks of orders: ends (and what must precede motions), what an end interrupted, all other orders.
FIRST_RANK, RESUMED_RANK, USUAL_RANK = range(3)
#: How many repetitions of a halt go before all other orders, each within URGENT_REPEAT_WINDOW seconds of the last.
URGENT_REPEATS, URGENT_REPEAT_WINDOW = 1, 1.0
#: Seconds that an order waits at most while the mount accepts no commands, and seconds between two checks.
MAX_POSTPONEMENT, RECHECK_PERIOD = 15.0, 0.1
#: Seconds that a goto waits at most for a site or clock that was set before it, and an arrow for a setting on its way.
MAX_SETTINGS_WAIT, MAX_EXCHANGE_WAIT = 20.0, 1.0


class Postponement(NamedTuple):
    """Why an order is postponed: ``refusal`` is the fault after ``longest`` seconds; without a refusal it is carried
    out then.
    """

    longest: float
    refusal: Fault | None


class Arrow(Struct, frozen=True):
    """An arrow that waits for its turn. ``held``: for how many seconds, if it was already released.

    ``then_stop``: a full stop follows it at once. A tap of less than ``shortest`` seconds is added to the next tap.
    """

    held: float | None = None
    then_stop: bool = False
    shortest: float = 0.0


class Order(Struct, frozen=True):
    """An operation that a client or the gateway has ordered and that is not done.

    ``number`` is its sequence number, ``by`` the client's connection, ``since`` the loop time of its arrival, ``at``
    the time from which it is due, ``until`` the time at which the client stops waiting for the outcome. A ``follow_up``
    is the gateway's own order, ``urgent`` if it ends a motion, ``not_while_busy`` if it waits until the mount accepts
    commands.
    """

    number: int
    operation: op.Operation
    by: HostActivity | None = None
    rank: int = USUAL_RANK
    since: float = 0.0
    at: float = 0.0
    until: float = inf
    follow_up: bool = False
    urgent: bool = False
    not_while_busy: bool = False
    arrow: Arrow = Arrow()

    @property
    def held(self) -> float | None:
        """For how many seconds an arrow was held, if it was released before its motion has begun; else None."""
        return self.arrow.held

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
        """Whether it waits while the mount accepts no commands: a goto (the newest only), a tracking mode or rate.

        A retried end waits too, for as long as it takes. Motions by hand and pulses never wait, because they are no
        longer wanted by then. No order waits for a line that is down.
        """
        return self.not_while_busy or (
            isinstance(self.operation, (*GOTOS, op.SetTracking, op.TrackRate)) and not self.follow_up
        )

    @property
    def client_disconnected(self) -> bool:
        """Whether it is a goto whose client has disconnected: it is not begun any more."""
        return isinstance(self.operation, GOTOS) and self.by is not None and self.by.closed is not None

    def may_wait(self, now: float, longest: float = MAX_POSTPONEMENT) -> bool:
        """Whether it may wait longer; if not, it is refused while the client still waits for its outcome."""
        return self.not_while_busy or now < min(self.since + longest, self.until)

    def why_wait(self, now: float, occupied: bool, incoming: IncomingSettings) -> Postponement | None:
        """Return why it has to wait although it is due; None if it need not.

        A goto is judged by site and clock, so it waits until the mount has received the settings that were accepted
        before it.
        """
        if isinstance(self.operation, GOTOS) and not self.follow_up and (incoming.pending or incoming.unfinished):
            refusal = incoming.holds_up(now, occupied)
            if refusal is not None:
                return Postponement(MAX_SETTINGS_WAIT, refusal)
        if occupied and self.can_be_postponed:
            return Postponement(MAX_POSTPONEMENT, Busy())
        arrow = isinstance(self.operation, op.Move | op.MoveAxis)
        if arrow and incoming.sending and now < self.since + MAX_EXCHANGE_WAIT:
            return Postponement(MAX_EXCHANGE_WAIT, None)
        return None


class Halt(Order, frozen=True):
    """The order of a client, or of the gateway for it, to end the motion of an axis, or all gotos.

    ``overtakes``: it goes before pending orders. It ``repeats`` this number of equal halts; ``order_count`` is
    ``Wanted.order_count`` at its arrival. ``ends_tap``: the arrow was released earlier. ``unless`` is the number of a
    goto: once that goto has begun, this halt is void.
    """

    overtakes: bool = False
    repeats: int = 0
    order_count: int = 0
    ends_tap: bool = False
    unless: int = 0

    @property
    def keeps_repeating(self) -> bool:
        """Whether a client keeps repeating it: then it can wait for its turn."""
        return self.repeats > URGENT_REPEATS


class AxisMotion(Struct, frozen=True):
    """The motion by hand of an axis: its operation, the client's connection, its start, and degrees a second.

    It was ``asked`` for and ``sent`` at these loop times.
    """

    operation: op.Move | op.MoveAxis
    by: HostActivity | None
    since: float
    speed: float
    asked: float = 0.0
    sent: float = 0.0


class ByHand(Struct, frozen=True):
    """Motion by hand on one axis or both."""

    first: AxisMotion | None = None
    second: AxisMotion | None = None

    def __iter__(self) -> Iterator[tuple[int, AxisMotion]]:
        return ((axis, motion) for axis, motion in ((1, self.first), (2, self.second)) if motion is not None)


class Slew(Struct, frozen=True):
    """A goto of both axes: its operation as it was sent, the client's connection, and its start."""

    operation: op.Goto | op.GotoHorizontal | op.GotoAxes | op.Park | op.Home
    by: HostActivity | None
    since: float


class NotOrdered(Struct, frozen=True):
    """No motion by the gateway's orders: the mount tracks, rests, or is moved at its hand control."""


class FocusMotion(Struct, frozen=True):
    """A motion of the focuser; a stop of the mount leaves it alone."""

    by: HostActivity | None
    since: float


class GuidePulse(Struct, frozen=True):
    """A guide pulse on an axis, under way until this loop time."""

    axis: int
    until: float
    operation: op.Pulse | op.PulseAxis | None = None


class Tap(Struct, frozen=True):
    """A motion by hand whose arrow was released before it began: its axis, the client, and the time at
    which it ends.
    """

    axis: int
    by: HostActivity | None
    until: float


class PressedArrow(Struct, frozen=True):
    """An arrow of an axis that a host has pressed, and how many gotos had been ordered by then."""

    who: str
    axis: int
    gotos: int


class Halted(Struct, frozen=True):
    """A halt that is done: its loop time, ``Wanted.order_count`` at its arrival, and how many equal halts
    it repeated.
    """

    operation: op.Operation
    at: float
    order_count: int
    repeats: int


class Wanted(Struct, frozen=True):
    """``active`` is the number of the order that is being carried out, 0 for none.

    ``short_taps`` are taps that are too short for this mount, and are added to the next ones. ``stops`` and ``gotos``
    count the orders of these kinds so far, ``gotos_begun`` the gotos that the mount has acknowledged, ``motions_begun``
    its acknowledged motions of the first axis and of the second, ``order_count`` all orders that end nothing. A stop is
    ``owed`` until the mount has acknowledged it. ``homed``: the mount was sent home, and no order has moved it since.
    ``short`` is why the last goto ended before its goal, until the next order. Guide pulses wait for rest, but not
    beyond the loop time ``rests_by``.
    """

    motion: NotOrdered | Slew | ByHand = NotOrdered()
    focus: FocusMotion | None = None
    pending: tuple[Order, ...] = ()
    pulses: tuple[GuidePulse, ...] = ()
    pressed: tuple[PressedArrow, ...] = ()
    taps: tuple[Tap, ...] = ()
    short_taps: tuple[Order, ...] = ()
    halted: tuple[Halted, ...] = ()
    owed: bool = False
    homed: bool = False
    rests_by: float = 0.0
    active: int = 0
    stops: int = 0
    gotos: int = 0
    gotos_begun: int = 0
    motions_begun: tuple[int, int] = (0, 0)
    order_count: int = 0
    short: str = ""

    @property
    def by_hand(self) -> dict[int, op.Move | op.MoveAxis]:
        """The motions by hand, by axis."""
        motion, motions = self.motion, {}
        if isinstance(motion, ByHand):  # without a loop, because every position calls this a dozen times
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

        Ends come first, then orders that an end interrupted, then all other orders in the order of their arrival. A
        guide pulse waits for the pulse before it on its axis.
        """
        due = [order for order in self.pending if self.due_at(order) <= now]
        return min(due, key=lambda order: (order.rank, order.number), default=None)

    def next_moment(self) -> float | None:
        """Return the loop time at which the next order is due; None if every pending order waits for another."""
        moment = min((self.due_at(order) for order in self.pending), default=inf)
        return moment if moment < inf else None

    def due_at(self, order: Order) -> float:
        """Return the loop time from which an order may be carried out."""
        if self.taps and (axis := axis_moved(order.operation)) and any(tap.axis == axis for tap in self.taps):
            return inf
        axis = None if order.follow_up else order.pulse_axis
        if axis is None:
            return order.at
        return max((order.at, self.rests_by, *(pulse.until for pulse in self.pulses if pulse.axis == axis)))

    def postponed(self, order: Order, now: float) -> Wanted:
        pending = tuple(
            replace(other, at=now + RECHECK_PERIOD) if other.number == order.number else other for other in self.pending
        )
        return replace(self, pending=pending, active=0 if self.active == order.number else self.active)


class WantedState:
    """Holds ``value``, which all parts may read and only the reconciler replaces; ``changed`` is emitted then."""

    def __init__(self) -> None:
        self.value = Wanted()
        #: Who ordered the last stop, for who asks why a motion ended; empty if that is not known.
        self.stopped_by = ""
        self.changed: Signal[Wanted] = Signal()

    @property
    def by_hand(self) -> dict[int, op.Move | op.MoveAxis]:
        """The motions by hand, by axis."""
        return self.value.by_hand

    @property
    def axes(self) -> set[int]:
        return set(self.value.by_hand)

    @property
    def gotos(self) -> int:
        """A count that grows whenever a goto is ordered, and when it is under way."""
        return self.value.gotos + self.value.gotos_begun

    @property
    def owed(self) -> bool:
        """Whether the mount has not acknowledged a stop yet."""
        return self.value.owed

    @property
    def ending(self) -> bool:
        """Whether a stop or a halt is not done yet."""
        return self.value.owed or any(isinstance(order.operation, END_ORDERS) for order in self.value.pending)

    @property
    def goto_waits(self) -> bool:
        """Whether a goto was ordered that the mount has not acknowledged yet."""
        return bool(self.value.waiting_gotos)

    @property
    def waking(self) -> bool:
        """Whether a wake-up was ordered that the mount has not acknowledged yet."""
        return any(isinstance(order.operation, op.Wake) for order in self.value.pending)


class Moving(Struct, frozen=True):
    """The motions under way: ``slewing``: the mount reports a goto; ``by_hand`` is by axis; ``ending``: a stop or a
    halt was ordered and is not acknowledged; ``ordered``: a client ordered the motion, and not a person at the hand
    control.
    """

    slewing: bool
    by_hand: Mapping[int, op.Move | op.MoveAxis]
    ending: bool = False
    ordered: bool = True

    @property
    def slews_by_itself(self) -> bool:
        """Whether the mount does a goto that no client ordered: from its hand control, or a meridian flip
        of its own.
        """
        return self.slewing and not self.ordered

    @property
    def anything(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return self.slewing or bool(self.by_hand)


class Movement:
    """Reports the present motion, from the orders and the mount's last replies."""

    def __init__(self, wanted: WantedState, cache: ReadingsCache) -> None:
        self._wanted, self._ordered_by_client = wanted, False
        #: Whether the mount reports a goto.
        self.slewing = False
        cache.slews.connect(self._note_slewing)
        #: Until when it counts as moved at its own keys, or by itself; the limits' watch finds that.
        self.by_others_until = -1e9

    @property
    def anything(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return bool(self._wanted.value.by_hand) or self.slewing

    def _note_slewing(self, slewing: bool) -> None:
        self.slewing = slewing
        self._ordered_by_client = self.ordered

    @property
    def ordered(self) -> bool:
        """Whether a motion ordered by a client is under way.

        A goto counts until the reading that shows its end is stored, because its last position is read before that.
        """
        return not isinstance(self._wanted.value.motion, NotOrdered) or (self._ordered_by_client and self.slewing)

    def now(self) -> Moving:
        return Moving(self.slewing, self._wanted.value.by_hand, self._wanted.ending, self.ordered)
