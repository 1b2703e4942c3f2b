"""Replaying a recording: its times are the clock, its mount bytes are the mount, its clients ask again.

Every client must receive the bytes that it received then. The line sends its requests in the recorded order and at the
recorded times; the hub decides as it did, for it lives on what the mount and the clients say and on nothing else.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from gateway.assembly import Gateway
from gateway.config import MountConfig, SurfaceConfig
from gateway.errors import UserError
from gateway.line import Dialogue, Line
from gateway.ports import Guest
from gateway.recorded import RecordedLine, RecordedWire
from gateway.recording import MOUNT, Event, Recording
from gateway.transcript import SKY_READY, Entry, Transcript
from gateway.virtual import run
from gateway.wires import SimulatorWire

#: Turns of the event loop in which everything has come to rest that one event has set going.
TURNS = 60
#: What the gateway is given to end after the last event, seconds.
AFTERWARDS = 1.0


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


def replay(recording: Recording) -> Outcome:
    """Play a recording again. Raises UserError for one whose beginning is missing."""
    if recording.settings["from"]:
        raise UserError("the beginning of this recording was rotated away: it can be decoded, or replayed with --sim")
    outcome: Outcome = run(_replay(recording))
    return outcome


def _gateway(recording: Recording, clock: Callable[[], float]) -> Gateway:
    """The gateway that was recorded, as it was set up. Raises UserError."""
    config = recording.settings["config"]
    try:
        mount = msgspec.convert(config["mount"], MountConfig)
        surfaces = msgspec.convert(config["surface"], list[SurfaceConfig])
    except (msgspec.ValidationError, KeyError, TypeError) as error:
        raise UserError(f"recording: its settings do not suit this version of mount-gateway: {error}") from None
    gateway = Gateway(mount, surfaces, clock=clock)
    gateway.sites.update(recording.settings.get("sites", {}))
    return gateway


async def _replay(recording: Recording) -> Outcome:
    loop = asyncio.get_running_loop()
    began = loop.time()

    def now() -> float:
        return loop.time() - began

    wire = RecordedWire(recording.events, now)
    gateway = _gateway(recording, lambda: float(recording.settings["began"]) + now())
    lines: list[RecordedLine] = []

    def line(dialogue: Dialogue, transcript: Transcript) -> Line:
        lines.append(RecordedLine(wire, dialogue, transcript))
        return lines[0]

    gateway.prepare(line)
    assert gateway.hub is not None
    clients = _Clients(gateway)
    gateway.begin()
    for event in recording.events:
        await asyncio.sleep(max(0.0, event.at - now()))
        if event.side == MOUNT:
            _mount(event, gateway, wire, lines[0])
        else:
            clients.play(event)
        for _ in range(TURNS):
            await asyncio.sleep(0)
    await asyncio.sleep(AFTERWARDS)
    await gateway.close()
    requests = sum(1 for event in recording.events if event.side == MOUNT and event.arrow == ">")
    replies = sum(1 for event in recording.events if event.side != MOUNT and event.arrow == "<")
    return Outcome(clients.count, replies, requests, clients.differences(), wire.strayed)


def replay_on_simulator(recording: Recording, show: Callable[[str], object]) -> None:
    """The recorded clients on a simulated mount of the recorded kind; every line of the conversation is shown."""
    run(_on_simulator(recording, show))


async def _on_simulator(recording: Recording, show: Callable[[str], object]) -> None:
    from gateway.logline import line
    from gateway.simulators import DEFAULT_SITE, make_simulator

    loop = asyncio.get_running_loop()
    began = loop.time()

    def now() -> float:
        return loop.time() - began

    def clock() -> float:
        return float(recording.settings["began"]) + now()

    gateway = _gateway(recording, clock)

    def put(entry: Entry) -> None:
        if entry.arrow != "raw":
            show(line(entry, gateway.mount.protocol))

    gateway.transcript.sinks.append(put)
    simulator = make_simulator(gateway.mount, clock=clock, site=gateway.config.site or DEFAULT_SITE)
    gateway.prepare(lambda dialogue, transcript: Line(SimulatorWire("sim", simulator.feed), dialogue, transcript))
    gateway.sky.load()
    clients = _Clients(gateway)
    gateway.begin()
    for event in recording.events:
        await asyncio.sleep(max(0.0, event.at - now()))
        if event.side != MOUNT:
            clients.play(event)
    await asyncio.sleep(AFTERWARDS)
    await gateway.close()


def _mount(event: Event, gateway: Gateway, wire: RecordedWire, line: RecordedLine) -> None:
    """Make what the mount did happen again."""
    match event.arrow:
        case ">":
            line.allow()
        case "<":
            wire.deliver(event.data)
        case "v":
            wire.lost(event)
        case "!" if event.data == SKY_READY.encode():
            gateway.sky.load()


class _Heard:
    """One connection: what it was told then and now, and when each byte of then came."""

    def __init__(self, guest: Guest) -> None:
        self.guest = guest
        self.then, self.now = bytearray(), bytearray()
        self.times: list[tuple[int, float]] = []


class _Clients:
    """The recorded connections, by name; a name may be used again once it is gone."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._here: dict[str, _Heard] = {}
        self._gone: list[tuple[str, _Heard]] = []
        self.count = 0

    def play(self, event: Event) -> None:
        """Make what a client did happen again, and remember what it was told."""
        match event.arrow:
            case "+":
                self._come(event)
            case "-":
                self._go(event)
            case ">":
                self._feed(event)
            case "<":
                self._expect(event)

    def _come(self, event: Event) -> None:
        found = re.fullmatch(r"surface (\d+), host (.*)", event.data.decode("latin-1"))
        if found is None:
            raise UserError(f"recording, {event.at:.6f} s: a connection without its surface and host")
        heard = bytearray()
        reception = self._gateway.receptions[int(found.group(1)) - 1]
        self._here[event.side] = talk = _Heard(reception.arrive(event.side, found.group(2), heard.extend))
        talk.now = heard
        self.count += 1

    def _go(self, event: Event) -> None:
        talk = self._here.pop(event.side, None)
        if talk is not None:
            self._gone.append((event.side, talk))
            talk.guest.close()

    def _feed(self, event: Event) -> None:
        if event.side in self._here:
            self._here[event.side].guest.feed(event.data)

    def _expect(self, event: Event) -> None:
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
