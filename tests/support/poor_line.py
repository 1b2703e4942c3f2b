"""A poor line: now and then bytes are lost, garbled or doubled, and every reply is delayed.

Replies keep their order, as on a serial line or a TCP stream. The positions that a program receives over such a line
are compared with where the mount has pointed: a position is wrong if it was not true at any time within its age.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import pairwise
from random import Random
from typing import Any

from msgspec import Struct

from gateway.astro.spherical import fold_declination, separation
from gateway.transport.wires import OnData, OnLost
from tests.support.in_process_gateway import Bridge, RehearsalClient

#: Seconds: from a reply to the next request, until a program gives up, and per byte at 9600 baud.
EVERY, PATIENCE, BYTE = 0.3, 4.0, 0.001
#: Degrees by which a position may differ from where the mount has pointed; seconds that a position may be old.
MARGIN, OLDEST = 0.02, 10.5
#: Seconds between two samples of the true position, and for how long the gateway extrapolates a position at most.
SAMPLE, RECKONED = 0.05, 1.1


class LineFaults(Struct, frozen=True):
    """The faults of a line: fractions of all exchanges, and the seconds that a round trip takes."""

    lost: float = 0.0
    garbled: float = 0.0
    doubled: float = 0.0
    seconds: float = 0.03


class PoorWire:
    """A transport to a simulated mount over a poor line."""

    name = "a poor line"

    def __init__(self, connect: Callable[..., Callable[[bytes], bytes]], poor: LineFaults, seed: int) -> None:
        self._feed, self._poor, self._random = connect(self._later), poor, Random(seed)
        self._on_data: OnData | None = None
        self._free = 0.0
        self.exchanges = 0

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data

    async def close(self) -> None:
        self._on_data = None

    def write(self, data: bytes) -> None:
        self.exchanges += 1
        draw = self._random.random
        if draw() < self._poor.lost / 2.0:
            return
        answer = self._feed(data)
        if not answer or draw() < self._poor.lost / 2.0:
            return
        if draw() < self._poor.garbled:
            place = self._random.randrange(len(answer))
            answer = answer[:place] + bytes((self._random.randrange(256),)) + answer[place + 1 :]
        self._send(answer)
        if draw() < self._poor.doubled:
            self._send(answer)

    def _later(self, seconds: float, answer: bytes) -> None:
        asyncio.get_running_loop().call_later(self._poor.seconds + seconds, self._deliver, answer)

    def _send(self, answer: bytes) -> None:
        now = asyncio.get_running_loop().time()
        self._free = max(self._free, now + self._poor.seconds) + BYTE * len(answer)
        asyncio.get_running_loop().call_at(self._free, self._deliver, answer)

    def _deliver(self, answer: bytes) -> None:
        if self._on_data is not None:
            self._on_data(answer)


class Polls(Struct):
    """How many polls were sent, how many were answered, how many wrongly, and the longest wait in seconds."""

    asked: int = 0
    answered: int = 0
    wrong: int = 0
    longest: float = 0.0


def insert_poor_line(bridge: Bridge, poor: LineFaults, seed: int = 1) -> PoorWire:
    """Put a poor line between a bridge and its mount."""
    wire = PoorWire(bridge.sim.connection, poor, seed)
    bridge.controller.line.wire = wire
    return wire


async def poll(bridge: Bridge, seconds: float, request: bytes = b":GR#:GD#") -> Polls:
    """Ask where the mount points, again and again, with a pause after every reply."""
    loop, polls, client = asyncio.get_running_loop(), Polls(), bridge.client("10.0.0.7")
    trail = asyncio.ensure_future(_trail(bridge, places := []))
    end = loop.time() + seconds
    while loop.time() < end:
        began = loop.time()
        heard = await ask(client, request)
        polls.asked += 1
        polls.answered += bool(heard)
        polls.longest = max(polls.longest, loop.time() - began)
        if heard and not _true(heard, [place for at, place in places if at >= began - OLDEST] + [_truth(bridge)]):
            polls.wrong += 1
        await asyncio.sleep(EVERY)
    trail.cancel()
    client.close()
    return polls


async def ask(client: RehearsalClient, request: bytes) -> bytes:
    """Return the whole reply to ``:GR#:GD#`` or ``e``; empty if it does not arrive in time."""
    until = asyncio.get_running_loop().time() + PATIENCE
    client.received = b""
    client.send(request)
    while asyncio.get_running_loop().time() < until:
        if client.received.count(b"#") >= max(1, request.count(b"#")):
            return client.received
        await asyncio.sleep(0.01)
    return b""


async def _trail(bridge: Bridge, places: list[tuple[float, tuple[float, float]]]) -> None:
    while True:
        places.append((asyncio.get_running_loop().time(), _truth(bridge)))
        await asyncio.sleep(SAMPLE)


def _truth(bridge: Bridge) -> tuple[float, float]:
    sim: Any = bridge.sim
    sim.true_position()
    ra, dec = sim.mechanics.believed_position(sim.now)
    return fold_declination(ra, dec)


def _true(heard: bytes, places: list[tuple[float, float]]) -> bool:
    """Whether the mount has pointed there; each of the two angles may be of a different moment."""
    if heard.count(b"#") > 1:
        ra, dec = (
            text.replace("*", ":").replace("\xdf", ":").split(":") for text in heard.decode("latin-1").split("#")[:2]
        )
        told = 15.0 * _sexagesimal(ra), _sexagesimal(dec)
    else:
        told = tuple(int(part, 16) * 360.0 / 2**32 for part in heard[:-1].split(b","))  # type: ignore[assignment]
    steps = [(separation(was[0], 0.0, now[0], 0.0), abs(now[1] - was[1])) for was, now in pairwise(places)]
    first, second = (MARGIN + RECKONED / SAMPLE * max([step[n] for step in steps], default=0.0) for n in (0, 1))
    return any(separation(told[0], 0.0, ra, 0.0) < first for ra, _ in places) and any(
        abs((told[1] - dec + 180.0) % 360.0 - 180.0) < second for _, dec in places
    )


def _sexagesimal(parts: list[str]) -> float:
    degrees, minutes, seconds = (float(part) for part in parts)
    size = abs(degrees) + minutes / 60.0 + seconds / 3600.0
    return -size if parts[0].startswith("-") else size
