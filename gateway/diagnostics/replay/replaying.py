"""Replay a recording: its times are the clock, its mount bytes are the mount, its clients send their commands again.

Every client must receive the recorded bytes. A recording that contains the event loop iterations ("turns") is replayed
turn by turn (``retracing``).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.recording.format import WITHOUT_TURNS, Event, Recording
from gateway.app.simulated import DEFAULT_SITE, make_simulator
from gateway.app.state.store import PreviousRun
from gateway.core.errors import UserError
from gateway.core.wire_log import MOUNT, Entry
from gateway.diagnostics.log.layout import plain
from gateway.diagnostics.log.printing import Rows
from gateway.diagnostics.replay.replies import Difference, ReplayedConnection
from gateway.diagnostics.replay.retraced import RetracedLoop
from gateway.diagnostics.replay.retracing import AFTERWARDS, Retracing
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import MountLink
from gateway.transport.wires import SimulatedTransport


class Outcome(NamedTuple):
    """The result of a replay. ``strayed`` lists where the gateway sent the mount other requests than recorded."""

    clients: int
    replies: int
    requests: int
    differences: list[Difference]
    strayed: list[str]


def replay(recording: Recording) -> Outcome:
    """Replay a recording. Raises UserError if its beginning is missing."""
    if recording.settings["from"]:
        raise UserError(
            f"{recording.parts[0]}: the recording's beginning is missing, it was deleted when the files "
            "became too many (record-keep) or is in files that are not here: it can be decoded, "
            "or replayed with --sim"
        )
    if recording.format == WITHOUT_TURNS:
        raise UserError(f"{recording.parts[0]}: only a recording of a whole run (run --record) can be replayed")
    with asyncio.Runner(loop_factory=RetracedLoop) as runner:
        return runner.run(_retrace(recording))


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
        surfaces = msgspec.convert(config["surface"], list[SurfaceConfig])
        past = msgspec.convert(recording.settings["past"], PreviousRun, str_keys=True)
    except (msgspec.ValidationError, KeyError, TypeError) as error:
        raise UserError(f"recording: its settings do not suit this version of mount-gateway: {error}") from None
    gateway = Gateway(mount, surfaces, clock=clock)
    gateway.previous_run = past
    return gateway


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
