"""The console's web server: the page, its WebSocket, downloads of recordings and of their reports, metrics.

Every request passes the access checks first (``app/pages``). aiohttp is imported at the first byte for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from gateway.app.gateway import Gateway
from gateway.app.pages import Pages, from_own_page, guarded, same_token
from gateway.astro.catalog import supplied
from gateway.clients.access import Access
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.core.errors import UserError
from gateway.core.waiting import BackgroundTasks
from gateway.diagnostics.metrics import Metrics, missing
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.http_server import OTHER_NAME, HttpServer, addressed_here, local_address, turned_away
from gateway.transport.room import Guest, Room, Use
from gateway.transport.web_port import NONE

PAGE = Path(__file__).parent / "page"
#: The longest message of a page in bytes; how many pages may be open at a time; seconds between two heartbeats.
LONGEST, MOST_PAGES, HEARTBEAT = 16384, 64, 10.0


@cache
def page_files() -> Pages:
    """Return the files of the page. Reading them takes tens of milliseconds: first on a thread, where clients wait."""
    files = {path.relative_to(PAGE).as_posix(): path for path in PAGE.rglob("*")}
    return Pages(files | {f"data/{name}": supplied.file(name) for name in supplied.SHARED})


class Console:
    """The console's web server, from ``open`` to ``close``. Called for each connection, it returns its protocol."""

    def __init__(self, gateways: Sequence[Gateway], access: Access = Access(), pin: str = "",
                 names: Sequence[str] = (), ports: Mapping[int, Access] = MappingProxyType({}),
                 page: bool = True) -> None:  # fmt: skip
        """``ports``: access rules of surfaces whose ports pass HTTP connections on to the console, by port.

        Without the ``page`` only programs are served.
        """
        self._mounts = Mounts(gateways, pin)
        self._access, self._names, self._port_rules = access, tuple(names), ports
        self._with_page = page
        self._token = secrets.token_urlsafe(24)
        self._metrics = Metrics(gateways)
        self._pages: set[asyncio.Task[Any]] = set()
        self._room, self._ending = Room(MOST_PAGES), BackgroundTasks()
        self._server: HttpServer | None = None
        self._served: list[Callable[[], None]] = []

    async def open(self) -> None:
        """Make the server that is to serve the connections."""
        app = web.Application(middlewares=[guarded(self._refusal)], client_max_size=1024)
        self._served = self._serve_programs(app)
        await asyncio.sleep(0)  # each half takes milliseconds, and clients come between them
        app.add_routes([web.get("/{path:.*}", _no_page)] if not self._with_page else [
            web.get("/", self._index), web.get("/socket", self._socket), web.get("/metrics", self._metrics_text),
            web.get("/recording/{mount}/{name}", self._recording), web.get("/{path:.+}", page_files().file),
        ])  # fmt: skip
        self._server = await HttpServer.start(app)

    def _serve_programs(self, app: web.Application) -> list[Callable[[], None]]:
        """Serve clients of HTTP protocols at the same port. Return the functions that end this."""
        served = [gateway.served() for gateway in self._mounts.gateways]
        return [
            spec.web().add_routes(app, [one[name] for one in served], self._names, self._may_act)
            for name, spec in PROTOCOLS.items()
            if spec.web is not None and all(name in one for one in served)
        ]

    def __call__(self) -> asyncio.Protocol:
        assert self._server is not None
        return self._server()

    async def close(self) -> None:
        """Close all pages, which releases their direction keys, stop serving, and end running recordings."""
        for task in list(self._pages):
            task.cancel()
        if self._pages:
            await asyncio.wait(self._pages, timeout=1.0)
        for end in self._served:
            end()
        if self._server is not None:
            await self._server.close()
            self._server = None
        self._metrics.close()
        for recording in self._mounts.recordings:
            if recording.state is not None:
                await recording.end()

    # --- access -----------------------------------------------------------------------------------------------------

    def _refusal(self, request: web.Request) -> str:
        """Return why a request is refused; an empty string if it is served."""
        headers, logs = request.headers, [gateway.wire_log for gateway in self._mounts.gateways]
        if not self._access.admits(request.remote or ""):
            turned_away(request, "it is not in the console's allow", logs)
            return "This address is not in the console's allow list."
        if not addressed_here(request, self._names):
            turned_away(request, OTHER_NAME, logs)
            return "This gateway does not know that name; if it leads here, add it to names of [console] or a surface."
        if not from_own_page(headers, request.path):
            return "Only the console's own page may request this."
        return ""

    def _view_only(self, request: web.Request) -> bool:
        """Whether the client is view-only, by the console's rules or those of the port of the connection."""
        rules = [self._access, self._port_rules.get(local_address(request)[1], self._access)]
        return any(rule.is_read_only(request.remote or "") for rule in rules)

    def _may_act(self, request: web.Request) -> bool:
        return not self._mounts.pin and not self._view_only(request)

    # --- requests ---------------------------------------------------------------------------------------------------

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return await page_files().index(request, token=self._token, can="act" if self._may_act(request) else "look")

    async def _metrics_text(self, request: web.Request) -> web.StreamResponse:
        if (text := await self._metrics.text()) is None:
            raise web.HTTPNotImplemented(reason=missing())
        return web.Response(body=text, headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"})

    async def _recording(self, request: web.Request) -> web.StreamResponse:
        if not same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        mount, name = request.match_info["mount"], request.match_info["name"]
        recordings = self._mounts.recordings
        known = mount.isdecimal() and int(mount) < len(recordings)
        recorded = f"{name.removesuffix('.html')}.rec" if name.endswith(".html") else name
        path = recordings[int(mount)].file(recorded) if known else None
        if path is None:
            raise web.HTTPNotFound
        if name.endswith(".html"):
            try:
                path = await self._mounts.report(path)
            except UserError as error:
                return web.Response(status=409, text=str(error))
        return web.FileResponse(path, headers={"Content-Disposition": f'attachment; filename="{name}"'})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if not same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        host = request.remote or "?"
        ws = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=HEARTBEAT, compress=False)
        await ws.prepare(request)
        place = self._room.enter(host, lambda: self._ending.spawn(_full(ws)), Use.IDLE)
        if place is None:
            await _full(ws)
            return ws
        try:
            await self._converse(ws, request, host, place)
        finally:
            self._room.leave(place)
        return ws

    async def _converse(self, ws: web.WebSocketResponse, request: web.Request, host: str, place: Guest) -> None:
        """Serve a page until it disconnects."""
        session = PageSession(self._mounts, _Socket(ws, request), host, self._may_act(request))
        shown = asyncio.ensure_future(session.run())
        self._pages.add(shown)
        try:
            async for message in ws:
                if message.type in (WSMsgType.TEXT, WSMsgType.BINARY) and session.take(message.data):
                    self._room.mark(place, Use.IDLE)
                if shown.done():
                    break
        finally:
            shown.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await shown
            self._pages.discard(shown)


async def _full(ws: web.WebSocketResponse) -> None:
    """Close a page for which there is no place; it tries again much later."""
    await ws.close(code=WSCloseCode.TRY_AGAIN_LATER, drain=False)


async def _no_page(request: web.Request) -> web.StreamResponse:
    response = web.Response(status=404, text=NONE[1])
    response.force_close()
    return response


class _Socket:
    """aiohttp's WebSocket with the interface that a page session needs."""

    def __init__(self, ws: web.WebSocketResponse, request: web.Request) -> None:
        self._ws, self._transport = ws, request.transport
        raw = request.transport.get_extra_info("socket") if request.transport else None
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)  # to notice a stalled browser soon

    def waiting(self) -> int:
        if self._transport is None or self._transport.is_closing():
            return 0
        return int(self._transport.get_write_buffer_size())

    async def send(self, text: str) -> None:
        if self._ws.closed:
            raise ConnectionError("the page has disconnected")
        await self._ws.send_str(text)
