"""The interface between a port and the handlers of its connections."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from msgspec import Struct

#: Ends a connection after sending these last bytes; the other end gets time to read them.
HangUp = Callable[[bytes], None]
#: Takes over the open transport of a connection.
TakeOver = Callable[[asyncio.Transport], None]
#: Gives the transport of a connection to a ``TakeOver`` function; the connection's handler gets no more bytes.
HandOver = Callable[[TakeOver], None]
#: Writes to a connection, and returns how many bytes are still to be sent, None if unknown.
Write = Callable[[bytes], int | None]


class NewConnection(Struct, frozen=True):
    """A new connection, and the functions that its handler may call.

    ``hang_up`` ends the connection; it is set only for a connection from the network, where anyone may be at the other
    end. ``hand_over`` gives it to a new owner. ``change_baud`` sets the port's baud rate and returns the old rate.
    """

    name: str  # ``HOST:PORT`` of the client; the path or URL of a serial line
    host: str  # the host of the client; the address of a serial line's port
    write: Write
    hang_up: HangUp | None = None
    hand_over: HandOver | None = None
    change_baud: Callable[[int], int] | None = None

    @property
    def is_serial_line(self) -> bool:
        """Whether the connection is a serial line or a pseudo-terminal."""
        return self.host.removeprefix("pty:") == self.name


class ConnectionRefused(Exception):
    """Raised for a connection that is not served; the port closes it at once, without a reply."""


class ConnectionHandler(Protocol):
    @property
    def all_answered(self) -> bool:
        """Whether no command of this connection waits for its reply."""

    @property
    def feed(self) -> Callable[[bytes], None]:
        """The function that takes received bytes; it may change with every call."""

    def close(self) -> None: ...

    def peer_closed(self) -> None:
        """Note that the other end sends no more bytes, though it may still read."""


#: Called with a new connection; returns its handler. Raises ConnectionRefused.
Accept = Callable[[NewConnection], ConnectionHandler]


class Listener(Protocol):
    """Listens until it is closed; ``address`` is its address with the real port number."""

    address: str

    async def close(self) -> None: ...
