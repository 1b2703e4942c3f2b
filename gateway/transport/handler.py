"""What a port and the handler of a connection know of each other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

#: Ends a connection: these bytes are the last, and the other side is given the time to read them.
HangUp = Callable[[bytes], None]
#: Who takes a connection over as it is, and how a handler leaves it to them: nothing more of it is heard here.
Taker = Callable[[asyncio.Transport], None]
HandOver = Callable[[Taker], None]


class ConnectionRefused(Exception):
    """A connection that is not served: it is closed at once and told nothing."""


class ConnectionHandler(Protocol):
    @property
    def ended(self) -> bool:
        """Whether the last bytes did nothing but end motions without a reply: the same again would be no news."""

    @property
    def answered(self) -> bool:
        """Whether everything that was fed has been answered, as far as it is answered at all."""

    @property
    def feed(self) -> Callable[[bytes], None]:
        """What bytes are given to; it may be another function after every call."""

    def close(self) -> None: ...

    def gone(self) -> None:
        """The other side has closed its end: nothing more will come of it, though it may still read."""

    def serial(self, change_rate: Callable[[int], int]) -> None:
        """The connection is a serial port: how to set its baud rate; the one it had is returned."""

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        """The connection came over a network, where anybody may be at the other end: how to end it, and how to leave
        it to somebody else, where that is possible."""


#: How to write to a connection: whoever writes is told how many bytes still wait to be sent, or None where that is
#: not known.
Write = Callable[[bytes], int | None]
#: (who it is, the host it comes from, how to write to it) -> its handler.
Arrive = Callable[[str, str, Write], ConnectionHandler]


class Listener(Protocol):
    """Something that is open until it is closed; ``where`` is its name with the real numbers in it."""

    where: str

    async def close(self) -> None: ...
