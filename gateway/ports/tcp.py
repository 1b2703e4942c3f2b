"""A listening TCP port, and the connections it has accepted."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import cast

from gateway.errors import UserError
from gateway.ports.guest import Arrive, Guest

#: Unread replies a connection may pile up before it is given up.
SLOW_READER = 65536


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
        peer = stream.get_extra_info("peername") or ("?", 0)
        self._guest = self._port.arrive(f"{peer[0]}:{peer[1]}", str(peer[0]), stream.write)
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
    """A listening TCP port."""

    def __init__(self, arrive: Arrive) -> None:
        self.arrive = arrive
        self.connections: set[_Connection] = set()
        self.where = ""
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, where: str, arrive: Arrive) -> TcpPort:
        """``tcp://HOST:PORT``; without a host this computer only; port 0 takes any free one."""
        host, port = split_address(where)
        self = cls(arrive)
        try:
            self._server = await asyncio.get_running_loop().create_server(lambda: _Connection(self), host, port)
        except OSError as error:
            reason = "the port is in use" if "in use" in str(error) else error.strerror or str(error)
            if "assign requested" in str(error):
                reason = "this computer has no such address"
            raise UserError(f"cannot listen on {where}: {reason}") from None
        real = self._server.sockets[0].getsockname()
        shown = f"[{real[0]}]" if ":" in real[0] else real[0]
        self.where = f"tcp://{shown}:{real[1]}"
        return self

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for connection in list(self.connections):
                connection.abort()
            await asyncio.sleep(0)


def split_address(where: str) -> tuple[str, int]:
    """``tcp://HOST:PORT`` -> (host, port). Raises UserError."""
    host, colon, number = where.removeprefix("tcp://").rpartition(":")
    if number.lstrip("-").isdigit() and not 0 <= int(number) <= 65535:
        raise UserError(f"{where}: a port is a number from 0 (any free one) to 65535")
    if not colon or not number.isdigit():
        raise UserError(f"{where}: write tcp://HOST:PORT, for example tcp://127.0.0.1:4030")
    return host.strip("[]") or "127.0.0.1", int(number)
