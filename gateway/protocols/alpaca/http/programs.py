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
from gateway.protocols.alpaca.http.requests import Asked
from gateway.protocols.alpaca.tables import member, refused
from gateway.transport.handler import Accept, Connected, ConnectionRefused
from gateway.transport.web_server import WebDevice

#: Seconds until a request times out, and until the connection of a silent program is closed.
TIMEOUT, FORGET = 5.0, 600.0
#: The maximum number of programs of a mount, and of waiting requests of a program.
MOST, WAITING = 64, 64
#: The beginning of a request that only reads.
READS = b"get "
#: Seconds between two checks whether a goto has ended, and how long the gateway waits for its end.
CHECK_EVERY, LONGEST = 0.25, 900.0
#: The requests of these checks, and the reply to the second if no goto is under way.
CONNECT, SLEWING, RESTS = b"put connect\n", b"get slewing\n", b"false"
#: The request for the reason why a goto ended before its goal.
ENDED_SHORT = b'put action Action="GotoEndedShort" Parameters=""\n'
#: The command that is never refused.
STOP = "abortslew"


class NoAnswerInTime(Exception):
    """A request timed out, or too many are waiting; it may have been carried out all the same."""


class AlpacaClient:
    """One Alpaca client, with its connection to the gateway."""

    def __init__(self, accept: Accept, name: str, host: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[asyncio.Future[bytes]] = deque()
        self._partial_line = b""
        self.last = self._loop.time()
        self.gone = False
        #: Whether it has ever sent a request that is no read: it is then no web page, whose writes are refused.
        self.acts = False
        self._handler = accept(Connected(name, host, self._hear, lambda last: self.close()))

    @property
    def idle(self) -> bool:
        return not self._waiting

    async def ask(self, line: bytes, stop: bool = False) -> bytes:
        """Send a line and return its reply; a ``stop`` is sent however many requests wait. Raises NoAnswerInTime."""
        if self.gone or (len(self._waiting) >= WAITING and not stop):
            raise NoAnswerInTime("Too many requests of this program wait for an answer.")
        self.last = self._loop.time()
        self.acts |= not line.startswith(READS)
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._waiting.append(answer)
        self._handler.feed(line)
        try:
            async with asyncio.timeout(TIMEOUT):
                return await answer
        except TimeoutError:
            self.close()  # a late reply would be taken for the reply to the next request
            raise NoAnswerInTime(f"The mount has not answered within {TIMEOUT:g} s.") from None

    def _hear(self, data: bytes) -> int:
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        for line in lines:
            answer = self._waiting.popleft() if self._waiting else None
            if answer is not None and not answer.done():
                answer.set_result(line)
        return 0

    def close(self) -> None:
        """Close the connection; waiting requests fail."""
        if not self.gone:
            self.gone = True
            self._handler.close()
            for answer in self._waiting:
                if not answer.done():
                    answer.set_exception(NoAnswerInTime("The mount does not answer."))
                    answer.exception()
            self._waiting.clear()


class Programs:
    """The programs of a mount, by host and ClientID."""

    def __init__(self, accept: Accept) -> None:
        self._accept = accept
        self._known: dict[tuple[str, int], AlpacaClient] = {}

    def of(self, host: str, client: int, stop: bool = False) -> AlpacaClient:
        """Return the program of a ClientID on a host. Raises ConnectionRefused for too many, except for a ``stop``."""
        self._sweep()
        program = self._known.get((host, client))
        if program is None or program.gone:
            if len(self._known) >= MOST and not stop:
                raise ConnectionRefused
            program = self._known[host, client] = AlpacaClient(self._accept, _name(host, client), host)
        return program

    def extra_connection(self, host: str, client: int) -> AlpacaClient:
        """Return a second connection, on which the gateway polls for a program. Raises ConnectionRefused."""
        return AlpacaClient(self._accept, f"{_name(host, client)}-arrival", host)

    def _sweep(self) -> None:
        """Forget closed and silent programs; of too many also an idle one, preferably one that has only read."""
        now = asyncio.get_running_loop().time()
        for key, program in list(self._known.items()):
            if program.gone or (program.idle and now - program.last > FORGET):
                program.close()
                del self._known[key]
        if len(self._known) >= MOST:
            idle = [key for key, program in self._known.items() if program.idle]
            if idle:
                self._known.pop(min(idle, key=lambda key: (self._known[key].acts, self._known[key].last))).close()

    def close(self) -> None:
        """Close the connections of all programs."""
        for program in self._known.values():
            program.close()
        self._known.clear()


def _name(host: str, client: int) -> str:
    return f"[{host}]:id-{client}" if ":" in host else f"{host}:id-{client}"


# --- the device ----------------------------------------------------------------------------------------------------


class Device:
    """One mount as an Alpaca device."""

    def __init__(self, web: WebDevice) -> None:
        self.web, self.programs = web, Programs(web.accept)

    async def answer(self, request: Asked, host: str) -> dict[str, Any]:
        """Return the value or the error as the members of a JSON object. Raises ConnectionRefused."""
        stop = request.command.name == STOP
        program = self.programs.of(host, request.client, stop)
        try:
            reply = _parsed(await program.ask(request.line, stop))
            if not reply["ErrorNumber"] and member(request.command.name).arrival:
                refusal = await _arrival(self.programs.extra_connection(host, request.client))
                reply = refused(Refused(refusal)) if refusal else reply
        except NoAnswerInTime as error:
            reply = refused(NoAnswer(str(error)))
        return reply


async def _arrival(extra: AlpacaClient) -> str:
    """Wait for the end of a goto; return the reason if it ended before its goal, else an empty text."""
    loop = asyncio.get_running_loop()
    end = loop.time() + LONGEST
    try:
        await extra.ask(CONNECT)
        while loop.time() < end:
            await asyncio.sleep(CHECK_EVERY)
            if await extra.ask(SLEWING) == RESTS:
                return str(_parsed(await extra.ask(ENDED_SHORT)).get("Value", ""))
        return ""
    finally:
        extra.close()


def _parsed(line: bytes) -> dict[str, Any]:
    """Return the members of the JSON answer for a reply of the surface, which is a value, null or an error."""
    value = json.loads(line)
    if isinstance(value, dict) and "ErrorNumber" in value:
        return value
    return {"ErrorNumber": 0, "ErrorMessage": ""} | ({} if value is None else {"Value": value})


_transactions = count(1)


def numbered(reply: dict[str, Any], transaction: int) -> dict[str, Any]:
    """Add the transaction ids of the program and of the server to a reply."""
    server = next(_transactions) % 2**32
    return {**reply, "ClientTransactionID": transaction, "ServerTransactionID": server}
