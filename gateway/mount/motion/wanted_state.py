"""The one place where what is wanted of a mount is kept. The reconciler alone replaces it; everybody may read it."""

from __future__ import annotations

from gateway.core.motion_kinds import ENDS
from gateway.core.operations import Move, MoveAxis, Wake
from gateway.core.signals import Signal
from gateway.mount.motion.wanted import Wanted


class WantedState:
    """``value`` is what is wanted now; ``changed`` is emitted whenever it was replaced."""

    def __init__(self) -> None:
        self.value = Wanted()
        self.changed: Signal[Wanted] = Signal()

    def replace(self, wanted: Wanted) -> None:
        """For the reconciler."""
        self.value = wanted
        self.changed.emit(wanted)

    @property
    def by_hand(self) -> dict[int, Move | MoveAxis]:
        """What moves by hand, axis by axis."""
        return self.value.by_hand

    @property
    def axes(self) -> set[int]:
        """The axes that move by hand."""
        return set(self.value.by_hand)

    @property
    def stops(self) -> int:
        """How many stops there were: a motion that was asked for before the last one is not begun."""
        return self.value.stops

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
        return any(isinstance(order.operation, Wake) for order in self.value.pending)
