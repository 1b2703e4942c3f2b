"""What the web servers of the console and the fleet share: static files, access checks.

The files are read once at the start; a path to any other file is not served. Every refusal is one plain line of text.

Only the server's own page may send requests, in a browser that reached it by an address of this computer. A foreign
page in the same browser could send requests here, or let its own name point here (DNS rebinding). So ``Host`` must be
an address or a name of this computer, ``Origin`` must be the page's own, and every action needs the token that only
the served page has. The port is not compared: an SSH tunnel may use another one.
"""

from __future__ import annotations

import hmac
import html
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

from aiohttp import web

from gateway.system.own_names import host_of

#: Content types of the files that are served, by their suffix.
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".json": "application/json",
         ".txt": "text/plain", ".svg": "image/svg+xml", ".png": "image/png",
         ".webmanifest": "application/manifest+json"}  # fmt: skip

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
#: Headers of every response: the browser loads and runs only files of this server, and allows no frames around it.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Pages:
    """Files by their paths on the server; ``index.html`` is the page itself."""

    def __init__(self, paths: Mapping[str, Path]) -> None:
        self._files = {
            name: (path.read_bytes(), TYPES[path.suffix]) for name, path in paths.items() if path.suffix in TYPES
        }

    def index(self, **words: str) -> web.Response:
        """Return the page with each ``{{name}}`` replaced by the word of that name."""
        body, kind = self._files["index.html"]
        for name, word in words.items():
            body = body.replace(f"{{{{{name}}}}}".encode(), html.escape(word).encode())
        return _answer(body, kind, "no-store")

    async def file(self, request: web.Request) -> web.StreamResponse:
        """Serve any other file, by the ``path`` of its route."""
        found = self._files.get(request.match_info["path"])
        if found is None:
            raise web.HTTPNotFound
        return _answer(*found, "no-cache")


def _answer(body: bytes, kind: str, keeping: str) -> web.Response:
    return web.Response(body=body, content_type=kind, charset="utf-8", headers={"Cache-Control": keeping})


def guarded(refused: Callable[[web.Request], str]) -> Any:
    """Return a middleware that refuses a request if ``refused`` returns a reason, and sets the headers."""

    @web.middleware
    async def admit(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            if words := refused(request):
                raise web.HTTPForbidden(reason=words)
            response = await handler(request)
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    return admit


def same_origin(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from the page itself, or from no page: browsers send ``Origin`` for foreign pages."""
    if origin is None:
        return True
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and host_of(rest) == host_of(host or "")


def from_other_site(headers: Mapping[str, str]) -> bool:
    """Whether the browser itself reports that a page of another site sends this request."""
    return headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin")


def from_own_page(headers: Mapping[str, str], path: str) -> bool:
    """Whether a request comes from the page itself; the page may also be requested from elsewhere, by a link."""
    own = same_origin(headers.get("Origin"), headers.get("Host"))
    return own and (path == "/" or not from_other_site(headers))


def same_token(given: str | None, token: str) -> bool:
    """Compare two tokens in constant time."""
    return hmac.compare_digest((given or "").encode(), token.encode())
