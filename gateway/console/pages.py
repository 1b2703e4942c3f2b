"""What every web server of ours does alike: its files, its gate, and how it listens.

The files are read once: what is not among them is not served, whatever a path may say. Whatever is refused is said in
one plain line, and every answer bears the headers of ``gate.py``.
"""

from __future__ import annotations

import html
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

from aiohttp import web

from gateway.console import gate
from gateway.system.web_log import web_log

#: What a page may consist of, by ending.
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".json": "application/json",
         ".svg": "image/svg+xml", ".webmanifest": "application/manifest+json", ".png": "image/png"}  # fmt: skip

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Pages:
    """Files by their paths on the server; ``index.html`` is the page itself."""

    def __init__(self, paths: Mapping[str, Path]) -> None:
        self._files = {
            name: (path.read_bytes(), TYPES[path.suffix]) for name, path in paths.items() if path.suffix in TYPES
        }

    def index(self, **words: str) -> web.Response:
        """The page with words in the place of their names in braces."""
        body, kind = self._files["index.html"]
        for name, word in words.items():
            body = body.replace(f"{{{{{name}}}}}".encode(), html.escape(word).encode())
        return _answer(body, kind, "no-store")

    async def file(self, request: web.Request) -> web.StreamResponse:
        """Any other file, by the ``path`` of its route."""
        found = self._files.get(request.match_info["path"])
        if found is None:
            raise web.HTTPNotFound
        return _answer(*found, "no-cache")


def _answer(body: bytes, kind: str, keeping: str) -> web.Response:
    return web.Response(body=body, content_type=kind, charset="utf-8", headers={"Cache-Control": keeping})


def guarded(refused: Callable[[web.Request], str]) -> Any:
    """The middleware that lets in whom ``refused`` has nothing to say against."""

    @web.middleware
    async def admit(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            if words := refused(request):
                raise web.HTTPForbidden(reason=words)
            response = await handler(request)
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            response.headers.update(gate.HEADERS)
        return response

    return admit


async def runner_of(app: web.Application) -> web.AppRunner:
    """A server that is ready to listen."""
    runner = web.AppRunner(app, access_log=None, handle_signals=False, shutdown_timeout=0.5, logger=web_log())
    await runner.setup()
    return runner


async def listen(runner: web.AppRunner, host: str, port: int) -> int:
    """Listen there -> the port that was really taken. Raises OSError."""
    await web.TCPSite(runner, host, port).start()
    return int(runner.addresses[-1][1])
