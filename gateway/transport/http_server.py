"""A web server, which answers the HTTP connections of its own ports and those that ``web_port.py`` hands over.

A request that is not whole ``WHOLE`` seconds after its first byte, body included, ends its connection, however it
trickles in; so does a connection that sends none. The places are shared as ``room.py`` says. Importing this module
imports aiohttp, which is slow.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from typing import cast

from aiohttp import HttpVersion11, web

from gateway.core.wire_log import WireLog
from gateway.system.file_limits import no_room
from gateway.system.own_names import known_host
from gateway.system.web_log import web_log
from gateway.transport.room import Guest, Room, Use

#: Seconds within which a request must arrive; connections at a time; seconds in which open requests may be answered at
#: the end.
WHOLE, MOST, END = 10.0, 256, 0.5


class HttpServer:
    """Serves an application, from ``start`` to ``close``. Called for each connection, it returns its protocol."""

    def __init__(self, runner: web.AppRunner) -> None:
        self._runner = runner
        self._ports: list[asyncio.Server] = []
        self.room = Room(MOST)

    @classmethod
    async def start(cls, app: web.Application) -> HttpServer:
        """Return a server that is ready to listen."""
        app.middlewares.insert(0, _answering)
        runner = web.AppRunner(app, access_log=None, handle_signals=False, shutdown_timeout=END, logger=web_log())
        await runner.setup()
        return cls(runner)

    def __call__(self) -> asyncio.Protocol:
        assert self._runner.server is not None
        return HttpConnection(self._runner.server(), self.room)

    async def listen(self, host: str, port: int) -> int:
        """Listen at an address and return the actual port. Raises OSError."""
        self._ports.append(await asyncio.get_running_loop().create_server(self, host, port, backlog=128))
        return int(self._ports[-1].sockets[0].getsockname()[1])

    async def close(self) -> None:
        """Stop answering and close all connections."""
        for port in self._ports:
            port.close()
        await self._runner.cleanup()


class HttpConnection(asyncio.Protocol):
    """Stands between a connection and aiohttp: it has a place in the room, and a deadline while a request arrives."""

    def __init__(self, inner: asyncio.Protocol, room: Room) -> None:
        self._inner, self._room = inner, room
        self._guest: Guest | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._answering = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        peer = transport.get_extra_info("peername") or ("?", 0)
        self._guest = None if no_room() else self._room.enter(str(peer[0]), self._transport.abort)
        if self._guest is None:
            self._inner = asyncio.Protocol()
            self._transport.abort()
            return
        self._inner.connection_made(transport)
        self._expect()

    def data_received(self, data: bytes) -> None:
        if self._guest is not None and self._guest.use is Use.IDLE:
            self._expect()
        self._inner.data_received(data)

    def _expect(self) -> None:
        """A request begins."""
        self._mark(Use.HALF_OPEN)
        self._deadline = asyncio.get_running_loop().call_later(WHOLE, self._transport.abort)

    async def answer(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Let a request be answered. Its body may arrive meanwhile, or still after the answer."""
        self._answering = True
        request.content.on_eof(self._whole)
        try:
            return await handler(request)
        finally:
            self._answering = False
            if self._deadline is None:
                self._mark(Use.IDLE)

    def _whole(self) -> None:
        """The request is there, with its body."""
        self._end_deadline()
        self._mark(Use.ANSWERED if self._answering else Use.IDLE)

    def _mark(self, use: Use) -> None:
        if self._guest is not None:
            self._room.mark(self._guest, use)

    def _end_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def eof_received(self) -> bool | None:
        return self._inner.eof_received()

    def pause_writing(self) -> None:
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        self._inner.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_deadline()
        if self._guest is not None:
            self._room.leave(self._guest)
        self._inner.connection_lost(exc)


Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@web.middleware
async def _answering(request: web.Request, handler: Handler) -> web.StreamResponse:
    connection = request.transport.get_protocol() if request.transport is not None else None
    assert isinstance(connection, HttpConnection)
    return await connection.answer(request, handler)


#: Why a request is refused that is not ``addressed_here``. The name itself is left out: many would hide all else.
OTHER_NAME = "it calls this computer by a name that is not in names"


def turned_away(request: web.Request, why: str, logs: Iterable[WireLog]) -> None:
    """Tell ``status`` and the log of each mount that a request is refused, in the log once per host."""
    host = request.remote or "?"
    for log in logs:
        log.turned_away(host, f"request from {host} over HTTP refused: {why}", host)


def addressed_here(request: web.Request, names: Iterable[str] = ()) -> bool:
    """Whether a request means this computer. Only programs leave out whom they mean, in HTTP/1.0; no browser does."""
    if "Host" not in request.headers and request.version < HttpVersion11:
        return True
    return known_host(request.headers.get("Host"), local_address(request)[0], names)


def local_address(request: web.Request) -> tuple[str, int]:
    """Return the local address and port of a request's connection."""
    local = request.transport.get_extra_info("sockname") if request.transport is not None else None
    return (str(local[0]), int(local[1])) if local else ("", 0)
