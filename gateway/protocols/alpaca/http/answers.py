"""The answer to a request, as ASCOM has it: JSON with the value or the error, and the numbers of the request."""

from __future__ import annotations

import asyncio
import json
from itertools import count
from typing import Any

from gateway.core.errors import NoAnswer
from gateway.protocols.alpaca.faults import refused
from gateway.protocols.alpaca.http.programs import NoAnswerInTime, Program, Programs
from gateway.protocols.alpaca.http.requests import Asked
from gateway.protocols.alpaca.members import member
from gateway.transport.web_port import WebDevice

#: Seconds between two looks at whether a goto has ended, and how many of them one may last.
LOOK, LONGEST = 0.25, 900.0
#: What is asked then, and how it is said that none is under way.
CONNECT, SLEWING, RESTS = b"put connect\n", b"get slewing\n", b"false"
#: What is never refused.
STOP = "abortslew"


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
