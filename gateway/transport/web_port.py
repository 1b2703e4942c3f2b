"""A web server that is loaded at the first byte for it, for connections of its own port and of others.

Loading takes a quarter of a second, which would delay every start. Until then connections wait with what they have
sent, as many as at the server and for some seconds at most; one that is not served gets a short answer that says so.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol, cast

from msgspec import Struct

from gateway.core.wire_log import WireLog
from gateway.system.file_limits import no_room
from gateway.transport.handler import Accept, Listener
from gateway.transport.listening import SERVED, listen
from gateway.transport.room import Guest, Room

#: Connections that may wait, and bytes of each: no legitimate request is longer. Seconds that one may send nothing, and
#: that it waits for the server.
MOST, MAX_BYTES, SILENT, TIMEOUT = 256, 16384, 10.0, 5.0

NONE = (
    "404 Not Found",
    "There is no console here: mount-gateway was started without one (--no-console).\n"
    "Telescope programs can use this port.\n",
)
LATE = (
    "503 Service Unavailable",
    "mount-gateway is starting or waiting for its mount. Load this page again in a moment.\n",
)


class WebServer(Protocol):
    """Called once for every connection to create its protocol."""

    def __call__(self) -> asyncio.Protocol: ...
    async def close(self) -> None: ...


async def no_server() -> None:
    """Load nothing: there is no web server."""


class WebPort:
    """Serves connections, and from ``open`` on those of a port of its own, to ``close``; ``load`` loads the server."""

    def __init__(self, load: Callable[[], Awaitable[WebServer | None]] = no_server) -> None:
        self._load = load
        self.server: WebServer | None = None
        self._loading: asyncio.Task[None] | None = None
        self._listening: asyncio.Server | None = None
        self.room = Room(MOST)
        self.where = ""

    async def open(self, where: str, others: int = 0) -> None:
        """Open the port, or one of so many ``others`` after it that is free. Raises UserError."""
        self._listening, self.where = await listen(where, self.connection, others)

    def connection(self) -> asyncio.Protocol:
        """Return the protocol for a connection that was accepted, here or on another port."""
        return _Waiting(self) if self.server is None else self.server()

    def take(self, transport: asyncio.Transport, sent: bytes) -> None:
        """Take over a connection that was accepted elsewhere and has sent these bytes."""
        protocol = self.connection()
        transport.set_protocol(protocol)
        protocol.connection_made(transport)
        if sent:
            protocol.data_received(sent)

    def loading(self) -> asyncio.Task[None]:
        """Return the task that loads the server. It is loaded once."""
        if self._loading is None:
            self._loading = asyncio.ensure_future(self._keep())
        return self._loading

    async def _keep(self) -> None:
        self.server = await self._load()

    async def close(self) -> None:
        """Stop answering, close the port and the server."""
        self._load = no_server
        if self._listening is not None:
            self._listening.close()
        if self._loading is not None:
            self._loading.cancel()
        server, self.server = self.server, None
        if server is not None:
            await server.close()


class SharedWebPort:
    """Stands in for a port if another web server serves the requests."""

    where = SERVED

    async def close(self) -> None:
        """Leave the other web server open."""


class _Waiting(asyncio.Protocol):
    """A connection that arrived before the server was loaded."""

    def __init__(self, port: WebPort) -> None:
        self._port = port
        self._guest: Guest | None = None
        self._sent = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        peer = transport.get_extra_info("peername") or ("?", 0)
        self._guest = None if no_room() else self._port.room.enter(str(peer[0]), self._transport.abort)
        if self._guest is None:
            self._transport.abort()
        else:
            self._deadline = asyncio.get_running_loop().call_later(SILENT, self._transport.abort)

    def data_received(self, data: bytes) -> None:
        if self._guest is None:
            return
        first, self._sent = not self._sent, self._sent + data
        if first:
            self._deadline.cancel()
            self._deadline = asyncio.get_running_loop().call_later(TIMEOUT, self._hang_up, LATE)
            self._port.loading().add_done_callback(self._loaded)
        elif len(self._sent) > MAX_BYTES:
            self._hang_up(LATE)

    def _loaded(self, loading: asyncio.Task[None]) -> None:
        if self._guest is None:
            return
        if not loading.cancelled():
            loading.result()  # a fault of ours is told in the log, and this connection gives up in a while
        if self._port.server is None:
            self._hang_up(NONE)
        else:
            self._leave()
            self._port.take(self._transport, self._sent)

    def _hang_up(self, answer: tuple[str, str]) -> None:
        self._leave()
        self._transport.write(answer_of(*answer))
        self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._leave()

    def _leave(self) -> None:
        if self._guest is not None:
            self._deadline.cancel()
            self._port.room.leave(self._guest)
            self._guest = None


def answer_of(status: str, words: str) -> bytes:
    """Return the bytes of a short answer, after which the connection ends."""
    body = words.encode()
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {len(body)}\r\n"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nRetry-After: 2\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body


# --- for protocols whose clients use HTTP ------------------------------------------------------------------------


class WebDevice(Struct, frozen=True):
    """One mount that is offered: ``accept`` makes handlers for its clients, ``title`` is its name, and ``log`` is told
    whose requests are refused."""

    accept: Accept
    title: str
    log: WireLog


class Web(Protocol):
    """What a protocol offers over HTTP: it converts requests to lines for the protocol's framing, and replies back."""

    def load(self) -> None:
        """Import what serves the requests: slow, so call it on a thread before the first of them."""

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
