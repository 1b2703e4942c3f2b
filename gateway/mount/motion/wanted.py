"""What is wanted of a mount: one frozen value, replaced as a whole by ``apply`` and by nothing else; what of it moves.

``pending`` holds what was asked for and not carried out yet, ``motion`` what the mount was told and has acknowledged.
Orders change the first, outcomes move them to the second; what moves otherwise than it was told belongs to the person
beside the mount, and nobody here wants anything of it (``Theirs``). ``Movement`` tells what of ours moves at a moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.motion_kinds import ENDS, GOTOS
from gateway.core.signals import Signal
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import ReadingsCache

#: What ends a motion, or must come before it; what was interrupted for that; everything else.
FIRST, RESUMED, IN_ORDER = range(3)
#: So many repetitions of a halt in a row go before everything else, each within so many seconds of the one before.
AT_ONCE, AGAIN = 1, 1.0


class Order(Struct, frozen=True):
    """Something that was asked for and is not done.

    ``number`` counts the orders, ``by`` is the connection it came from, ``since`` the loop time at which it came,
    ``at`` the one before which it is not due, ``until`` the one after which nobody is told any more what came of it. A
    ``follow_up`` is the gateway's own, and ``urgent`` when it ends a motion; one that is to be ``heard`` waits until
    the mount hears. ``unless`` is the number of a goto after whose beginning it is void. Of a halt it is known whether
    it ``overtakes`` what waits, and the ``repeats`` of an equal one before it while nothing else was asked for
    (``asked`` counts that).
    """

    number: int
    operation: op.Operation
    by: HostActivity | None = None
    rank: int = IN_ORDER
    since: float = 0.0
    at: float = 0.0
    until: float = inf
    follow_up: bool = False
    urgent: bool = False
    heard: bool = False
    unless: int = 0
    overtakes: bool = False
    repeats: int = 0
    asked: int = 0

    @property
    def hammered(self) -> bool:
        """Whether it is a halt that comes again and again, and can wait for its turn."""
        return self.repeats > AT_ONCE


class AxisMotion(Struct, frozen=True):
    """One axis moves by hand: as told, by whom, since when, and how fast, degrees a second."""

    operation: op.Move | op.MoveAxis
    by: HostActivity | None
    since: float
    speed: float


class ByHand(Struct, frozen=True):
    """Motion by hand on one axis or both."""

    first: AxisMotion | None = None
    second: AxisMotion | None = None

    def __iter__(self) -> Iterator[tuple[int, AxisMotion]]:
        return ((axis, motion) for axis, motion in ((1, self.first), (2, self.second)) if motion is not None)


class Slew(Struct, frozen=True):
    """A goto with both of its axes: as it was sent, by whom, since when."""

    operation: op.Goto | op.GotoHorizontal | op.GotoAxes | op.Park | op.Home
    by: HostActivity | None
    since: float


class Theirs(Struct, frozen=True):
    """Nobody here wants anything: what moves, moves by somebody else's hand, or tracks."""


class FocusMotion(Struct, frozen=True):
    """The focuser moves; a stop of the mount leaves it alone."""

    by: HostActivity | None
    since: float


class GuidePulse(Struct, frozen=True):
    """A guide pulse under way on an axis, until this loop time."""

    axis: int
    until: float


class Press(Struct, frozen=True):
    """A host's arrow on an axis is pressed; how many gotos had been asked for then."""

    who: str
    axis: int
    gotos: int


class Halted(Struct, frozen=True):
    """A halt that is done: when, how much had been asked for, how many equal ones were done before it."""

    operation: op.Operation
    at: float
    asked: int
    repeats: int


class Wanted(Struct, frozen=True):
    """``active`` is the number of the order that is being carried out, 0 for none.

    ``stops`` and ``gotos`` count those asked for so far, ``slews`` the gotos that the mount has acknowledged, ``asked``
    whatever ends nothing. A stop is ``owed`` until the mount has acknowledged it. It is ``homed`` where it was sent
    home last, and nothing here has moved it since.
    """

    motion: Theirs | Slew | ByHand = Theirs()
    focus: FocusMotion | None = None
    pending: tuple[Order, ...] = ()
    pulses: tuple[GuidePulse, ...] = ()
    pressed: tuple[Press, ...] = ()
    halted: tuple[Halted, ...] = ()
    owed: bool = False
    homed: bool = False
    active: int = 0
    stops: int = 0
    gotos: int = 0
    slews: int = 0
    asked: int = 0

    @property
    def by_hand(self) -> dict[int, op.Move | op.MoveAxis]:
        """What moves by hand, axis by axis."""
        motion, found = self.motion, {}
        if isinstance(motion, ByHand):  # written out: it is asked for a dozen times with every look at the mount
            if motion.first is not None:
                found[1] = motion.first.operation
            if motion.second is not None:
                found[2] = motion.second.operation
        return found

    @property
    def waiting_gotos(self) -> list[Order]:
        """The gotos that were asked for and that the mount has not acknowledged."""
        return [order for order in self.pending if isinstance(order.operation, GOTOS)]


class WantedState:
    """The one place where it is kept: ``value``, which everybody may read and the reconciler alone replaces.

    ``changed`` tells that it did.
    """

    def __init__(self) -> None:
        self.value = Wanted()
        self.changed: Signal[Wanted] = Signal()

    @property
    def by_hand(self) -> dict[int, op.Move | op.MoveAxis]:
        """What moves by hand, axis by axis."""
        return self.value.by_hand

    @property
    def axes(self) -> set[int]:
        return set(self.value.by_hand)

    @property
    def gotos(self) -> int:
        """Grows whenever a goto was asked for, and when it is under way."""
        return self.value.gotos + self.value.slews

    @property
    def owed(self) -> bool:
        """Whether the mount has a stop to come that it has not acknowledged."""
        return self.value.owed

    @property
    def ending(self) -> bool:
        """Whether a stop or a halt is not done yet."""
        return self.value.owed or any(isinstance(order.operation, ENDS) for order in self.value.pending)

    @property
    def goto_waits(self) -> bool:
        """Whether a goto was asked for that the mount has not acknowledged yet."""
        return bool(self.value.waiting_gotos)

    @property
    def waking(self) -> bool:
        """Whether the mount was asked to wake, and has not acknowledged it yet."""
        return any(isinstance(order.operation, op.Wake) for order in self.value.pending)


class Moving(Struct, frozen=True):
    """``by_hand`` is by axis; ``ending`` whether a stop or a halt was asked for and is not acknowledged."""

    slewing: bool
    by_hand: Mapping[int, op.Move | op.MoveAxis]
    ending: bool = False

    @property
    def anything(self) -> bool:
        """Whether there is anything that a stop should end."""
        return self.slewing or bool(self.by_hand)


class Movement:
    """Tells it, from what is wanted and from what the mount has said last."""

    def __init__(self, wanted: WantedState, cache: ReadingsCache) -> None:
        self._wanted, self._cache = wanted, cache

    @property
    def slewing(self) -> bool:
        return bool(self._cache.value(op.Slewing))

    @property
    def anything(self) -> bool:
        """Whether anything moves that a stop should end."""
        return bool(self._wanted.value.by_hand) or self.slewing

    def now(self) -> Moving:
        return Moving(self.slewing, self._wanted.value.by_hand, self._wanted.ending)
