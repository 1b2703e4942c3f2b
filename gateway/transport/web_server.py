"""The web server of a process, for connections of its own ports and those that other ports hand over.

It is loaded when its first byte arrives, because loading takes a quarter of a second, which would delay every start. A
connection ends if a request is incomplete ``REQUEST_TIMEOUT`` seconds after its first byte, if no request comes in that
time, or if it is idle for ``IDLE_TIMEOUT`` seconds. ``room.py`` limits the number of connections.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any, Protocol, cast

from msgspec import Struct

from gateway.core.wire_log import WireLog
from gateway.system.file_limits import no_room_reason
from gateway.transport.handler import Accept
from gateway.transport.listening import WEB_ADDRESS, listen
from gateway.transport.room import ConnectionQuota

#: Connections at a time. Seconds until a request must be complete; an idle connection ends; ``close`` ends answers.
MAX_CONNECTIONS, REQUEST_TIMEOUT, IDLE_TIMEOUT, CLOSE_TIMEOUT = 256, 10.0, 60.0, 0.5
#: Maximum number of bytes from a connection before the server is loaded: no legitimate request is longer.
MAX_EARLY_BYTES = 16384

NO_PAGE_RESPONSE = (
    "404 Not Found",
    "There is no console here: mount-gateway was started without one (--no-console).\n"
    "Telescope programs can use this port.\n",
)
BUSY_RESPONSE = (
    "503 Service Unavailable",
    "mount-gateway is starting, or has too many connections. Load this page again in a moment.\n",
)


class WebPort:
    """A port of the web server; without ``server``, a port that only receives connections from other ports."""

    def __init__(self, address: str = WEB_ADDRESS, server: asyncio.Server | None = None) -> None:
        self.address, self._server = address, server

    async def close(self) -> None:
        """Accept no more connections; those that are open belong to the web server."""
        if self._server is not None:
            self._server.close()


class WebServer:
    """Serves the aiohttp application of ``load_site`` until ``close``; without ``load_site``, refuses all requests."""

    def __init__(self, load_site: Callable[[], Awaitable[Any]] | None = None) -> None:
        self._load_site = load_site
        self._load_task: asyncio.Task[None] | None = None
        self._runner: Any = None
        self._ports: list[WebPort] = []
        self.quota = ConnectionQuota(MAX_CONNECTIONS)
        #: The address of the console, if it has a port of its own.
        self.address = ""

    async def listen(self, address: str, max_tries: int = 0) -> WebPort:
        """Open a port; if it is in use, try those after it, ``max_tries`` in all. Raises UserError."""
        server, real = await listen(address, lambda: HttpConnection(self), max_tries)
        self._ports.append(WebPort(real, server))
        return self._ports[-1]

    def take_over(self, transport: asyncio.Transport, received: bytes) -> None:
        """Take over a connection that was accepted elsewhere and has sent these bytes."""
        protocol = HttpConnection(self)
        transport.set_protocol(protocol)
        protocol.connection_made(transport)
        if received:
            protocol.data_received(received)

    def start_loading(self) -> asyncio.Task[None]:
        """Start to load the application, unless that was started before. Return the task that loads it."""
        if self._load_task is None:
            self._load_task = asyncio.ensure_future(self._start())
        return self._load_task

    async def _start(self) -> None:
        if self._load_site is None:
            return
        app = await self._load_site()
        from aiohttp import web

        app.middlewares.insert(0, web.middleware(_answer_whole_request))
        runner = web.AppRunner(
            app,
            access_log=None,
            handle_signals=False,
            shutdown_timeout=CLOSE_TIMEOUT,
            keepalive_timeout=IDLE_TIMEOUT,
            logger=web_log(),
        )
        await runner.setup()
        self._runner = runner

    def new_handler(self) -> asyncio.Protocol | None:
        """Return a new aiohttp handler for a connection; None if nothing is served, or the server is closed."""
        return self._runner.server() if self._runner is not None else None

    async def close(self) -> None:
        """Close the ports, stop answering, and close all connections."""
        for port in self._ports:
            await port.close()
        self._load_site = None
        if self._load_task is not None:
            self._load_task.cancel()
        runner, self._runner = self._runner, None
        if runner is not None:
            await runner.cleanup()


class HttpConnection(asyncio.Protocol):
    """A connection, before and while aiohttp serves it: limits the number of connections and the time of requests."""

    def __init__(self, server: WebServer) -> None:
        self._server = server
        self._aiohttp_handler: asyncio.Protocol | None = None
        self._host: str | None = None
        self._early_bytes = b""
        self._deadline_timer: asyncio.TimerHandle | None = None
        self._is_answering = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        host = str((transport.get_extra_info("peername") or ("?", 0))[0])
        if no_room_reason() or not self._server.quota.acquire(host):
            self._refuse(BUSY_RESPONSE)
            return
        self._host = host
        self._start_deadline()

    def data_received(self, data: bytes) -> None:
        if self._aiohttp_handler is not None:
            if self._deadline_timer is None and not self._is_answering:
                self._start_deadline()
            self._aiohttp_handler.data_received(data)
        elif self._host is not None:
            first, self._early_bytes = not self._early_bytes, self._early_bytes + data
            if first:
                self._server.start_loading().add_done_callback(self._on_loaded)
            if len(self._early_bytes) > MAX_EARLY_BYTES:
                self._refuse(BUSY_RESPONSE)

    def _on_loaded(self, load_task: asyncio.Task[None]) -> None:
        if self._host is None:
            return
        if not load_task.cancelled():
            load_task.result()  # the log shows our own faults, and this connection ends in a while
        inner = self._aiohttp_handler = self._server.new_handler()
        if inner is None:
            self._refuse(NO_PAGE_RESPONSE)
        else:
            inner.connection_made(self._transport)
            inner.data_received(self._early_bytes)

    def _start_deadline(self) -> None:
        """Start the timeout of the next request."""
        self._deadline_timer = asyncio.get_running_loop().call_later(REQUEST_TIMEOUT, self._on_deadline)

    def _on_deadline(self) -> None:
        if self._aiohttp_handler is None and self._early_bytes:
            self._refuse(BUSY_RESPONSE)
        else:
            self._transport.abort()

    @contextmanager
    def answering(self) -> Iterator[None]:
        """Suspend the timeout while a complete request is being answered."""
        self._stop_deadline()
        self._is_answering = True
        try:
            yield
        finally:
            self._is_answering = False

    def _refuse(self, response: tuple[str, str]) -> None:
        self._release_quota()
        self._transport.write(response_bytes(*response))
        self._transport.close()

    def eof_received(self) -> bool | None:
        return self._aiohttp_handler.eof_received() if self._aiohttp_handler is not None else None

    def pause_writing(self) -> None:
        if self._aiohttp_handler is not None:
            self._aiohttp_handler.pause_writing()

    def resume_writing(self) -> None:
        if self._aiohttp_handler is not None:
            self._aiohttp_handler.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        self._release_quota()
        if self._aiohttp_handler is not None:
            self._aiohttp_handler.connection_lost(exc)

    def _release_quota(self) -> None:
        self._stop_deadline()
        if self._host is not None:
            self._server.quota.release(self._host)
            self._host = None

    def _stop_deadline(self) -> None:
        if self._deadline_timer is not None:
            self._deadline_timer.cancel()
            self._deadline_timer = None


async def _answer_whole_request(request: Any, handler: Callable[[Any], Awaitable[Any]]) -> Any:
    """Answer a request after its whole body has arrived, because a part of it could mean something else."""
    connection = request.transport.get_protocol() if request.transport is not None else None
    await request.read()
    if not isinstance(connection, HttpConnection):
        raise ConnectionResetError("the client has left")
    with connection.answering():
        return await handler(request)


@cache
def web_log() -> logging.Logger:
    """Return the logger of the web server's own failures, which shows them on the terminal with their traceback.
    It leaves out requests that are not valid HTTP, and clients that leave before their request is whole.
    """
    from aiohttp.http_exceptions import HttpProcessingError

    log = logging.getLogger("gateway.web")
    log.addFilter(
        lambda record: not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError | ConnectionError))
    )
    return log


def response_bytes(status: str, text: str) -> bytes:
    """Return the bytes of a short answer, after which the connection ends."""
    body = text.encode()
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {len(body)}\r\n"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nRetry-After: 2\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body


# --- for protocols whose clients use HTTP ------------------------------------------------------------------------


class WebDevice(Struct, frozen=True):
    """A mount that HTTP clients can use: ``accept`` makes handlers for its clients, ``title`` is its name, and ``log``
    records refused requests. It is offered at its own ``port``; 0: at all ports that have no device of their own.
    """

    accept: Accept
    title: str
    log: WireLog
    port: int = 0


class WebProtocol(Protocol):
    """The HTTP side of a protocol: it converts requests to lines, and reply lines to responses."""

    def load_modules(self) -> None:
        """Import the modules that serve requests. This is slow, so call it on a thread before the first request."""

    def add_routes(self, app: Any, devices: Sequence[WebDevice]) -> None:
        """Add the devices to an aiohttp application."""

    async def answer_discovery(self, addresses: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Let clients discover these (address, port) pairs. Return a function that ends this. Raises OSError."""
