"""A listening TCP port, and the connections it has accepted.

A connection whose other end has vanished without a word (a phone out of reach, a laptop asleep) is found out by the
system's keepalive within a minute, and closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import cast

from gateway.errors import UserError
from gateway.ports.guest import Arrive, Guest

#: Unread replies a connection may pile up before it is given up.
SLOW_READER = 65536
#: Ask after so many seconds of silence, again after so many, and give up after so many unanswered ones.
KEEPALIVE = (("TCP_KEEPIDLE", 30), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3))
#: Linux: sent replies that nobody confirms for so many milliseconds end a connection, too.
UNCONFIRMED = ("TCP_USER_TIMEOUT", 60_000)


class _Connection(asyncio.Protocol):
    """One TCP connection."""

    def __init__(self, port: TcpPort) -> None:
        self._port = port
        self._guest: Guest | None = None
        self._transport: asyncio.Transport | None = None
        self._feed: Callable[[bytes], None] = lambda data: None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        stream = cast(asyncio.Transport, transport)  # uvloop's own class does not derive from it
        self._transport = stream
        stream.set_write_buffer_limits(high=SLOW_READER)
        keep_alive(stream.get_extra_info("socket"))
        peer = stream.get_extra_info("peername") or ("?", 0)
        self._guest = self._port.arrive(f"{_in_brackets(str(peer[0]))}:{peer[1]}", str(peer[0]), stream.write)
        self._feed = self._guest.feed
        self._port.connections.add(self)

    def data_received(self, data: bytes) -> None:
        self._feed(data)

    def pause_writing(self) -> None:
        """The other side does not read: let it go rather than hold its replies for ever."""
        self.abort()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._port.connections.discard(self)
        if self._guest is not None:
            self._guest.close()


class TcpPort:
    """A listening TCP port; ``where`` names the real one."""

    def __init__(self, arrive: Arrive) -> None:
        self.arrive = arrive
        self.connections: set[_Connection] = set()
        self.where = ""
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, where: str, arrive: Arrive) -> TcpPort:
        """``SCHEME://HOST:PORT``; without a host this computer only; port 0 takes any free one. Raises UserError.

        The address ``[::]`` is every one of this computer, of both kinds.
        """
        host, port = split_address(where)
        self, loop = cls(arrive), asyncio.get_running_loop()
        try:
            if host == "::":
                both = socket.create_server((host, port), family=socket.AF_INET6, backlog=100,
                                            dualstack_ipv6=socket.has_dualstack_ipv6())
                self._server = await loop.create_server(lambda: _Connection(self), sock=both)
            else:
                self._server = await loop.create_server(lambda: _Connection(self), host, port)
        except OSError as error:
            reason = "the port is in use" if "in use" in str(error) else error.strerror or str(error)
            if "assign requested" in str(error):
                reason = "this computer has no such address"
            raise UserError(f"cannot listen on {where}: {reason}") from None
        real = self._server.sockets[0].getsockname()
        self.where = f"{where.partition('://')[0]}://{_in_brackets(real[0])}:{real[1]}"
        return self

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for connection in list(self.connections):
                connection.abort()
            await asyncio.sleep(0)


def keep_alive(stream: socket.socket) -> None:
    """Short answers at once, and an end to connections that have none any more, as far as the system can."""
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (*KEEPALIVE, UNCONFIRMED, ("TCP_NODELAY", 1)):
        if hasattr(socket, name):
            with contextlib.suppress(OSError):
                stream.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def split_address(where: str) -> tuple[str, int]:
    """``SCHEME://HOST:PORT`` -> (host, port). Raises UserError."""
    scheme, _, address = where.partition("://")
    host, colon, number = address.rpartition(":")
    if number.lstrip("-").isdigit() and not 0 <= int(number) <= 65535:
        raise UserError(f"{where}: a port is a number from 0 (any free one) to 65535")
    if not colon or not number.isdigit() or (":" in host and not (host.startswith("[") and host.endswith("]"))):
        raise UserError(f"{where}: write {scheme}://HOST:PORT, for example {scheme}://127.0.0.1:4030")
    return host.strip("[]") or "127.0.0.1", int(number)


def _in_brackets(host: str) -> str:
    return f"[{host}]" if ":" in host else host
