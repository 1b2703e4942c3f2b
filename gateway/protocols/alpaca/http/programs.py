"""Programs that speak Alpaca: each is a client of the mount like a connection of any other program.

HTTP has no connection that would tell programs apart; here one is a ClientID on one computer. Its requests are lines of
a connection of its own, answered in their order, so a slow one holds up nobody else. One that is silent for long is
forgotten; whatever moves by its order has been ended by the dead man's switch long before. What a request is answered
is, as ASCOM has it, JSON with the value or the error, and the numbers of the request.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from itertools import count
from typing import Any

from gateway.core.errors import NoAnswer
from gateway.protocols.alpaca.http.requests import Asked
from gateway.protocols.alpaca.tables import member, refused
from gateway.transport.handler import Arrive, ConnectionRefused
from gateway.transport.web_port import WebDevice

#: Seconds after which an answer does not come any more, and after which a silent program is forgotten.
PATIENCE, FORGET = 5.0, 600.0
#: Programs of one mount, and requests of one program that may wait at a time.
MOST, WAITING = 64, 64
#: How a line begins that only asks.
LOOKS = b"get "
#: Seconds between two looks at whether a goto has ended, and how many of them one may last.
LOOK, LONGEST = 0.25, 900.0
#: What is asked then, and how it is said that none is under way.
CONNECT, SLEWING, RESTS = b"put connect\n", b"get slewing\n", b"false"
#: What is never refused.
STOP = "abortslew"


class NoAnswerInTime(Exception):
    """A request was not answered, or there are too many; what it asked for may have been done."""


class Program:
    def __init__(self, arrive: Arrive, name: str, host: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[asyncio.Future[bytes]] = deque()
        self._rest = b""
        self.last = self._loop.time()
        self.gone = False
        #: Whether it has ever done more than look, which a web page cannot.
        self.acts = False
        self._handler = arrive(name, host, self._hear)
        self._handler.network(lambda last: self.close())

    @property
    def idle(self) -> bool:
        return not self._waiting

    async def ask(self, line: bytes, stop: bool = False) -> bytes:
        """-> the line that answers it; a stop is said however many wait. Raises NoAnswerInTime."""
        if self.gone or (len(self._waiting) >= WAITING and not stop):
            raise NoAnswerInTime("Too many requests of this program wait for an answer.")
        self.last = self._loop.time()
        self.acts |= not line.startswith(LOOKS)
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._waiting.append(answer)
        self._handler.feed(line)
        try:
            async with asyncio.timeout(PATIENCE):
                return await answer
        except TimeoutError:
            self.close()  # an answer that still came would be taken for that to the next request
            raise NoAnswerInTime(f"The mount has not answered within {PATIENCE:g} s.") from None

    def _hear(self, data: bytes) -> int:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            answer = self._waiting.popleft() if self._waiting else None
            if answer is not None and not answer.done():
                answer.set_result(line)
        return 0

    def close(self) -> None:
        """It is not heard any more."""
        if not self.gone:
            self.gone = True
            self._handler.close()
            for answer in self._waiting:
                if not answer.done():
                    answer.set_exception(NoAnswerInTime("The mount does not answer."))
                    answer.exception()
            self._waiting.clear()


class Programs:
    def __init__(self, arrive: Arrive) -> None:
        self._arrive = arrive
        self._known: dict[tuple[str, int], Program] = {}

    def of(self, host: str, client: int, stop: bool = False) -> Program:
        """The one of this ClientID on this computer; for a ``stop`` there is always room. Raises ConnectionRefused for
        one that may not come in."""
        self._sweep()
        program = self._known.get((host, client))
        if program is None or program.gone:
            if len(self._known) >= MOST and not stop:
                raise ConnectionRefused
            program = self._known[host, client] = Program(self._arrive, _name(host, client), host)
        return program

    def beside(self, host: str, client: int) -> Program:
        """A further connection for a program: what the gateway asks there is no sign that the program lives. Raises
        ConnectionRefused."""
        return Program(self._arrive, f"{_name(host, client)}-arrival", host)

    def _sweep(self) -> None:
        """Forget whoever is gone or has long been silent; of too many, who only looks before others, and of
        these the longest silent one."""
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
        """Nobody is heard any more."""
        for program in self._known.values():
            program.close()
        self._known.clear()


def _name(host: str, client: int) -> str:
    return f"[{host}]:id-{client}" if ":" in host else f"{host}:id-{client}"


# --- the device that they ask ---------------------------------------------------------------------------------------


class Device:
    """One mount as a device with a number."""

    def __init__(self, web: WebDevice) -> None:
        self.web, self.programs = web, Programs(web.arrive)

    async def answer(self, asked: Asked, host: str) -> dict[str, Any]:
        """The value or the error. Raises ConnectionRefused."""
        stop = asked.command.name == STOP
        program = self.programs.of(host, asked.client, stop)
        try:
            told = _taken_apart(await program.ask(asked.line, stop))
            if not told["ErrorNumber"] and member(asked.command.name).arrival:
                await _arrival(self.programs.beside(host, asked.client))
        except NoAnswerInTime as error:
            told = refused(NoAnswer(str(error)))
        return told


async def _arrival(beside: Program) -> None:
    """Wait until the goto is over; others of the program are answered meanwhile."""
    loop = asyncio.get_running_loop()
    end = loop.time() + LONGEST
    try:
        await beside.ask(CONNECT)
        while loop.time() < end:
            await asyncio.sleep(LOOK)
            if await beside.ask(SLEWING) == RESTS:
                return
    finally:
        beside.close()


def _taken_apart(line: bytes) -> dict[str, Any]:
    """An answer of the surface: a value, nothing, or an error."""
    value = json.loads(line)
    if isinstance(value, dict) and "ErrorNumber" in value:
        return value
    return {"ErrorNumber": 0, "ErrorMessage": ""} | ({} if value is None else {"Value": value})


_transactions = count(1)


def numbered(told: dict[str, Any], transaction: int) -> dict[str, Any]:
    """With the program's number of the request, and one of this server's own."""
    server = next(_transactions) % 2**32
    return {**told, "ClientTransactionID": transaction, "ServerTransactionID": server}
