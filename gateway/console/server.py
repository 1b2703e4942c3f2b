"""The console's part of the web server: the page and its WebSocket, recordings and reports to download, and metrics.

Every request passes the access checks first (``app/pages.py``).
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from gateway.app.gateway import Gateway
from gateway.app.pages import Pages, is_same_token, require_own_page, rules_of
from gateway.astro.catalog import supplied
from gateway.clients.access import AccessRules
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.core.errors import UserError
from gateway.diagnostics.metrics import Metrics, missing_package_text
from gateway.transport.http_requests import log_refused_request
from gateway.transport.room import ConnectionQuota

PAGE_FOLDER = Path(__file__).parent / "page"
#: The longest message of a page in bytes; how many pages may be open at a time; seconds between two heartbeats.
MAX_MESSAGE_BYTES, MAX_PAGES, HEARTBEAT_PERIOD = 16384, 64, 10.0


@cache
def page_files() -> Pages:
    """Return the files of the page. Reading them takes tens of milliseconds: call it on a thread if clients wait."""
    files = {path.relative_to(PAGE_FOLDER).as_posix(): path for path in PAGE_FOLDER.rglob("*")}
    return Pages(files | {f"data/{name}": supplied.sky_file(name) for name in supplied.PAGE_FILES})


class Console:
    """Serves the console of these gateways. A client's address must be admitted by ``access`` and its port's rules."""

    def __init__(self, gateways: Sequence[Gateway], access: AccessRules, pin: str) -> None:
        self._mounts, self._access = Mounts(gateways, pin), access
        self._token = secrets.token_urlsafe(24)
        self._metrics = Metrics(gateways)
        self._page_tasks: set[asyncio.Task[Any]] = set()
        self._page_quota = ConnectionQuota(MAX_PAGES)

    def add_to(self, app: web.Application) -> None:
        """Add the console's routes to an application."""
        app.add_routes([
            web.get(path, require_own_page(handler, self._refusal_reason)) for path, handler in (
                ("/", self._serve_index), ("/socket", self._open_page), ("/metrics", self._serve_metrics),
                ("/recording/{mount}/{name}", self._serve_recording), ("/{path:.+}", self._serve_file),
            )
        ])  # fmt: skip
        app.on_shutdown.append(self._close)

    async def _close(self, app: web.Application) -> None:
        """Close all pages, which releases their arrows, and end running recordings."""
        for task in list(self._page_tasks):
            task.cancel()
        if self._page_tasks:
            await asyncio.wait(self._page_tasks, timeout=1.0)
        self._metrics.close()
        for recording in self._mounts.recorders:
            if recording.state is not None:
                await recording.end()

    # --- access -----------------------------------------------------------------------------------------------------

    def _refusal_reason(self, request: web.Request) -> str:
        """Return why a request is refused, and log that; an empty string if it is served."""
        if all(rules.admits(request.remote or "") for rules in (self._access, rules_of(request))):
            return ""
        logs = [gateway.wire_log for gateway in self._mounts.gateways]
        log_refused_request(request, "it is not in the console's allow", logs)
        return "This address is not in the console's allow list."

    def _may_control(self, request: web.Request) -> bool:
        is_read_only = any(rules.is_read_only(request.remote or "") for rules in (self._access, rules_of(request)))
        return not self._mounts.pin and not is_read_only

    # --- requests ---------------------------------------------------------------------------------------------------

    async def _serve_index(self, request: web.Request) -> web.StreamResponse:
        return await (await asyncio.to_thread(page_files)).serve_page(
            request, token=self._token, can="act" if self._may_control(request) else "look"
        )

    async def _serve_file(self, request: web.Request) -> web.StreamResponse:
        return await (await asyncio.to_thread(page_files)).serve_file(request)

    async def _serve_metrics(self, request: web.Request) -> web.StreamResponse:
        if (text := await self._metrics.text()) is None:
            raise web.HTTPNotImplemented(reason=missing_package_text())
        return web.Response(body=text, headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"})

    async def _serve_recording(self, request: web.Request) -> web.StreamResponse:
        if not is_same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        mount, name = request.match_info["mount"], request.match_info["name"]
        recordings = self._mounts.recorders
        known = mount.isdecimal() and int(mount) < len(recordings)
        recorded = f"{name.removesuffix('.html')}.rec" if name.endswith(".html") else name
        path = recordings[int(mount)].recording_path(recorded) if known else None
        if path is None:
            raise web.HTTPNotFound
        if name.endswith(".html"):
            try:
                path = await self._mounts.report(path)
            except UserError as error:
                return web.Response(status=409, text=str(error))
        return web.FileResponse(path, headers={"Content-Disposition": f'attachment; filename="{name}"'})

    async def _open_page(self, request: web.Request) -> web.StreamResponse:
        if not is_same_token(request.query.get("token"), self._token):
            raise web.HTTPForbidden
        host = request.remote or "?"
        ws = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_BYTES, heartbeat=HEARTBEAT_PERIOD, compress=False)
        await ws.prepare(request)
        if not self._page_quota.acquire(host):  # the page tries again much later
            await ws.close(code=WSCloseCode.TRY_AGAIN_LATER, drain=False)
            return ws
        try:
            await self._serve_page(ws, request, host)
        finally:
            self._page_quota.release(host)
        return ws

    async def _serve_page(self, websocket: web.WebSocketResponse, request: web.Request, host: str) -> None:
        """Serve a page until it disconnects."""
        session = PageSession(self._mounts, _Socket(websocket, request), host, self._may_control(request))
        session_task = asyncio.ensure_future(session.run())
        self._page_tasks.add(session_task)
        try:
            async for message in websocket:
                if message.type in (WSMsgType.TEXT, WSMsgType.BINARY):
                    session.receive(message.data)
                if session_task.done():
                    break
        finally:
            session_task.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await session_task
            self._page_tasks.discard(session_task)


class _Socket:
    """aiohttp's WebSocket with the interface that a page session needs."""

    def __init__(self, websocket: web.WebSocketResponse, request: web.Request) -> None:
        self._websocket, self._transport = websocket, request.transport
        raw = request.transport.get_extra_info("socket") if request.transport else None
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16384)  # to notice a stalled browser soon

    def unread_byte_count(self) -> int:
        if self._transport is None or self._transport.is_closing():
            return 0
        return int(self._transport.get_write_buffer_size())

    async def send(self, text: str) -> None:
        if self._websocket.closed:
            raise ConnectionError("the page has disconnected")
        await self._websocket.send_str(text)
