"""Checks of every request over HTTP: whether it is addressed to this computer, and at which port it arrived.

Importing this module imports aiohttp, which is slow.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable

from aiohttp import HttpVersion11, web

from gateway.core.wire_log import WireLog
from gateway.system.own_names import is_own_host

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
#: The key under which an application stores a function: whether the client of a request may only read and stop.
READ_ONLY_KEY: web.AppKey[Callable[[web.Request], bool]] = web.AppKey("read only")


def log_refused_request(request: web.Request, reason: str, logs: Iterable[WireLog]) -> None:
    """Log in each of ``logs`` that a request is refused, once per host; ``status`` shows the refusal, too."""
    host = request.remote or "?"
    for log in logs:
        log.log_rejection(host, f"request from {host} over HTTP refused: {reason}", host)


def is_for_this_computer(request: web.Request, extra_names: Iterable[str] = ()) -> bool:
    """Whether a request's ``Host`` is this computer, or an extra name. An HTTP/1.0 request needs no ``Host``."""
    if "Host" not in request.headers and request.version < HttpVersion11:
        return True
    return is_own_host(request.headers.get("Host"), local_address(request)[0], extra_names)


def local_address(request: web.Request) -> tuple[str, int]:
    """Return the local address and port of a request's connection; ("", 0) if that is closed."""
    local = request.transport.get_extra_info("sockname") if request.transport is not None else None
    return (str(local[0]), int(local[1])) if local else ("", 0)
