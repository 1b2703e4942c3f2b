"""Where connections go that speak HTTP on a port for every protocol: to a web server, as soon as there is one.

The web server is opened when the surfaces are ready, and may never be: until it is known what becomes of it,
connections wait, for some seconds at most. Where there is none, and where it is late, a short answer says so.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from gateway.transport.handler import Taker

#: Gives a connection, of which these bytes have come already, to the web server.
Serve = Callable[[asyncio.Transport, bytes], None]
#: Connections that may wait, bytes of each, and seconds.
MOST, LONGEST, PATIENCE = 64, 8192, 5.0

NONE = (
    "404 Not Found",
    "There is no console here: mount-gateway was started without one (--no-console, or it could not be opened).\n"
    "Telescope programs can use this port.\n",
)
LATE = (
    "503 Service Unavailable",
    "mount-gateway is still starting, or waits for its mount; the console opens then. Load this page again.\n",
)


class Browser(Protocol):
    """A connection that waits."""

    #: What has come of it.
    sent: bytes

    def hand_over(self, take: Taker) -> None: ...
    def hang_up(self, last: bytes) -> None: ...


class Web:
    """Who serves HTTP. ``later`` calls a function after some seconds; without it nobody serves, ever."""

    def __init__(self, later: Callable[[float, Callable[[], None]], object] | None = None) -> None:
        self._later = later
        self._serve: Serve | None = None
        self._waiting: list[Browser] = []

    def enter(self, browser: Browser) -> None:
        if self._serve is not None:
            self._hand_over(browser, self._serve)
        elif self._later is None:
            browser.hang_up(answer(*NONE))
        elif len(self._waiting) >= MOST:
            browser.hang_up(answer(*LATE))
        else:
            self._waiting.append(browser)
            self._later(PATIENCE, lambda: self._give_up(browser))

    def more(self, browser: Browser) -> None:
        if len(browser.sent) > LONGEST:
            self._give_up(browser)

    def leave(self, browser: Browser) -> None:
        if browser in self._waiting:
            self._waiting.remove(browser)

    def open(self, serve: Serve) -> None:
        """There is a web server from now on."""
        self._serve = serve
        waiting, self._waiting = self._waiting, []
        for browser in waiting:
            self._hand_over(browser, serve)

    def close(self) -> None:
        """There is none any more, or there will be none."""
        self._serve = self._later = None
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
