"""Replaying a recording: its times are the clock, its mount bytes are the mount, its clients ask again.

Every client must receive the bytes that it received then. The line sends its requests in the recorded order and at the
recorded times; the hub decides as it did, for it lives on what the mount and the clients say and on nothing else.
"""

from __future__ import annotations

import asyncio
import heapq
import re
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from gateway.assembly import Gateway
from gateway.config import Config, make_config
from gateway.driver import Ask
from gateway.errors import Fault, UserError
from gateway.line import Dialogue, Job, Line
from gateway.ports import Guest
from gateway.recording import MOUNT, Event, Recording
from gateway.transcript import Transcript
from gateway.virtual import run
from gateway.wires import OnData, OnLost

#: Turns of the event loop in which everything has come to rest that one event has set going.
TURNS = 60
#: What the gateway is given to end after the last event, seconds.
AFTERWARDS = 1.0
#: The note that says from when on the sky is exact.
SKY_READY = b"astronomy is exact from now on"


class Difference(NamedTuple):
    """The first byte at which a client was told something else: what it received then, and now."""

    client: str
    at: float
    then: bytes
    now: bytes


class Outcome(NamedTuple):
    """``strayed`` are the moments at which the gateway asked the mount something else than it did then."""

    clients: int
    replies: int
    requests: int
    differences: list[Difference]
    strayed: list[str]


class RecordedWire:
    """The mount as it was recorded. Bytes that answer a request wait for it."""

    name = "recording"

    def __init__(self, events: list[Event], now: Callable[[], float]) -> None:
        self.script = deque(event.data for event in events if event.side == MOUNT and event.arrow == ">")
        self.allowed = 0
        self.strayed: list[str] = []
        self._now = now
        self._held: list[bytes] = []
        self._port: asyncio.Queue[str] = asyncio.Queue()
        self._on_data: OnData | None = None
        self._on_lost: OnLost = lambda reason: None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        reason = await self._port.get()
        if reason:
            raise OSError(reason)
        self._on_data, self._on_lost = on_data, on_lost

    def port_opened(self) -> None:
        self._port.put_nowait("")

    def port_lost(self, reason: str) -> None:
        if self._on_data is None:
            self._port.put_nowait(reason or "lost")
        else:
            self._on_data = None
            self._on_lost(reason)

    def deliver(self, data: bytes) -> None:
        """Bytes as they arrived then."""
        if self.allowed > 0:
            self._held.append(data)
        elif self._on_data is not None:
            self._on_data(data)

    def write(self, data: bytes) -> None:
        wanted = self.script.popleft() if self.script else b""
        if data != wanted:
            self.strayed.append(f"{self._now():.3f} s: asked {data!r}, then {wanted!r}")
        self.allowed -= 1
        if self.allowed <= 0:
            held, self._held = self._held, []
            for chunk in held:
                asyncio.get_running_loop().call_soon(self.deliver, chunk)

    async def close(self) -> None:
        self._on_data = None


class RecordedLine(Line):
    """A line that sends what was sent then, when it was sent."""

    def __init__(self, wire: RecordedWire, dialogue: Dialogue, transcript: Transcript) -> None:
        super().__init__(wire, dialogue, transcript)
        self._recorded = wire

    def allow(self) -> None:
        """The moment of the next request has come."""
        self._recorded.allowed += 1
        self._wake.set()

    async def _next(self) -> Job | None:
        if self._recorded.allowed > 0 and self._recorded.script:
            for item in sorted(self._queue):
                if not item[2].future.done() and self._bytes(item[2].ask) == self._recorded.script[0]:
                    self._queue.remove(item)
                    heapq.heapify(self._queue)
                    return item[2]
        self._wake.clear()
        await self._wake.wait()
        return None

    def _bytes(self, ask: Ask) -> bytes:
        try:
            return self.dialogue.encode(ask)
        except Fault:
            return b""


def replay(recording: Recording, note: Callable[[str], None] = lambda text: None) -> Outcome:
    """Play a recording again. Raises UserError for one whose beginning is missing."""
    if recording.settings["from"]:
        raise UserError("the beginning of this recording was rotated away: it can be decoded, not replayed")
    config = make_config(recording.settings["config"], "recording")
    outcome: Outcome = run(_replay(config, recording, note))
    return outcome


async def _replay(config: Config, recording: Recording, note: Callable[[str], None]) -> Outcome:
    loop = asyncio.get_running_loop()
    began = loop.time()

    def now() -> float:
        return loop.time() - began

    wire = RecordedWire(recording.events, now)
    gateway = Gateway(config, clock=lambda: recording.settings["began"] + now())
    gateway.sites.update(recording.settings.get("sites", {}))
    lines: list[RecordedLine] = []

    def line(dialogue: Dialogue, transcript: Transcript) -> Line:
        lines.append(RecordedLine(wire, dialogue, transcript))
        return lines[0]

    gateway.prepare(line)
    assert gateway.hub is not None
    clients = _Clients(gateway, now)
    gateway.begin()
    for event in recording.events:
        await asyncio.sleep(max(0.0, event.at - now()))
        _play(event, gateway, wire, lines[0], clients)
        for _ in range(TURNS):
            await asyncio.sleep(0)
    await asyncio.sleep(AFTERWARDS)
    await gateway.close()
    requests = sum(1 for event in recording.events if event.side == MOUNT and event.arrow == ">")
    replies = sum(1 for event in recording.events if event.side != MOUNT and event.arrow == "<")
    for words in wire.strayed:
        note(words)
    return Outcome(clients.count, replies, requests, clients.differences(), wire.strayed)


def _play(event: Event, gateway: Gateway, wire: RecordedWire, line: RecordedLine, clients: _Clients) -> None:
    """Make one thing happen again."""
    match event.side == MOUNT, event.arrow:
        case True, ">":
            line.allow()
        case True, "<":
            wire.deliver(event.data)
        case True, "^":
            wire.port_opened()
        case True, "v":
            wire.port_lost(event.data.decode("latin-1"))
        case True, "!" if event.data == SKY_READY:
            gateway.sky.load()
        case False, "+":
            clients.come(event)
        case False, "-":
            clients.go(event)
        case False, ">":
            clients.feed(event)
        case False, "<":
            clients.expect(event)


class _Heard:
    """One connection: what it was told then and now, and when each byte of then came."""

    def __init__(self, guest: Guest) -> None:
        self.guest = guest
        self.then, self.now = bytearray(), bytearray()
        self.times: list[tuple[int, float]] = []


class _Clients:
    """The recorded connections, by name; a name may be used again once it is gone."""

    def __init__(self, gateway: Gateway, now: Callable[[], float]) -> None:
        self._gateway, self._now = gateway, now
        self._here: dict[str, _Heard] = {}
        self._gone: list[tuple[str, _Heard]] = []
        self.count = 0

    def come(self, event: Event) -> None:
        found = re.fullmatch(r"surface (\d+), host (.*)", event.data.decode("latin-1"))
        if found is None:
            raise UserError(f"recording, {event.at:.6f} s: a connection without its surface and host")
        heard = bytearray()
        reception = self._gateway.receptions[int(found.group(1)) - 1]
        self._here[event.side] = talk = _Heard(reception.arrive(event.side, found.group(2), heard.extend))
        talk.now = heard
        self.count += 1

    def go(self, event: Event) -> None:
        talk = self._here.pop(event.side, None)
        if talk is not None:
            self._gone.append((event.side, talk))
            talk.guest.close()

    def feed(self, event: Event) -> None:
        if event.side in self._here:
            self._here[event.side].guest.feed(event.data)

    def expect(self, event: Event) -> None:
        talk = self._here.get(event.side)
        if talk is not None:
            talk.times.append((len(talk.then), event.at))
            talk.then += event.data

    def differences(self) -> list[Difference]:
        """One for every connection that was told something else."""
        return [found for name, talk in [*self._gone, *self._here.items()] if (found := _difference(name, talk))]


def _difference(name: str, talk: _Heard) -> Difference | None:
    if talk.then == talk.now:
        return None
    at = next((i for i, (a, b) in enumerate(zip(talk.then, talk.now, strict=False)) if a != b),
              min(len(talk.then), len(talk.now)))
    start, when = max((item for item in talk.times if item[0] <= at), default=(0, 0.0))
    return Difference(name, when, bytes(talk.then[start : start + 24]), bytes(talk.now[start : start + 24]))


def in_words(found: list[Difference]) -> list[str]:
    """One line each."""
    return [f"{item.at:.3f} s, {item.client}: then {item.then!r}, now {item.now!r}" for item in found]
