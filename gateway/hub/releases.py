"""Whose arrows are pressed: the release of one that was pressed before a goto belongs to that arrow, not to the goto.

Programs send the release of an arrow after a goto has taken its place. Every other halt of an axis during a goto is an
order to end it: to some programs the halts of all four arrows are the only stop there is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gateway.hub.dead_man import Life


class Pressed:
    """The axes that each host's programs have set moving by hand and not released, and the gotos asked for before."""

    def __init__(self) -> None:
        self._pressed: dict[tuple[str, int], int] = {}
        self._gotos = 0

    def goto(self) -> None:
        """A goto was asked for: what is pressed from now on is newer."""
        self._gotos += 1

    def press(self, axis: int, life: Life | None) -> None:
        """An arrow of this axis was pressed."""
        if life is not None:
            self._pressed[life.who, axis] = self._gotos

    def release(self, axis: int, life: Life | None) -> bool:
        """It was released -> whether this program had pressed it, and a goto was asked for since.

        Without a program it is the gateway that ends the axis: then nobody's arrow is pressed there any more.
        """
        if life is None:
            self._pressed = {key: gotos for key, gotos in self._pressed.items() if key[1] != axis}
            return False
        return self._pressed.pop((life.who, axis), self._gotos) < self._gotos

    def clear(self) -> None:
        """A stop has ended them all."""
        self._pressed.clear()
