"""The connection to a mount that is reached over HTTP: each written line is a request, each reply is a line.

A protocol's ``HttpDialect`` converts both. Only the reply to the newest request is delivered, because the caller has
given up the earlier ones. A read or stop whose connection was closed is sent again. While a motion command is
unanswered, its motion may begin after a later stop. So the stop is repeated for some seconds, and once after the
command's answer. Connections stay open, unless the server serves one at a time. An unreachable server is a lost line.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol
from urllib.parse import urlencode, urlsplit

if TYPE_CHECKING:
    from aiohttp import ClientSession

    from gateway.transport.wires import OnData, OnLost

#: Seconds until a connection must be open, until the first answer, and until a request is given up.
CONNECT_TIMEOUT, FIRST_ANSWER_TIMEOUT, ANSWER_TIMEOUT = 4.0, 6.0, 120.0
#: Seconds that an idle connection stays open; how often a read or stop is tried if its connection is closed.
IDLE_TIME, READ_ATTEMPTS = 60.0, 5
#: Seconds between repetitions of a stop, and seconds after which it is no longer repeated without an answer to the
#: motion command: it would also end the motions of other programs.
REPEAT_DELAY, REPEAT_TIMEOUT = 0.5, 15.0
#: Seconds within which a server answers while another connection is idle; else it serves one connection at a time.
PARALLEL_ANSWER_TIME = 1.0


class HttpRequest(NamedTuple):
    """A request: ``GET`` with ``params`` in the query, or ``PUT`` with ``params`` in the body.
    ``is_motion``: True if it begins a motion, False if it ends a motion, None for all others.
    """

    method: str
    path: str
    params: Mapping[str, str]
    is_motion: bool | None = None


class HttpDialect(Protocol):
    """Converts lines to requests, and answers to lines. ``first_requests`` are sent when the connection opens;
    ``check_first_answer`` raises OSError if their answer shows that this is not the expected kind of server.
    """

    @property
    def first_requests(self) -> Sequence[HttpRequest]: ...
    def check_first_answer(self, request: HttpRequest, status: int, body: bytes) -> None: ...
    def request(self, line: bytes) -> HttpRequest: ...
    def reply(self, status: int, body: bytes) -> bytes: ...


class AddressWatcher(Protocol):
    """Is informed when the connection to a server opens and closes. ``answers_in_parallel``: the server answers while
    another connection is idle.
    """

    def reached(self, host: str, port: int, answers_in_parallel: bool) -> None: ...
    def closed(self) -> None: ...


class HttpWire:
    """The connection to the mount at ``url``: ``http://HOST:PORT``, optionally with a path."""

    #: Only the reply to the newest request is delivered.
    newest_only = True

    def __init__(self, url: str, dialect: HttpDialect, watcher: AddressWatcher | None = None) -> None:
        parts = urlsplit(url)
        self.name, self._dialect, self._watcher = url, dialect, watcher
        self._host, self._port = parts.hostname or "", parts.port or 80
        self._base_url = f"{parts.scheme}://{parts.netloc}"
        self._session: ClientSession | None = None
        self._tasks: set[asyncio.Task[bool]] = set()
        self._get_task: asyncio.Task[bool] | None = None  # of the newest request, if a GET; the next write cancels it
        #: The unanswered commands that begin a motion; the stops written since the last of these commands; the task
        #: that repeats the stops; and the loop time until which it repeats them without an answer.
        self._motion_tasks: set[asyncio.Task[bool]] = set()
        self._recent_stops: dict[bytes, HttpRequest] = {}
        self._stop_repeat_task: asyncio.Task[None] | None = None
        self._repeat_until = 0.0
        self._last_request_number = 0

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Send the first requests to the server. Raises OSError with a readable reason."""
        import aiohttp

        connector = aiohttp.TCPConnector(limit=0, keepalive_timeout=IDLE_TIME)  # a stop must not wait for a connection
        session = aiohttp.ClientSession(
            connector=connector, timeout=aiohttp.ClientTimeout(total=ANSWER_TIMEOUT, sock_connect=CONNECT_TIMEOUT)
        )
        session._retry_connection = False  # it would repeat a PUT, and so a guide pulse
        try:
            async with asyncio.timeout(FIRST_ANSWER_TIMEOUT):
                for request in self._dialect.first_requests:
                    self._dialect.check_first_answer(request, *await self._fetch(session, request))
                address, beside = await self._probe_server()
        except (aiohttp.ClientError, OSError) as error:
            await session.close()
            raise OSError(errno.EHOSTUNREACH, unreachable_reason(error)) from None
        except BaseException:
            await session.close()
            raise
        connector._force_close = not beside  # an open connection would lock out stops, the watchdog, and other programs
        self._session, self._on_data, self._on_lost = session, on_data, on_lost
        if self._watcher is not None:
            self._watcher.reached(*address, beside)

    async def _probe_server(self) -> tuple[tuple[str, int], bool]:
        """Return the numeric address of the server, and whether it answers while another connection is idle."""
        _, idle = await asyncio.open_connection(self._host, self._port)
        reader, asking = await asyncio.open_connection(self._host, self._port)
        asking.write(request_bytes(self._base_url, self._dialect.first_requests[0]))
        answers = False
        with contextlib.suppress(TimeoutError, ConnectionError):
            async with asyncio.timeout(PARALLEL_ANSWER_TIME):
                answers = bool(await reader.read(1))
        address = idle.get_extra_info("peername")
        for connection in (idle, asking):
            connection.close()
        return (address[0], address[1]), answers

    def write(self, data: bytes) -> None:
        if self._session is None:
            raise OSError(errno.ENODEV, "the connection is closed")
        self._last_request_number += 1
        if self._get_task is not None:
            self._get_task.cancel()
        request = self._dialect.request(data)
        loop = asyncio.get_running_loop()
        task = loop.create_task(self._carry_out(self._session, self._last_request_number, request))
        self._get_task = task if request.method == "GET" else None
        if request.is_motion:
            self._recent_stops.clear()
            self._motion_tasks.add(task)
        elif request.is_motion is False:
            self._recent_stops[data], self._repeat_until = request, loop.time() + REPEAT_TIMEOUT
            if self._motion_tasks and (self._stop_repeat_task is None or self._stop_repeat_task.done()):
                self._stop_repeat_task = loop.create_task(self._repeat_stops(self._session))
        self._tasks.add(task)
        for unfinished in (self._tasks, self._motion_tasks):
            task.add_done_callback(unfinished.discard)

    async def _repeat_stops(self, session: ClientSession) -> None:
        """Repeat the stops while earlier motion commands are unanswered, at most ``REPEAT_TIMEOUT`` seconds; and once
        after each of their answers.
        """
        overtaken, now = set(self._motion_tasks), asyncio.get_running_loop().time
        while overtaken:
            ended, _ = await asyncio.wait(overtaken, timeout=REPEAT_DELAY)
            unanswered = set(self._motion_tasks)
            if now() < self._repeat_until or any(task.result() for task in ended):
                await asyncio.gather(*(self._carry_out(session, 0, stop) for stop in self._recent_stops.values()))
            overtaken = unanswered | self._motion_tasks

    async def _carry_out(self, session: ClientSession, request_number: int, request: HttpRequest) -> bool:
        """Send a request; deliver the answer if no newer request was written. Return whether an answer came."""
        import aiohttp

        closed = (aiohttp.ServerDisconnectedError, aiohttp.ClientOSError, ConnectionResetError)
        try:
            for left in reversed(range(READ_ATTEMPTS if request.method == "GET" or request.is_motion is False else 1)):
                try:
                    answer = await self._fetch(session, request)
                    break
                except closed as error:
                    if not left or isinstance(error, aiohttp.ClientConnectorError):
                        raise
        except (aiohttp.ClientError, OSError) as error:
            given_up = isinstance(error, TimeoutError) and not isinstance(error, aiohttp.ServerConnectionError)
            if session is self._session and not given_up:  # the line has long stopped waiting for that answer
                self._on_lost(unreachable_reason(error))
            return False
        if session is self._session and request_number == self._last_request_number:
            self._on_data(self._dialect.reply(*answer))
        return True

    async def _fetch(self, session: ClientSession, request: HttpRequest) -> tuple[int, bytes]:
        method, path, fields, _ = request
        query, form = (fields, None) if method == "GET" else (None, fields)
        url = self._base_url + path
        async with session.request(method, url, params=query, data=form, allow_redirects=False) as answer:
            return answer.status, await answer.read()

    async def close(self) -> None:
        session, self._session = self._session, None
        if session is None:
            return
        if self._watcher is not None:
            self._watcher.closed()
        puts = [task for task in self._tasks if task is not self._get_task]
        if puts:  # a stop that was written just before
            await asyncio.wait(puts, timeout=1.0)
        for task in (*self._tasks, *([self._stop_repeat_task] if self._stop_repeat_task is not None else [])):
            task.cancel()
        await session.close()


def request_bytes(url: str, request: HttpRequest) -> bytes:
    """Return a request as bytes, with its fields in the body, for a process without an HTTP library. The request asks
    the server to close the connection after the answer, because the server may serve one connection at a time.
    """
    body = urlencode(request.params)
    return (
        f"{request.method} {request.path} HTTP/1.1\r\nHost: {urlsplit(url).netloc}\r\nConnection: close\r\n"
        f"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {len(body)}\r\n\r\n{body}"
    ).encode("ascii")


def unreachable_reason(error: Exception) -> str:
    """Return why a server cannot be reached."""
    cause = getattr(error, "os_error", None) or error
    if isinstance(cause, ConnectionRefusedError) or getattr(cause, "errno", None) == errno.ECONNREFUSED:
        return "no program listens there (connection refused)"
    if isinstance(cause, socket.gaierror):
        return "no address is known for this name; write its number, like 192.168.1.50"
    if isinstance(error, TimeoutError):
        return "the server does not answer"
    return str(getattr(cause, "strerror", None) or error or "the server has closed the connection")
