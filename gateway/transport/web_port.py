"""A listening port of a web server, which is loaded for the first connection.

Loading takes a quarter of a second, which would delay every start. Until then connections wait.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol, cast

from msgspec import Struct

from gateway.transport.handler import Accept, Listener
from gateway.transport.listening import SERVED, listen

#: Bytes of one connection that are kept until the server is loaded; no legitimate request is longer.
MAX_BYTES = 16384


class WebServer(Protocol):
    """Called once for every connection to create its protocol."""

    def __call__(self) -> asyncio.Protocol: ...
    async def close(self) -> None: ...


class WebPort:
    """Listens from ``open`` to ``close``; ``load`` loads the server."""

    def __init__(self, load: Callable[[], Awaitable[WebServer]]) -> None:
        self._load = load
        self._server: WebServer | None = None
        self._loading: asyncio.Task[WebServer] | None = None
        self._listening: asyncio.Server | None = None
        self.where = ""

    async def open(self, where: str) -> None:
        """Open the port. Raises UserError."""
        self._listening, self.where = await listen(where, self.connection)

    def connection(self) -> asyncio.Protocol:
        """Return the protocol for a connection that was accepted, here or on another port."""
        return _Waiting(self) if self._server is None else self._server()

    async def server(self) -> WebServer:
        """Return the server. It is loaded once."""
        if self._loading is None:
            self._loading = asyncio.ensure_future(self._load())
        self._server = await asyncio.shield(self._loading)
        return self._server

    async def close(self) -> None:
        """Stop answering, close the port and the server."""
        if self._listening is not None:
            self._listening.close()
        if self._loading is not None:
            if not self._loading.done():
                self._loading.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await (await self._loading).close()


class SharedWebPort:
    """Stands in for a port if another web server serves the requests."""

    where = SERVED

    async def close(self) -> None:
        """Leave the other web server open."""


class _Waiting(asyncio.Protocol):
    """A connection that arrived before the server was loaded."""

    def __init__(self, port: WebPort) -> None:
        self._port = port
        self._received = b""
        self._handing_over: asyncio.Task[None] | None = None
        self._disconnected = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._handing_over = asyncio.ensure_future(self._hand_over())

    def data_received(self, data: bytes) -> None:
        self._received += data
        if len(self._received) > MAX_BYTES:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._disconnected = True

    async def _hand_over(self) -> None:
        server = await self._port.server()
        if self._disconnected or self._transport.is_closing():
            return
        protocol = server()
        self._transport.set_protocol(protocol)
        protocol.connection_made(self._transport)
        if self._received:
            protocol.data_received(self._received)


# --- for protocols whose clients use HTTP ------------------------------------------------------------------------


class WebDevice(Struct, frozen=True):
    """One mount that is offered: ``accept`` makes handlers for its clients, ``title`` is its name."""

    accept: Accept
    title: str


class Web(Protocol):
    """What a protocol offers over HTTP: it converts requests to lines for the protocol's framing, and replies back."""

    async def open_port(self, where: str, device: WebDevice, names: Sequence[str] = ()) -> Listener:
        """Open a port. ``names`` are further host names by which clients may call this computer. Raises UserError."""

    def add_routes(
        self, app: Any, devices: Sequence[WebDevice], names: Sequence[str], may_act: Callable[[Any], bool]
    ) -> Callable[[], None]:
        """Add the devices to an aiohttp application. Return a function that removes them.

        ``may_act`` returns whether a request may do more than read and stop.
        """

    async def answer_discovery(self, places: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Let clients discover these addresses and ports. Return a function that ends this. Raises OSError."""
