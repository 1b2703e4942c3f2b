"""Alpaca programs as clients of the mount.

HTTP connections do not identify programs, so a program is a ClientID on one computer. Each program has its own virtual
connection to the gateway, so that a slow request delays no other program; its requests are answered in order. After a
long silence the connection is closed; the dead man's switch has ended its motions long before. An answer is a JSON
object with the value or the error, and the ids of the request, as ASCOM defines.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from itertools import count
from typing import Any

from gateway.core.errors import NoAnswer, Refused
from gateway.protocols.alpaca.http.requests import AlpacaRequest
from gateway.protocols.alpaca.tables import conditions_of, error_members
from gateway.transport.handler import Accept, ConnectionRefused, NewConnection
from gateway.transport.web_server import WebDevice

#: Seconds until a request times out, and until the connection of a silent program is closed.
REQUEST_TIMEOUT, FORGET_AFTER = 5.0, 600.0
#: The maximum number of programs of a mount, and of waiting requests of a program.
MAX_PROGRAMS, MAX_WAITING_REQUESTS = 64, 64
#: The beginning of a request that only reads.
READ_PREFIX = b"get "
#: Seconds between two checks whether a goto has ended, and how long the gateway waits for its end.
CHECK_PERIOD, MAX_GOTO_DURATION = 0.25, 900.0
#: The request that connects the gateway for the checks, the request of a check, and its reply if no goto is under way.
CONNECT_LINE, SLEWING_LINE, NOT_SLEWING_REPLY = b"put connect\n", b"get slewing\n", b"false"
#: The request for the reason why a goto ended before its goal.
ENDED_SHORT_LINE = b'put action Action="GotoEndedShort" Parameters=""\n'
#: The command that is never refused.
STOP_COMMAND = "abortslew"


class NoAnswerInTime(Exception):
    """A request timed out, or too many are waiting; it may have been carried out all the same."""


class AlpacaClient:
    """One Alpaca client, with its connection to the gateway."""

    def __init__(self, accept: Accept, name: str, host: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._pending_replies: deque[asyncio.Future[bytes]] = deque()
        self._partial_line = b""
        self.last_asked_at = self._loop.time()
        self.is_closed = False
        #: Whether it has ever sent a PUT. It is then no web page, because PUTs of web pages are refused.
        self.sent_put = False
        self._handler = accept(NewConnection(name, host, self._receive, lambda last: self.close()))

    @property
    def is_idle(self) -> bool:
        return not self._pending_replies

    async def ask(self, line: bytes, stop: bool = False) -> bytes:
        """Send a line and return its reply; a ``stop`` is sent however many requests wait. Raises NoAnswerInTime."""
        if self.is_closed or (len(self._pending_replies) >= MAX_WAITING_REQUESTS and not stop):
            raise NoAnswerInTime("Too many requests of this program wait for an answer.")
        self.last_asked_at = self._loop.time()
        self.sent_put |= not line.startswith(READ_PREFIX)
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._pending_replies.append(answer)
        self._handler.feed(line)
        try:
            async with asyncio.timeout(REQUEST_TIMEOUT):
                return await answer
        except TimeoutError:
            self.close()  # a late reply would be taken for the reply to the next request
            raise NoAnswerInTime(f"The mount has not answered within {REQUEST_TIMEOUT:g} s.") from None

    def _receive(self, data: bytes) -> int:
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        for line in lines:
            answer = self._pending_replies.popleft() if self._pending_replies else None
            if answer is not None and not answer.done():
                answer.set_result(line)
        return 0

    def close(self) -> None:
        """Close the connection; waiting requests fail."""
        if not self.is_closed:
            self.is_closed = True
            self._handler.close()
            for answer in self._pending_replies:
                if not answer.done():
                    answer.set_exception(NoAnswerInTime("The mount does not answer."))
                    answer.exception()
            self._pending_replies.clear()


class Programs:
    """The programs of a mount, by host and ClientID."""

    def __init__(self, accept: Accept) -> None:
        self._accept = accept
        self._clients: dict[tuple[str, int], AlpacaClient] = {}

    def program_of(self, host: str, client_id: int, stop: bool = False) -> AlpacaClient:
        """Return the program of a ClientID on a host. Raises ConnectionRefused if the host may not connect, or if too
        many programs exist. A ``stop`` is exempt from the limit of ``MAX_PROGRAMS``.
        """
        self._forget_idle_clients()
        program = self._clients.get((host, client_id))
        if program is None or program.is_closed:
            if len(self._clients) >= MAX_PROGRAMS and not stop:
                raise ConnectionRefused
            program = self._clients[host, client_id] = AlpacaClient(self._accept, _client_name(host, client_id), host)
        return program

    def polling_client(self, host: str, client_id: int) -> AlpacaClient:
        """Return a second connection, to poll for the end of a program's goto. Raises ConnectionRefused."""
        return AlpacaClient(self._accept, f"{_client_name(host, client_id)}-arrival", host)

    def _forget_idle_clients(self) -> None:
        """Forget closed and long silent programs. If too many are left, forget one that waits for no reply: preferably
        one that has never sent a PUT, and of these the one whose last request is the oldest.
        """
        now = asyncio.get_running_loop().time()
        for key, program in list(self._clients.items()):
            if program.is_closed or (program.is_idle and now - program.last_asked_at > FORGET_AFTER):
                program.close()
                del self._clients[key]
        if len(self._clients) >= MAX_PROGRAMS:
            idle = [key for key, program in self._clients.items() if program.is_idle]
            if idle:
                oldest = min(idle, key=lambda key: (self._clients[key].sent_put, self._clients[key].last_asked_at))
                self._clients.pop(oldest).close()

    def close(self) -> None:
        """Close the connections of all programs."""
        for program in self._clients.values():
            program.close()
        self._clients.clear()


def _client_name(host: str, client_id: int) -> str:
    return f"[{host}]:id-{client_id}" if ":" in host else f"{host}:id-{client_id}"


# --- the device ----------------------------------------------------------------------------------------------------


class AlpacaDevice:
    """One mount as an Alpaca device."""

    def __init__(self, web_mount: WebDevice) -> None:
        self.web_mount, self.programs = web_mount, Programs(web_mount.accept)

    async def answer(self, request: AlpacaRequest, host: str) -> dict[str, Any]:
        """Return the answer to a request as JSON members. Raises ConnectionRefused (see ``Programs.program_of``)."""
        stop = request.command.name == STOP_COMMAND
        program = self.programs.program_of(host, request.client_id, stop)
        try:
            reply = _parse_reply(await program.ask(request.line, stop))
            if not reply["ErrorNumber"] and conditions_of(request.command.name).arrival:
                refusal = await _wait_for_arrival(self.programs.polling_client(host, request.client_id))
                reply = error_members(Refused(refusal)) if refusal else reply
        except NoAnswerInTime as error:
            reply = error_members(NoAnswer(str(error)))
        return reply


async def _wait_for_arrival(connection: AlpacaClient) -> str:
    """Wait for the end of a goto, 900 s at most; return why it ended before its goal, else an empty text."""
    loop = asyncio.get_running_loop()
    end = loop.time() + MAX_GOTO_DURATION
    try:
        await connection.ask(CONNECT_LINE)
        while loop.time() < end:
            await asyncio.sleep(CHECK_PERIOD)
            if await connection.ask(SLEWING_LINE) == NOT_SLEWING_REPLY:
                return str(_parse_reply(await connection.ask(ENDED_SHORT_LINE)).get("Value", ""))
        return ""
    finally:
        connection.close()


def _parse_reply(line: bytes) -> dict[str, Any]:
    """Return the members of the JSON answer for a reply of the surface, which is a value, null or an error."""
    value = json.loads(line)
    if isinstance(value, dict) and "ErrorNumber" in value:
        return value
    return {"ErrorNumber": 0, "ErrorMessage": ""} | ({} if value is None else {"Value": value})


_server_transaction_ids = count(1)


def with_ids(reply: dict[str, Any], transaction_id: int) -> dict[str, Any]:
    """Add the transaction ids of the program and of the server to a reply."""
    server = next(_server_transaction_ids) % 2**32
    return {**reply, "ClientTransactionID": transaction_id, "ServerTransactionID": server}
