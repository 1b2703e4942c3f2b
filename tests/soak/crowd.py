"""Many programs that poll a gateway's LX200 and NexStar ports four times a second. Standalone, and part of others.

    python -m tests.soak.crowd LX200_PORT NEXSTAR_PORT [--clients 200] [--rate 4] [--seed 1]

Every second one sends ``:GR#:GD#`` in one write, the others ``e``. A tenth of them are killed again and again: the
connection is reset, half of the time with a request on its way, and opened again. It runs until it is ended.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import random
import re
import socket
import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

RATE = 4.0
PATIENCE = 5.0
FRAGILE = 0.1
#: The mean lifetime of a fragile client in seconds.
LIFE = 5.0

_LX200 = re.compile(rb"(\d\d):([0-5]\d):([0-5]\d)#([+-])(\d\d)[*\xdf]([0-5]\d)[:']([0-5]\d)#")
_NEXSTAR = re.compile(rb"([0-9A-F]{8}),([0-9A-F]{8})#")


class Reported(NamedTuple):
    """Right ascension and declination in degrees, and half a unit of the wire format for each."""

    ra: float
    dec: float
    ra_tick: float
    dec_tick: float


def lx200(reply: bytes) -> Reported | None:
    """Parse the replies to ``:GR#`` and ``:GD#``; None for anything else."""
    found = _LX200.fullmatch(reply)
    if found is None:
        return None
    hours, minutes, seconds, sign, degrees, arcminutes, arcseconds = found.groups()
    ra = (int(hours) * 3600 + int(minutes) * 60 + int(seconds)) / 240.0
    dec = int(degrees) + int(arcminutes) / 60.0 + int(arcseconds) / 3600.0
    return Reported(ra, -dec if sign == b"-" else dec, 7.5 / 3600.0, 0.5 / 3600.0)


def nexstar(reply: bytes) -> Reported | None:
    """Parse the reply to ``e``; None for anything else."""
    found = _NEXSTAR.fullmatch(reply)
    if found is None:
        return None
    ra, dec = (int(part, 16) / 2**32 * 360.0 for part in found.groups())
    tick = 180.0 / 2**24
    return Reported(ra, dec - 360.0 if dec > 180.0 else dec, tick, tick)


@dataclass
class Outcome:
    """The results of the crowd. ``wrong`` counts replies of a wrong form or position; ``words`` describes the first."""

    answers: int = 0
    killed: int = 0
    wrong: int = 0
    words: list[str] = field(default_factory=list)

    def add_error(self, text: str) -> None:
        """Count an error."""
        self.wrong += 1
        if len(self.words) < 10:
            self.words.append(text)


#: A function of a received position and the loop time of its request, which says what is wrong (empty: nothing).
Judge = Callable[[Reported, float], str]


async def _client(
    port: int,
    question: bytes,
    read: Callable[[bytes], Reported | None],
    chance: random.Random,
    outcome: Outcome,
    judge: Judge,
    fragile: bool,
    rate: float,
) -> None:
    """Run one program for ever."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    await asyncio.sleep(chance.uniform(0.0, 1.0 / rate))
    while True:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        ends = loop.time() + chance.expovariate(1.0 / LIFE) if fragile else float("inf")
        due = loop.time()
        while loop.time() < ends:
            asked = loop.time()
            writer.write(question)
            reply, fault = b"", "no such form"
            try:
                async with asyncio.timeout(PATIENCE):
                    for _ in range(question.count(b"#") or 1):
                        reply += await reader.readuntil(b"#")
            except TimeoutError as error:  # or the operating system's message about a broken connection
                fault = str(error) or f"no more within {PATIENCE:g} s"
            except asyncio.IncompleteReadError:
                fault = "the connection was closed"
            told = read(reply)
            outcome.answers += 1
            fault = judge(told, asked) if told is not None else fault
            if fault:
                outcome.add_error(
                    f"{question!r} was answered {reply!r}, {loop.time() - began:.1f} s after the beginning: {fault}"
                )
            due = max(due + 1.0 / rate, loop.time())
            await asyncio.sleep(due - loop.time())
        _kill(writer, question if chance.random() < 0.5 else b"")
        outcome.killed += 1


def _kill(writer: asyncio.StreamWriter, last: bytes) -> None:
    """Reset the connection, perhaps with a request on its way."""
    writer.write(last)
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


async def crowd(
    lx200_port: int,
    nexstar_port: int,
    clients: int,
    chance: random.Random,
    outcome: Outcome,
    judge: Judge = lambda told, asked: "",
    rate: float = RATE,
) -> None:
    """Run this many programs, until cancelled."""
    async with asyncio.TaskGroup() as group:
        for number in range(clients):
            own, fragile = random.Random(chance.random()), number < FRAGILE * clients
            if number % 2:
                group.create_task(_client(lx200_port, b":GR#:GD#", lx200, own, outcome, judge, fragile, rate))
            else:
                group.create_task(_client(nexstar_port, b"e", nexstar, own, outcome, judge, fragile, rate))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lx200_port", type=int)
    parser.add_argument("nexstar_port", type=int)
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--rate", type=float, default=RATE, help="how often each asks, a second")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--idle", action="store_true", help="run at idle priority")
    arguments = parser.parse_args()
    if arguments.idle:  # it stands for other computers, which take no time from the gateway's
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    outcome, chance = Outcome(), random.Random(arguments.seed)
    ports = arguments.lx200_port, arguments.nexstar_port
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(crowd(*ports, arguments.clients, chance, outcome, rate=arguments.rate))
    print(f"{outcome.answers} answers, {outcome.wrong} wrong", *outcome.words, sep="\n")
    return 1 if outcome.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
