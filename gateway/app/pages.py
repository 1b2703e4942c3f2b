"""What the web servers of the console and the fleet share: static files, access checks.

The files are read once at the start; a path to any other file is not served. A page's modules are sent as one file. Its
style sheets and plain scripts are in the page itself, admitted by their digests, so the page needs few round trips. The
path of its files contains a digest of all of them: a browser caches them for a year, and an update changes the path.
Only the server's own page may send requests (``require_own_page``).
"""

from __future__ import annotations

import asyncio
import base64
import gzip
import hashlib
import hmac
import html
import posixpath
import re
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from aiohttp import web

from gateway.clients.access import AccessRules
from gateway.core.wire_log import WireLog
from gateway.system.own_names import host_of
from gateway.transport.http_requests import READ_ONLY_KEY, is_for_this_computer, local_address, log_refused_request

_IMPORT_LINE = re.compile(r'^import\s+(?:\*\s+as\s+(\w+)|(\{[^}]*\}))\s+from\s+"([^"]+)";', re.M)
_DYNAMIC_IMPORT = re.compile(r'\bimport\("([^"]+)"\)')
_EXPORT_LINE = re.compile(r"^export\s+((?:async\s+)?(?:function|class|const)\s+(\w+))", re.M)
_COMMENT = re.compile(r"^[ \t]*(?://.*|/\*\*(?:.|\n)*?\*/[ \t]*)\n", re.M)
_UNBUNDLED_LINE = re.compile(r"^(?:import|export)\b.*", re.M)


def bundle_scripts(texts: Mapping[str, str], main_path: str, folder: str) -> str:
    """Return the script ``main_path`` and all that it imports as one module, served in the folder ``folder``.

    Nothing is compiled; lines of comments are left out. Every module becomes a function that is called when it is first
    needed. A module may have imports only at the beginning of a line, no default exports, no circular imports, and no
    exported variable that changes. ``texts`` are the files by their paths. Raises ValueError for a module that breaks
    these rules.
    """
    bodies: dict[str, str] = {}
    exports: dict[str, set[str]] = {}
    under_way: list[str] = []

    def add_module(path: str) -> int:
        if path in under_way:
            raise ValueError(f"{path} imports itself: {' > '.join(under_way)}")
        if path in bodies:
            return list(bodies).index(path)
        under_way.append(path)
        text = _COMMENT.sub("", texts[path])

        def locate(relative_path: str) -> str:
            return posixpath.normpath(posixpath.join(posixpath.dirname(path), relative_path))

        def imported(match: re.Match[str]) -> str:
            whole, some, other = match.groups()
            number = add_module(locate(other))
            names = [name.split(" as ") for name in " ".join((some or "{}")[1:-1].split()).split(",")]
            exports[locate(other)] |= {name[0].strip() for name in names if name[0].strip()}
            picked = ", ".join(": ".join(map(str.strip, name)) for name in names)
            return f"const {whole or f'{{ {picked} }}'} = get({number});"

        text = _IMPORT_LINE.sub(imported, text)
        text = _DYNAMIC_IMPORT.sub(
            lambda match: f"Promise.resolve().then(() => get({add_module(locate(match[1]))}))", text
        )
        exports.setdefault(path, set()).update(name for _, name in _EXPORT_LINE.findall(text))
        text = _EXPORT_LINE.sub(r"\1", text)
        text = re.sub(r"^export (?=const\b)", "", text, flags=re.M)
        if unknown := _UNBUNDLED_LINE.search(text):
            raise ValueError(f"{path}: {unknown[0]}")
        relative = posixpath.relpath(path, folder or ".")
        bodies[path] = text.replace("import.meta.url", f'new URL("{relative}", import.meta.url)')
        under_way.pop()
        return len(bodies) - 1

    number = add_module(main_path)
    parts = [
        f"// {path}\n() => {{\n{body}\nreturn {{ {', '.join(sorted(exports[path]))} }};\n}},\n"
        for path, body in bodies.items()
    ]
    head = "const made = [];\nconst get = (number) => (made[number] ??= modules[number]());\nconst modules = [\n"
    return f"{head}{''.join(parts)}];\nget({number});\n"


#: Content types of the files that are served, by their suffix.
MIME_MAP = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".json": "application/json",
         ".svg": "image/svg+xml", ".webmanifest": "application/manifest+json", ".png": "image/png", ".mp4": "video/mp4",
         ".txt": "text/plain"}  # fmt: skip

#: The longest body of a request, bytes.
MAX_BODY_BYTES = 8192
#: The answer to a request with the Host header of another computer. It omits that name, to be the same for all names.
FOREIGN_HOST_ANSWER = (
    "This gateway does not know the name or address in the Host header. If that leads here, through a container or a "
    'router, add it: names = ["pier.example.org"] on the surface or under [console], or --names pier.example.org.'
)
_PORT_RULES: web.AppKey[Mapping[int, AccessRules]] = web.AppKey("rules of ports")
_TEXTS = {kind for suffix, kind in MIME_MAP.items() if suffix not in (".png", ".mp4")}
#: In a page: the addresses of its own files, its style sheets and plain scripts, and the script of its modules.
_LINKS = re.compile(r'\b(href|src)="([\w./-]+\.\w+)"')
_INLINABLE = re.compile(r'<(?:link rel="stylesheet" href|script src)="([^"]+)">(?:</script>)?')
_SCRIPT = re.compile(r'<script type="module" src="([^"]+)">')

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
CSP_HEADER = "Content-Security-Policy"
#: Headers of every response: the browser loads and runs only files of this server, and allows no frames around it.
HEADERS = {
    CSP_HEADER: (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src 'self'; "
        "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Pages:
    """Serves the page ``index.html`` and its files. ``paths`` are all files on disk by their paths on the server."""

    def __init__(self, paths: Mapping[str, Path]) -> None:
        self._files = {
            name: (path.read_bytes(), MIME_MAP[path.suffix]) for name, path in paths.items() if path.suffix in MIME_MAP
        }
        self._compressed: dict[str, bytes] = {}
        digest = hashlib.sha256(b"".join(body for _, (body, _) in sorted(self._files.items())))
        self._files_path = f"files/{digest.hexdigest()[:16]}/"
        self._csp = HEADERS[CSP_HEADER]
        self._index = self._bundle_page(self._files["index.html"][0].decode())

    def _bundle_page(self, page: str) -> str:
        """Return the page with its style sheets and plain scripts in it, and its modules as one file."""
        texts = {name: body.decode() for name, (body, kind) in self._files.items() if kind in _TEXTS}

        def bundle_module(match: re.Match[str]) -> str:
            folder = match[1].rpartition("/")[0]
            bundle = f"{folder}/all.js" if folder else "all.js"
            self._files[bundle] = bundle_scripts(texts, match[1], folder).encode(), MIME_MAP[".js"]
            return match[0].replace(match[1], bundle)

        def inline_file(match: re.Match[str]) -> str:
            text, tag = (
                texts[match[1].removeprefix(self._files_path)],
                "style" if match[1].endswith(".css") else "script",
            )
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            self._csp = self._csp.replace(f"{tag}-src 'self'", f"{tag}-src 'self' 'sha256-{digest}'")
            return f"<{tag}>{text}</{tag}>"

        return _INLINABLE.sub(inline_file, _LINKS.sub(rf'\1="{self._files_path}\2"', _SCRIPT.sub(bundle_module, page)))

    async def serve_page(self, request: web.Request, **texts: str) -> web.Response:
        """Return the page; each ``{{name}}`` in it is replaced by the argument of that name."""
        page = self._index
        for name, word in texts.items():
            page = page.replace(f"{{{{{name}}}}}", html.escape(word))
        headers = {"Cache-Control": "no-store", CSP_HEADER: self._csp}
        return await self._answer(request, page, page.encode(), MIME_MAP[".html"], headers)

    async def serve_file(self, request: web.Request) -> web.StreamResponse:
        """Serve a file other than the page; the route's ``path`` names it."""
        name = request.match_info["path"].removeprefix(self._files_path)
        if name not in self._files:
            raise web.HTTPNotFound
        unchanging = name != request.match_info["path"]
        control = "public, max-age=31536000, immutable" if unchanging else "no-cache"
        return await self._answer(request, name, *self._files[name], {"Cache-Control": control})

    async def _answer(
        self, request: web.Request, name: str, body: bytes, mime: str, headers: dict[str, str]
    ) -> web.Response:
        """Return a response: text is compressed if the browser accepts that; the result is kept under ``name``."""
        if mime in _TEXTS:
            headers["Vary"] = "Accept-Encoding"
            if "gzip" in request.headers.get("Accept-Encoding", ""):
                headers["Content-Encoding"] = "gzip"
                if name not in self._compressed:  # milliseconds, in which clients would wait
                    self._compressed[name] = await asyncio.to_thread(gzip.compress, body, 6, mtime=0)
                body = self._compressed[name]
        return web.Response(body=body, content_type=mime, charset="utf-8" if mime in _TEXTS else None, headers=headers)


def make_app(
    hosts: Sequence[str] = (), logs: Sequence[WireLog] = (), rules: Mapping[int, AccessRules] = MappingProxyType({})
) -> web.Application:
    """Return an application that refuses requests with a foreign Host header; ``logs`` record those refusals.

    ``hosts`` are further host names by which clients may call it; ``rules`` are the access rules by port.
    """

    @web.middleware
    async def admit(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            if not is_for_this_computer(request, hosts):
                log_refused_request(request, "it uses a name for this computer that is not in names", logs)
                raise web.HTTPForbidden(reason=FOREIGN_HOST_ANSWER)
            response = await handler(request)
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=f"{error.reason}\n")
        if not response.prepared:
            for name, value in HEADERS.items():
                response.headers.setdefault(name, value)
        return response

    app = web.Application(middlewares=[admit], client_max_size=MAX_BODY_BYTES)
    app[_PORT_RULES] = rules
    app[READ_ONLY_KEY] = lambda request: rules_of(request).is_read_only(request.remote or "")
    return app


def rules_of(request: web.Request) -> AccessRules:
    """Return the access rules of the port at which a request has come."""
    return request.app[_PORT_RULES].get(local_address(request)[1], AccessRules())


def require_own_page(handler: Handler, get_refusal: Callable[[web.Request], str] = lambda request: "") -> Handler:
    """Return a handler for the server's own page only; ``get_refusal`` returns why to refuse a request, or "".

    A foreign page in the same browser could send requests to this server: an ``Origin``, if sent, must be the page's
    own. Ports are not compared: an SSH tunnel may use another. ``Host`` is checked for all requests (it could name
    another computer by DNS rebinding), and the token of the served page by those who carry out actions.
    """

    async def guarded(request: web.Request) -> web.StreamResponse:
        from_page = is_from_own_page(request.headers, request.path)
        if reason := get_refusal(request) if from_page else "Only pages of this server may request this.":
            raise web.HTTPForbidden(reason=reason)
        return await handler(request)

    return guarded


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Whether ``Origin`` is this host or missing: browsers always send it with the requests of foreign pages."""
    if origin is None:
        return True
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and host_of(rest) == host_of(host or "")


def is_from_other_site(headers: Mapping[str, str]) -> bool:
    """Whether the browser itself reports that a page of another site sends this request."""
    return headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin")


def is_from_own_page(headers: Mapping[str, str], path: str) -> bool:
    """Whether the page itself sends a request. The path ``/`` may also be requested by a link on another site."""
    same = is_same_origin(headers.get("Origin"), headers.get("Host"))
    return same and (path == "/" or not is_from_other_site(headers))


def is_same_token(offered_token: str | None, token: str) -> bool:
    """Whether two tokens are equal. The comparison takes constant time."""
    return hmac.compare_digest((offered_token or "").encode(), token.encode())
