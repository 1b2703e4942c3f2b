"""What of ours moves the mount at this moment: a goto, its axes by hand, an end that is not done yet."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from gateway.core.operations import Move, MoveAxis

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
