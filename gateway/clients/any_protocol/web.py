"""Passes HTTP connections on a port for every protocol to the web server, as soon as there is one.

The web server opens for the first connection, or when the mount is ready. Until then connections wait for some seconds
at most. If there is no server, or it opens too late, they get a short answer that says this.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from gateway.transport.handler import Taker

#: Gives a connection to the web server, together with the bytes that were received already.
Serve = Callable[[asyncio.Transport, bytes], None]
#: Connections that may wait, bytes of each, and seconds that each may wait.
MAX_WAITING, MAX_BYTES, TIMEOUT = 64, 8192, 5.0

NONE = (
    "404 Not Found",
    "There is no console here: mount-gateway was started without one (--no-console, or it could not be opened).\n"
    "Telescope programs can use this port.\n",
)
LATE = (
    "503 Service Unavailable",
    "mount-gateway is starting or waiting for its mount. Load this page again in a moment.\n",
)


class Browser(Protocol):
    """A connection that waits for the web server."""

    #: The bytes received so far.
    sent: bytes

    def hand_over(self, take: Taker) -> None: ...
    def hang_up(self, last: bytes) -> None: ...


class Web:
    """Serves or holds HTTP connections. ``later`` calls a function after some seconds; None: there is no server."""

    def __init__(self, later: Callable[[float, Callable[[], None]], object] | None = None) -> None:
        self.later = later
        self._serve: Serve | None = None
        #: Set once the server is wanted: a connection waits for it.
        self.wanted = asyncio.Event()
        #: The host and port of the server itself, once it is open.
        self.where: tuple[str, int] | None = None
        self._waiting: list[Browser] = []

    def enter(self, browser: Browser) -> None:
        if self._serve is not None:
            self._hand_over(browser, self._serve)
        elif self.later is None:
            browser.hang_up(answer(*NONE))
        elif len(self._waiting) >= MAX_WAITING:
            browser.hang_up(answer(*LATE))
        else:
            self.wanted.set()
            self._waiting.append(browser)
            self.later(TIMEOUT, lambda: self._give_up(browser))

    def received_more(self, browser: Browser) -> None:
        if len(browser.sent) > MAX_BYTES:
            self._give_up(browser)

    def leave(self, browser: Browser) -> None:
        if browser in self._waiting:
            self._waiting.remove(browser)

    def open(self, serve: Serve, where: tuple[str, int] | None = None) -> None:
        """The web server is open from now on."""
        self._serve, self.where = serve, where
        waiting, self._waiting = self._waiting, []
        for browser in waiting:
            self._hand_over(browser, serve)

    def close(self) -> None:
        """The web server has closed, or will never open."""
        self._serve = self.later = self.where = None
        waiting, self._waiting = self._waiting, []
        for browser in waiting:
            browser.hang_up(answer(*NONE))

    def _hand_over(self, browser: Browser, serve: Serve) -> None:
        sent = browser.sent
        browser.hand_over(lambda transport: serve(transport, sent))

    def _give_up(self, browser: Browser) -> None:
        if browser in self._waiting:
            self._waiting.remove(browser)
            browser.hang_up(answer(*LATE))


def answer(status: str, words: str) -> bytes:
    body = words.encode()
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {len(body)}\r\n"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nRetry-After: 2\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body
