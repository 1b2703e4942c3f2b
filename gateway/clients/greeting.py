"""The first bytes of a network connection, held back while they may still be a stranger's greeting.

A complete, well-formed command never waits, even where a greeting could follow (``E`` may become ``EHLO``), so no reply
is late because of this. Halves of commands wait, and so does what is no command. No greeting contains a well-formed
command that does more than ask, so nothing a stranger sends is carried out. Once the sender is known, this is bypassed.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from gateway.clients.strangers import Greeting, Recogniser


class Piece(NamedTuple):
    """Bytes as they came, when (loop time), and how many stops there had been by then."""

    data: bytes
    at: float
    stops: int


class Beginning:
    """``commands`` matches all well-formed commands of the protocol ``own``, and what is passed over, that bytes begin
    with.
    """

    def __init__(self, commands: re.Pattern[bytes], own: str = "") -> None:
        self._commands = commands
        self._recogniser = Recogniser(own)
        self._waiting: list[Piece] = []
        #: Who it is, when it is a stranger.
        self.stranger: Greeting | None = None

    @property
    def waiting(self) -> bytes:
        """What was held back until now, because it may be a stranger's."""
        return b"".join(piece.data for piece in self._waiting)

    @property
    def over(self) -> bool:
        return self._recogniser.over

    def hear(self, piece: Piece) -> list[Piece]:
        """More bytes have come -> those that may go on to the mount's client now; none of a stranger."""
        self.stranger = self._recogniser.hear(piece.data)
        if self.stranger is not None:
            self._waiting.clear()
            return []
        self._waiting.append(piece)
        if self._recogniser.open:
            found = self._commands.match(self.waiting)
            return self._first(found.end() if found else 0)
        return self._first(sum(len(piece.data) for piece in self._waiting))

    def _first(self, count: int) -> list[Piece]:
        """Take so many bytes out of those that wait."""
        going: list[Piece] = []
        while count > 0:
            piece = self._waiting.pop(0)
            if len(piece.data) > count:
                self._waiting.insert(0, piece._replace(data=piece.data[count:]))
                piece = piece._replace(data=piece.data[:count])
            going.append(piece)
            count -= len(piece.data)
        return going
