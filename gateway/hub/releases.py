"""Whose arrows are pressed: the release of one that was pressed before a goto belongs to that arrow, not to the goto.

Programs send the release of an arrow after a goto has taken its place. Every other halt of an axis during a goto is an
order to end it: to some programs the halts of all four arrows are the only stop there is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gateway.hub.dead_man import Life


class Pressed:
    """The axes that each host's programs have set moving by hand and not released."""

    def __init__(self) -> None:
        self._pressed: set[tuple[str, int]] = set()

    def press(self, axis: int, life: Life | None) -> None:
        """An arrow of this axis was pressed."""
        if life is not None:
            self._pressed.add((life.who, axis))

    def release(self, axis: int, life: Life | None) -> bool:
        """It was released -> whether this program had pressed it."""
        mine = life is not None and (life.who, axis) in self._pressed
        if life is not None:
            self._pressed.discard((life.who, axis))
        return mine

    def clear(self) -> None:
        """A stop has ended them all."""
        self._pressed.clear()
