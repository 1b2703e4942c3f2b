"""The beginning of a connection from a network: bytes wait here while they may still be a stranger's greeting.

A well-formed command that is whole never waits, although more of a greeting may follow it (an ``E`` may become
``EHLO``): no answer that is due comes later for this. What waits are halves of commands, and what is none. A greeting
contains no well-formed command that does more than ask, so nothing that a stranger sends is carried out. Once it is
known who it is this is out of the way.
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
        """Whether it is known who it is."""
        return not self._recogniser.open

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
