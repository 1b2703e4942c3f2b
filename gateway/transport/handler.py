"""The interface between a port and the handlers of its connections."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from msgspec import Struct

#: Ends a connection after sending these last bytes; the other end gets time to read them.
HangUp = Callable[[bytes], None]
#: Takes over a connection as it is; and how a handler gives it away, after which it gets no more bytes.
Taker = Callable[[asyncio.Transport], None]
HandOver = Callable[[Taker], None]
#: Writes to a connection, and returns how many bytes are still to be sent, None if unknown.
Write = Callable[[bytes], int | None]


class Connected(Struct, frozen=True):
    """A new connection, and the actions that its handler has.

    ``hang_up`` ends the connection; it is only set for a connection from the network, where anyone may be at the other
    end. ``hand_over``, if possible, gives it to another owner. ``change_rate`` sets and returns a port's baud rate.
    """

    name: str
    host: str
    write: Write
    hang_up: HangUp | None = None
    hand_over: HandOver | None = None
    change_rate: Callable[[int], int] | None = None

    @property
    def on_a_line(self) -> bool:
        """Whether the connection is a serial line or a pseudo-terminal."""
        return self.host.removeprefix("pty:") == self.name


class ConnectionRefused(Exception):
    """A connection that is not served: it is closed at once, without a reply."""


class ConnectionHandler(Protocol):
    @property
    def answered(self) -> bool:
        """Whether all commands were answered that are answered at all."""

    @property
    def feed(self) -> Callable[[bytes], None]:
        """The function that takes received bytes; it may change with every call."""

    def close(self) -> None: ...

    def peer_closed(self) -> None:
        """The other end has closed: no more bytes will arrive, though it may still read."""


#: Called with a new connection; returns its handler. Raises ConnectionRefused.
Accept = Callable[[Connected], ConnectionHandler]


class Listener(Protocol):
    """Listens until it is closed; ``where`` is its address with the real port number."""

    where: str

    async def close(self) -> None: ...
