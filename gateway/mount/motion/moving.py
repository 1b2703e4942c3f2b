"""What of ours moves the mount at this moment: a goto, its axes by hand, an end that is not done yet."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from gateway.core.operations import Move, MoveAxis, Slewing
from gateway.mount.motion.wanted import WantedState
from gateway.mount.readings.cache import ReadingsCache

ByHand = Mapping[int, Move | MoveAxis]


class Moving(Struct, frozen=True):
    """``by_hand`` is by axis; ``ending`` whether a stop or a halt was asked for and is not acknowledged."""

    slewing: bool
    by_hand: ByHand
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
        """Whether the mount is seen to carry out a goto."""
        return bool(self._cache.value(Slewing))

    @property
    def anything(self) -> bool:
        """Whether anything moves that a stop should end."""
        return bool(self._wanted.value.by_hand) or self.slewing

    def now(self) -> Moving:
        """All of it as a value."""
        return Moving(self.slewing, self._wanted.value.by_hand, self._wanted.ending)
