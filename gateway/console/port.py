"""The console's port, which listens from the start, and loads the web server at the first byte that anybody sends.

A connection is handed to the web server with its first bytes, and waits for it where it is not loaded yet. One that
sends nothing has to go as early as at the web server, and the places are shared as there.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import cast

from gateway.app.discovery.offer import web_address
from gateway.clients.any_protocol.web import Web
from gateway.system.file_limits import no_room
from gateway.transport.handler import Taker
from gateway.transport.room import Guest, Room

#: How many ports are tried after the first; connections that may wait; seconds that one may send nothing.
OTHERS, MOST, SILENT = 50, 256, 10.0


class ConsolePort:
    """Listens, from ``open`` to ``close``, and gives connections to ``web``. ``where`` is its address for a browser."""

    def __init__(self, web: Web) -> None:
        self.web, self.room = web, Room(MOST)
        self.host, self.port = "", 0
        self._server: asyncio.Server | None = None

    @property
    def where(self) -> str:
        """The address to enter in a browser on this computer."""
        return web_address(self.host, self.port)

    async def open(self, host: str, port: int) -> None:
        """Listen on a port, or on the next free one. Raises OSError."""
        loop = asyncio.get_running_loop()
        for attempt in range(OTHERS + 1):
            with contextlib.suppress(OSError) if port and attempt < OTHERS else contextlib.nullcontext():
                number = port + attempt if port else 0
                self._server = await loop.create_server(lambda: _Connection(self), host, number, backlog=128)
                break
        assert self._server is not None
        self.host, self.port = host, int(self._server.sockets[0].getsockname()[1])

    def close(self) -> None:
        """Listen no more; connections that the web server has are its own."""
        if self._server is not None:
            self._server.close()


class _Connection(asyncio.Protocol):
    """A connection until its first bytes are with the web server."""

    def __init__(self, port: ConsolePort) -> None:
        self._port = port
        self._guest: Guest | None = None
        self.sent = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        peer = transport.get_extra_info("peername") or ("?", 0)
        self._guest = None if no_room() else self._port.room.enter(str(peer[0]), self._transport.abort)
        if self._guest is None:
            self._transport.abort()
            return
        self._deadline = asyncio.get_running_loop().call_later(SILENT, self._transport.abort)

    def data_received(self, data: bytes) -> None:
        if self._guest is None:
            return
        first, self.sent = not self.sent, self.sent + data
        if first:
            self._deadline.cancel()
            self._port.web.enter(self)
        else:
            self._port.web.received_more(self)

    def hand_over(self, take: Taker) -> None:
        self._leave()
        take(self._transport)

    def hang_up(self, last: bytes) -> None:
        self._transport.write(last)
        self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._leave()

    def _leave(self) -> None:
        if self._guest is not None:
            self._deadline.cancel()
            self._port.room.leave(self._guest)
            self._port.web.leave(self)
            self._guest = None
