"""The console's web server: its page, the page's WebSocket, and recordings to fetch.

Whatever comes in passes the gate first (``gate.py``). aiohttp is loaded when the surfaces are ready, not before.
"""

from __future__ import annotations

import asyncio
import contextlib
import html
import secrets
import socket
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from aiohttp import WSMsgType, web

from gateway.app.gateway import Gateway
from gateway.clients.access import Access
from gateway.console import gate
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.diagnostics.metrics.exposition import Metrics, missing
from gateway.protocols.registry import PROTOCOLS
from gateway.system.web_log import web_log

PAGE = Path(__file__).parent / "page"
#: What the page consists of, by ending.
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".json": "application/json",
         ".svg": "image/svg+xml", ".webmanifest": "application/manifest+json", ".png": "image/png"}  # fmt: skip
#: The longest message of a page in bytes; pages that may be open at a time; seconds between two heartbeats.
LONGEST, MOST_PAGES, HEARTBEAT = 16384, 64, 10.0
#: Ports that are tried after the first.
OTHERS = 50

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Console:
    """Serves until it is closed. ``where`` is its address for a browser, once it is open."""

    def __init__(self, gateways: Sequence[Gateway], access: Access = Access(), pin: str = "",
                 names: Sequence[str] = (), doors: Mapping[int, Access] = MappingProxyType({})) -> None:  # fmt: skip
        """``doors`` are the ports of others where connections to the console come in, too, with their rules."""
        self._mounts = Mounts(gateways, pin)
        self._access, self._names, self._doors = access, tuple(names), doors
        self._token = secrets.token_urlsafe(24)
        self._files = _files()
        self._metrics = Metrics(gateways)
        self._pages: set[asyncio.Task[Any]] = set()
        self._runner: web.AppRunner | None = None
        self._served: list[Callable[[], None]] = []
        self.host, self.port = "", 0

    @property
    def where(self) -> str:
        """What to type into a browser on this computer."""
        host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(
            self.host, f"[{self.host}]" if ":" in self.host else self.host
        )
        return f"http://{host}:{self.port}/"

    async def open(self, host: str, port: int, others: int = OTHERS) -> None:
        """Listen on a port, or on the next free one of ``others``. Raises OSError."""
        app = web.Application(middlewares=[self._gate()], client_max_size=1024)
        self._served = self._serve_programs(app)
        app.add_routes([
            web.get("/", self._index), web.get("/socket", self._socket), web.get("/metrics", self._figures),
            web.get("/recording/{mount}/{name}", self._recording), web.get("/{path:.+}", self._file),
        ])  # fmt: skip
        self._runner = web.AppRunner(app, access_log=None, handle_signals=False, shutdown_timeout=0.5, logger=web_log())
        await self._runner.setup()
        for attempt in range(others + 1):
            try:
                site = web.TCPSite(self._runner, host, port + attempt if port else 0, backlog=128)
                await site.start()
                break
            except OSError:
                if attempt == others or not port:
                    await self.close()
                    raise
        assert site._server is not None
        self.host, self.port = host, int(site._server.sockets[0].getsockname()[1])  # type: ignore[attr-defined]

    def _serve_programs(self, app: web.Application) -> list[Callable[[], None]]:
        """Programs that speak HTTP are answered at the same port -> what ends that."""
        served = [gateway.served() for gateway in self._mounts.gateways]
        return [
            spec.web().add_routes(app, [one[name] for one in served], self._names, self._acts)
            for name, spec in PROTOCOLS.items()
            if spec.web is not None and all(name in one for one in served)
        ]

    def serve(self, transport: asyncio.Transport, data: bytes) -> None:
        """Take over a connection that came in elsewhere, and of which these bytes have been read."""
        assert self._runner is not None and self._runner.server is not None
        protocol = self._runner.server()
        transport.set_protocol(protocol)
        protocol.connection_made(transport)
        protocol.data_received(data)

    async def close(self) -> None:
        """Nobody is shown anything any more; what pages held down is let go."""
        for task in list(self._pages):
            task.cancel()
        if self._pages:
            await asyncio.wait(self._pages, timeout=1.0)
        for end in self._served:
            end()
        if self._runner is not None:
            await self._runner.cleanup()
            self._runner = None
        self._metrics.close()
        for recording in self._mounts.recordings:
            if recording.state is not None:
                recording.end()

    # --- the gate ---------------------------------------------------------------------------------------------------

    def _gate(self) -> Any:
        @web.middleware
        async def admit(request: web.Request, handler: Handler) -> web.StreamResponse:
            local = request.transport.get_extra_info("sockname") if request.transport else None
            refused = self._refused(request, str(local[0]) if local else "")
            if refused:
                response: web.StreamResponse = web.Response(status=403, text=f"{refused}\n")
            else:
                try:
                    response = await handler(request)
                except web.HTTPException as error:
                    response = web.Response(status=error.status, text=f"{error.reason}\n")
            if not response.prepared:
                response.headers.update(gate.HEADERS)
            return response

        return admit

    def _refused(self, request: web.Request, local: str) -> str:
        """Why a request is not served; nothing where it is."""
        headers = request.headers
        if not self._access.admits(request.remote or ""):
            return "This address is not in the console's allow list."
        if not gate.known_host(headers.get("Host"), local, self._names):
            return "This gateway is not called that; add the name to [console] names if it is."
        if not gate.same_origin(headers.get("Origin"), headers.get("Host")):
            return "Only the console's own page may ask for this."
        if request.path != "/" and gate.from_elsewhere(headers):
            return "Only the console's own page may ask for this."
        return ""

    def _only_looks(self, request: web.Request) -> bool:
        """Whether whoever asks may change nothing: here, or at the port where the request has come in."""
        local = request.transport.get_extra_info("sockname") if request.transport else None
        rules = [self._access, *([self._doors[local[1]]] if local and local[1] in self._doors else [])]
        return any(rule.only_looks(request.remote or "") for rule in rules)

    def _acts(self, request: web.Request) -> bool:
        return not self._mounts.pin and not self._only_looks(request)

    # --- what is served ---------------------------------------------------------------------------------------------

    async def _index(self, request: web.Request) -> web.StreamResponse:
        body, kind = self._files["index.html"]
        can = "act" if self._acts(request) else "look"
        filled = body.replace(b"{{token}}", html.escape(self._token).encode()).replace(b"{{can}}", can.encode())
        return web.Response(body=filled, content_type=kind, charset="utf-8", headers={"Cache-Control": "no-store"})

    async def _file(self, request: web.Request) -> web.StreamResponse:
        found = self._files.get(request.match_info["path"])
        if found is None:
            raise web.HTTPNotFound
        body, kind = found
        return web.Response(body=body, content_type=kind, charset="utf-8", headers={"Cache-Control": "no-cache"})

    async def _figures(self, request: web.Request) -> web.StreamResponse:
        if (text := await self._metrics.text()) is None:
            raise web.HTTPNotImplemented(reason=missing())
        return web.Response(body=text, headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"})

    async def _recording(self, request: web.Request) -> web.StreamResponse:
        if not gate.same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        mount, name = request.match_info["mount"], request.match_info["name"]
        recordings = self._mounts.recordings
        path = recordings[int(mount)].file(name) if mount.isdecimal() and int(mount) < len(recordings) else None
        if path is None:
            raise web.HTTPNotFound
        return web.FileResponse(path, headers={"Content-Disposition": f'attachment; filename="{name}"'})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if not gate.same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(reason=f"{MOST_PAGES} pages are open already")
        ws = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=HEARTBEAT, compress=False)
        await ws.prepare(request)
        host = request.remote or "?"
        session = PageSession(self._mounts, _Socket(ws, request), host, self._acts(request))
        shown = asyncio.ensure_future(session.run())
        self._pages.add(shown)
        try:
            async for message in ws:
                if message.type in (WSMsgType.TEXT, WSMsgType.BINARY):
                    session.take(message.data)
                if shown.done():
                    break
        finally:
            shown.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await shown
            self._pages.discard(shown)
        return ws


class _Socket:
    """aiohttp's WebSocket, as a page session sees it."""

    def __init__(self, ws: web.WebSocketResponse, request: web.Request) -> None:
        self._ws, self._transport = ws, request.transport
        raw = request.transport.get_extra_info("socket") if request.transport else None
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)  # a stalled browser is noticed soon

    def waiting(self) -> int:
        if self._transport is None or self._transport.is_closing():
            return 0
        return int(self._transport.get_write_buffer_size())

    async def send(self, text: str) -> None:
        if self._ws.closed:
            raise ConnectionError("the page is gone")
        await self._ws.send_str(text)


def _files() -> dict[str, tuple[bytes, str]]:
    """The page's files by path, read once: what is not among them is not served, whatever a path may say."""
    return {
        path.relative_to(PAGE).as_posix(): (path.read_bytes(), TYPES[path.suffix])
        for path in sorted(PAGE.rglob("*"))
        if path.is_file() and path.suffix in TYPES
    }
