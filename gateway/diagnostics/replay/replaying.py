"""Replay a recording: its times are the clock, its mount bytes are the mount, its clients send their commands again.

Every client must receive the recorded bytes. A recording that contains the event loop iterations ("turns") is replayed
turn by turn (``retracing``). For an older one, or for one of another version that this version does not repeat exactly,
the order is guessed: the mount link sends its requests in the recorded order and at the recorded times.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import msgspec

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.recording.format import WITHOUT_TURNS, Event, Recording
from gateway.app.simulated import DEFAULT_SITE, make_simulator
from gateway.app.state.store import PreviousRun
from gateway.core import operations as op
from gateway.core.about import FIRST_RULES, version
from gateway.core.errors import UserError
from gateway.core.wire_log import MOUNT, SKY_READY, Entry, WireLog
from gateway.diagnostics.log.layout import plain
from gateway.diagnostics.log.printing import Rows
from gateway.diagnostics.replay.recorded_mount import ROUNDED, RecordedLoop, RecordedQueue, RecordedWire
from gateway.diagnostics.replay.replies import Difference, ReplayedConnection
from gateway.diagnostics.replay.retraced import RetracedLoop
from gateway.diagnostics.replay.retracing import AFTERWARDS, Retracing, exchanges
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import MountLink
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import SimulatedTransport

#: Event loop iterations after which everything that one event triggered has finished.
TURNS = 60


class Outcome(NamedTuple):
    """The result of a replay. ``strayed`` lists where the gateway sent the mount other requests than recorded.

    ``guessed`` says why the order of events could not be followed exactly; it is empty if it was.
    """

    clients: int
    replies: int
    requests: int
    differences: list[Difference]
    strayed: list[str]
    guessed: str = ""


def replay(recording: Recording) -> Outcome:
    """Replay a recording. Raises UserError if its beginning is missing."""
    if recording.settings["from"]:
        raise UserError(
            f"{recording.parts[0]}: the recording's beginning is missing, it was deleted when the files "
            "became too many (record-keep) or is in files that are not here: it can be decoded, "
            "or replayed with --sim"
        )
    why = "the recording is of an older format, which does not tell the order in which commands took effect"
    if recording.format != WITHOUT_TURNS:
        with asyncio.Runner(loop_factory=RetracedLoop) as runner:
            exact = runner.run(_retrace(recording))
        why = _versions(recording)
        if not why or not (exact.differences or exact.strayed):
            return exact
    events = list(recording)
    outcome: Outcome = run(_replay(recording, events), lambda: RecordedLoop(events))
    return outcome._replace(guessed=why)


def _versions(recording: Recording) -> str:
    """Return which other versions recorded it; empty if these did. Their turns may come in another order."""
    recorded = recording.settings.get("version"), recording.settings.get("python")
    here = version(), "{}.{}".format(*sys.version_info)
    if recorded == here:
        return ""
    return "it was recorded by mount-gateway {} on Python {}, and this is {} on {}".format(*recorded, *here)


async def _retrace(recording: Recording) -> Outcome:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, RetracedLoop)
    played = Retracing(_gateway(recording, loop.time), loop)
    await played.run(recording)
    return Outcome(played.clients, played.replies, played.wire.requests, played.differences, played.wire.strayed)


def _gateway(recording: Recording, clock: Callable[[], float]) -> Gateway:
    """Set up the gateway that was recorded. Raises UserError."""
    config = recording.settings["config"]
    try:
        mount = msgspec.convert(config["mount"], MountConfig)
        told = [{"hold-text": False, **surface} for surface in config["surface"]]  # a key that older versions lack
        surfaces = msgspec.convert(told, list[SurfaceConfig])
        past = msgspec.convert(recording.settings["past"], PreviousRun, str_keys=True)
    except (msgspec.ValidationError, KeyError, TypeError) as error:
        raise UserError(f"recording: its settings do not suit this version of mount-gateway: {error}") from None
    gateway = Gateway(mount, surfaces, clock=clock)
    gateway.previous_run, gateway.rules = past, recording.settings.get("rules", FIRST_RULES)
    return gateway


async def _replay(recording: Recording, events: list[Event]) -> Outcome:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, RecordedLoop)

    def now() -> float:
        return loop.time() - loop.began

    wire = RecordedWire(events, now)
    gateway = _gateway(recording, lambda: float(recording.settings["began"]) + now())
    queues: list[RecordedQueue] = []

    def line(reply_rules: ReplyRules, wire_log: WireLog) -> MountLink:
        queues.append(RecordedQueue(wire, reply_rules))
        return MountLink(wire, reply_rules, wire_log, queues[0])

    gateway.prepare(line)
    gateway.controller.driver.exchanges = exchanges(recording)
    clients = _Clients(gateway)
    gateway.begin(refresh=False)  # the recording decides when the mount is polled
    asked = 0
    for cause, requests in _causes(events):
        await loop.until(cause.at)
        at_once = sum(at <= cause.at + ROUNDED for at in requests)
        queues[0].allow(at_once)
        if cause.side == MOUNT:
            _mount(cause, asked, gateway, wire)
        elif cause.arrow == "r":
            gateway.controller.spawn(gateway.controller.poller.renew(getattr(op, cause.data.decode())))
        else:
            clients.play(cause)
        await _rest()
        for at in requests[at_once:]:
            await loop.until(at)
            queues[0].allow(1)
            await _rest()
        asked += len(requests)
    await asyncio.sleep(AFTERWARDS)
    await gateway.close()
    total = sum(1 for event in events if event.side == MOUNT and event.arrow == ">")
    replies = sum(1 for event in events if event.side != MOUNT and event.arrow == "<")
    return Outcome(len(clients.all), replies, total, clients.compare(events), wire.strayed)


def replay_on_simulator(recording: Recording, show: Callable[[str], object]) -> None:
    """Replay the clients on a simulated mount of the recorded kind and show every line of the conversation."""
    run(_on_simulator(recording, show))


async def _on_simulator(recording: Recording, show: Callable[[str], object]) -> None:
    loop = asyncio.get_running_loop()
    began = loop.time()
    ahead = float(recording.settings["began"]) - began
    gateway = _gateway(recording, lambda: loop.time() + ahead)
    rows = Rows(gateway.mount.protocol, [endpoint.protocol for endpoint in gateway.endpoints])

    def put(entry: Entry) -> None:
        for row in rows.take(entry):
            show(plain(row))

    gateway.wire_log.sinks.append(put)
    simulator = make_simulator(gateway.mount, clock=gateway.clock, site=gateway.config.site or DEFAULT_SITE)
    gateway.prepare(
        lambda reply_rules, wire_log: MountLink(SimulatedTransport("sim", simulator.connection), reply_rules, wire_log)
    )
    gateway.sky.load()
    clients = _Clients(gateway)
    gateway.begin()
    for event in recording:
        await asyncio.sleep(max(0.0, event.at + began - loop.time()))
        if event.side != MOUNT:
            clients.play(event)
    await asyncio.sleep(AFTERWARDS)
    await gateway.close()


def _causes(events: list[Event]) -> Iterator[tuple[Event, list[float]]]:
    """Yield each event from outside with the times of the requests to the mount until the next one."""
    cause: Event | None = None
    requests: list[float] = []
    for event in events:
        if event.side == MOUNT and event.arrow == ">":
            requests.append(event.at)
        elif event.arrow in ("<^v!" if event.side == MOUNT else "+->er"):
            if cause is not None:
                yield cause, requests
            cause, requests = event, []
    if cause is not None:
        yield cause, requests


async def _rest() -> None:
    """Let everything that one event triggered finish."""
    for _ in range(TURNS):
        await asyncio.sleep(0)


def _mount(event: Event, asked: int, gateway: Gateway, wire: RecordedWire) -> None:
    """Replay an event of the mount, which happened after ``asked`` requests."""
    match event.arrow:
        case "<":
            wire.deliver(asked, event.data)
        case "v":
            wire.lost(event)
        case "!" if event.data == SKY_READY.encode():
            gateway.sky.load()


class _Clients:
    """The recorded connections by name; a name may be reused after its connection has ended."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._here: dict[str, ReplayedConnection] = {}
        self.all: list[ReplayedConnection] = []

    def play(self, event: Event) -> None:
        """Replay an event of a client."""
        if event.arrow == "+":
            talk = self._here[event.side] = ReplayedConnection(event.side)
            talk.come(self._gateway, event)
            self.all.append(talk)
        elif event.arrow in (">", "e", "-") and event.side in self._here:
            self._here[event.side].play(event)
            if event.arrow == "-":
                del self._here[event.side]

    def compare(self, events: list[Event]) -> list[Difference]:
        """Compare what every client received then and now; return one difference for each that differs."""
        then: dict[str, ReplayedConnection] = {}
        talks = iter(self.all)
        for event in events:
            if event.side == MOUNT:
                continue
            if event.arrow == "+":
                then[event.side] = next(talks)
            elif event.arrow == "-":
                then.pop(event.side, None)  # later replies to it were not delivered
            elif event.arrow == "<" and event.side in then:
                then[event.side].was_told(event)
                then[event.side].compare(less=True)
        for talk in self.all:
            talk.compare(more=True)
        return [talk.difference for talk in self.all if talk.difference is not None]
