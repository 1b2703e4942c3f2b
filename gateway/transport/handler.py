"""The interface between a port and the handlers of its connections."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

#: Ends a connection after sending these last bytes; the other end gets time to read them.
HangUp = Callable[[bytes], None]
#: Takes over a connection as it is; and how a handler gives it away, after which it gets no more bytes.
Taker = Callable[[asyncio.Transport], None]
HandOver = Callable[[Taker], None]


class ConnectionRefused(Exception):
    """A connection that is not served: it is closed at once, without a reply."""


class ConnectionHandler(Protocol):
    @property
    def ended(self) -> bool:
        """Whether the last bytes only ended motions without a reply, so that repeating them has no effect."""

    @property
    def answered(self) -> bool:
        """Whether all commands were answered that are answered at all."""

    @property
    def feed(self) -> Callable[[bytes], None]:
        """The function that takes received bytes; it may change with every call."""

    def close(self) -> None: ...

    def peer_closed(self) -> None:
        """The other end has closed: no more bytes will arrive, though it may still read."""

    def serial(self, change_rate: Callable[[int], int]) -> None:
        """The connection is a serial port; ``change_rate`` sets its baud rate and returns the previous one."""

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        """The connection is from the network, so anyone may be at the other end.

        ``hang_up`` ends it; ``hand_over``, if possible, gives it to another owner.
        """


#: Writes to a connection, and returns how many bytes are still to be sent, None if unknown.
Write = Callable[[bytes], int | None]
#: Called with (name, host, write) of a new connection; returns its handler.
Accept = Callable[[str, str, Write], ConnectionHandler]


class Listener(Protocol):
    """Listens until it is closed; ``where`` is its address with the real port number."""

    where: str

    async def close(self) -> None: ...
