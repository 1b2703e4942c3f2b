"""A listening port whose connections are a web server's, which is loaded when the first of them comes.

Loading it takes a quarter of a second that no start is to wait for. Whoever connects meanwhile is heard, and answered
when it is there.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol, cast

from msgspec import Struct

from gateway.transport.handler import Arrive, Listener
from gateway.transport.listening import SERVED, listen

#: Bytes of one connection that are kept until the server is there; no honest request is longer.
MOST = 16384


class WebServer(Protocol):
    """What answers: called once for every connection, it makes the one who talks to it."""

    def __call__(self) -> asyncio.Protocol: ...
    async def close(self) -> None: ...


class WebPort:
    """Open until it is closed; ``load`` makes the server."""

    def __init__(self, load: Callable[[], Awaitable[WebServer]]) -> None:
        self._load = load
        self._server: WebServer | None = None
        self._loading: asyncio.Task[WebServer] | None = None
        self._listening: asyncio.Server | None = None
        self.where = ""

    async def open(self, where: str) -> None:
        """Raises UserError."""
        self._listening, self.where = await listen(where, self.connection)

    def connection(self) -> asyncio.Protocol:
        """Who talks to a connection that has been accepted, here or elsewhere."""
        return _Waiting(self) if self._server is None else self._server()

    async def server(self) -> WebServer:
        """What answers, loaded once."""
        if self._loading is None:
            self._loading = asyncio.ensure_future(self._load())
        self._server = await asyncio.shield(self._loading)
        return self._server

    async def close(self) -> None:
        """Nobody is answered any more."""
        if self._listening is not None:
            self._listening.close()
        if self._loading is not None:
            if not self._loading.done():
                self._loading.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await (await self._loading).close()


class Elsewhere:
    """Open as long as that web server is."""

    where = SERVED

    async def close(self) -> None:
        """It is not ours."""


class _Waiting(asyncio.Protocol):
    """A connection that came before the server was loaded."""

    def __init__(self, port: WebPort) -> None:
        self._port = port
        self._heard = b""
        self._handing_over: asyncio.Task[None] | None = None
        self._gone = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._handing_over = asyncio.ensure_future(self._hand_over())

    def data_received(self, data: bytes) -> None:
        self._heard += data
        if len(self._heard) > MOST:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._gone = True

    async def _hand_over(self) -> None:
        server = await self._port.server()
        if self._gone or self._transport.is_closing():
            return
        talker = server()
        self._transport.set_protocol(talker)
        talker.connection_made(self._transport)
        if self._heard:
            talker.data_received(self._heard)


# --- what a protocol adds whose programs speak HTTP ----------------------------------------------------------------


class WebDevice(Struct, frozen=True):
    """One mount that is offered: how lines of its programs come in, and what it is called, now and later."""

    arrive: Arrive
    title: str


class Web(Protocol):
    """The face of a protocol towards HTTP: it turns requests into lines that the protocol's framing cuts, and back."""

    async def open_port(self, where: str, device: WebDevice, names: Sequence[str] = ()) -> Listener:
        """A port of its own. ``names`` are further names by which programs may call this computer. Raises UserError."""

    def add_routes(
        self, app: Any, devices: Sequence[WebDevice], names: Sequence[str], may_act: Callable[[Any], bool]
    ) -> Callable[[], None]:
        """Serve the devices as a part of an aiohttp application -> what ends that. ``may_act`` tells of a request
        whether it may do more than look and stop.
        """

    async def answer_discovery(self, places: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Let programs find these addresses and ports -> what ends that. Raises OSError."""
