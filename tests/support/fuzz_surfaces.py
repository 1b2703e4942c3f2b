"""Random bytes into every surface, through a whole gateway to a simulated mount, on virtual time.

Noise, real conversations with errors in them, and commands with arguments at their limits, cut at random. It looks for
exceptions and internal errors, replies that the command cannot have or that have no request, requests that are not one
whole command of the mount's protocol, anything that grows or never ends, and bytes that take long.
"""

from __future__ import annotations

import asyncio
import gc
import time
import tracemalloc
from collections import Counter
from random import Random
from typing import Any, NamedTuple

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.commands.turn import MAX_CACHED_REPLIES, MAX_WAITING_COMMANDS
from gateway.core.wire_log import MAX_NOTES_LOGGED_ONCE, Entry
from gateway.diagnostics.virtual_time import run
from gateway.mount.policy import Limits
from gateway.protocols.nexstar.versions import versions_of
from gateway.protocols.wireformat.command_set import load
from tests.support.fuzz_bytes import KINDS, packets, thrown
from tests.support.fuzz_forms import PROTOCOLS, of_reply, of_request
from tests.support.in_process_gateway import Bridge

#: The fraction of a surface's bytes for each kind, and the number of bytes in one connection.
CONNECTION = {"noise": 40_000, "mutated": 4_000, "limits": 4_000}
#: How much one client, and all clients together, may keep: characters of its representation.
KEPT = 8_000
#: Seconds until the last request must have ended, carried out or refused.
PATIENCE = 1200.0
#: Seconds of processor time that one packet may take, including what the gateway does meanwhile.
LONGEST = 5.0


class Case(NamedTuple):
    """A surface, and the mount behind it."""

    presented: str
    model: str
    version: str | None
    driven: str
    mount: str

    def __str__(self) -> str:
        version = f" {self.version}" if self.version else ""
        return f"{self.presented}:{self.model}{version} on {self.driven}:{self.mount}"


def cases() -> list[Case]:
    """Return every model that can be presented, on a mount of either kind.

    NexStar models come in their oldest and newest versions, and with a StarSense if one can replace the hand control.
    """
    mounts = (("nexstar", "6-8se"), ("lx200", "autostar"), ("nexstar", "cge"), ("lx200", "lx200gps"))
    faces = [("lx200", model, None) for model in load("lx200").presented_models]
    for model, row in load("nexstar").models.items():
        newest = row["versions"][-1], versions_of(row)[-1]
        faces += [("nexstar", model, version) for version in dict.fromkeys((row["versions"][0], *newest))]
    lx200 = [Case(*face, *mount) for face in faces[:4] for mount in mounts]
    return lx200 + [Case(*face, *mounts[n % 4]) for n, face in enumerate(faces[4:])]


class Judge:
    """Reads the wire log, and counts what must not happen."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.found: Counter[str] = Counter()
        self.first: dict[str, str] = {}
        self.commands = self.replies = self.requests = 0
        self.told: Counter[str] = Counter()
        self._waiting: dict[str, bytes | None] = {}

    def say(self, what: str, about: str = "") -> None:
        """Count a finding; ``about`` is printed for the first of its kind."""
        self.found[what] += 1
        self.first.setdefault(what, about)

    def hear(self, entry: Entry) -> None:
        """Check an entry of the wire log; used as its sink."""
        if entry.arrow == "!" and "internal error" in entry.note:
            self.say(f"{self.case.presented}: internal error {entry.note.rpartition('report it: ')[2]}", entry.note)
        elif entry.arrow == ">" and entry.side == "mount":
            self.requests += 1
            if verdict := of_request(PROTOCOLS[self.case.driven], entry.data):
                self.say(f"{self.case}: {verdict}")
        elif entry.arrow == ">":
            self.commands += 1
            self._waiting[entry.side] = entry.data
        elif entry.arrow == "<" and entry.side != "mount":
            self._reply(entry.side, entry.data)

    def _reply(self, side: str, reply: bytes) -> None:
        self.replies += 1
        self.told[side] += len(reply)
        frame = self._waiting.get(side)
        self._waiting[side] = None
        if frame is None:
            self.say(f"{self.case.presented}: a reply to nothing", repr(reply))
        elif verdict := of_reply(PROTOCOLS[self.case.presented], frame, reply):
            self.say(f"{self.case.presented}: malformed reply to {frame[:3]!r}", f"{self.case}: {frame!r}: {verdict}")

    def weigh(self, bridge: Bridge, client: CommandProcessor) -> None:
        """Check that nothing has grown that may not grow."""
        framer: Any = client.framer
        pending = len(framer._frame if self.case.presented == "lx200" else framer._pending)
        for what, size, most in (
            ("inbox", len(client._inbox), MAX_WAITING_COMMANDS),
            ("memo", len(client._reply_cache._replies), MAX_CACHED_REPLIES), ("framer", pending, 64),
            ("kept", len(repr(client.session.client)), KEPT), ("shared", len(repr(client.session.shared)), KEPT),
            ("told", len(client.command_runner._sent_readings), 40),
            ("deferred", len(client.command_runner._deferral_timers), 4),
            ("said", len(bridge.wire_log._notes_logged_once), MAX_NOTES_LOGGED_ONCE),
            ("tasks", len(bridge.controller.context.tasks), 600), ("line", len(bridge.controller.line.queue), 600),
            ("hosts", len(bridge.acceptor._saved_states), 200),
        ):  # fmt: skip
            if size > most:
                self.say(f"{self.case.presented}: {what} has grown", f"{size}, at most {most}")


SKY = Sky()


async def throw(case: Case, kind: str, rng: Random, size: int, judge: Judge) -> tuple[int, float]:
    """Send this many bytes to one gateway; return (bytes sent, the longest seconds that a packet took)."""
    asyncio.get_running_loop().set_exception_handler(
        lambda _, context: judge.say(f"{case.presented}: unhandled: {context.get('exception') or context['message']!r}",
                                     f"{case}: {context!r}"))  # fmt: skip
    bridge = Bridge(
        case.mount,
        driven=case.driven,
        presented=case.presented,
        surface=case.model,
        latency=rng.choice([0.0, 0.02]),
        aligned=rng.random() < 0.8,
    )
    endpoint = Endpoint(case.presented, "-", case.model, case.version)
    face = make_surface(endpoint, SurfaceConfig(at="-"), Limits())
    face.surface.speaks_mount_protocol = case.presented == case.driven
    bridge.acceptor.binding = face
    bridge.controller.astrometry.sky = SKY
    bridge.wire_log.sinks[:] = [judge.hear]
    done, longest, number = 0, 0.0, 0
    clients: list[CommandProcessor] = []
    async with bridge:
        while done < size:
            number += 1
            visitor = bridge.client(f"host {number % 8}:{number}")
            client: CommandProcessor = getattr(visitor.connection, "client")  # noqa: B009
            clients.append(client)
            for packet in packets(rng, thrown(rng, kind, case.presented, min(CONNECTION[kind], size - done))):
                began = time.process_time()  # other programs do not count
                visitor.send(packet)
                await asyncio.sleep(rng.choices([0.0, 0.01, 0.2], [40, 10, 1 if kind == "noise" else 5])[0])
                longest = max(longest, time.process_time() - began)
                done += len(packet)
            await asyncio.sleep(rng.choice([0.1, 0.5, 5.0]))
            judge.weigh(bridge, client)
            if len(visitor.received) != judge.told[client.log.name]:
                judge.say(f"{case.presented}: replies that are not in the wire log", case.model)
            visitor.close()
        await asyncio.sleep(5.0)
        began = bridge.controller.now()
        while any(client.has_running_operations for client in clients):
            if bridge.controller.now() - began > PATIENCE:
                judge.say(f"{case.presented}: requests do not end", f"{case}, {kind}")
                break
            await asyncio.sleep(10.0)
    return done, longest


def growth(seed: int, size: int = 60_000) -> dict[str, float]:
    """Measure the bytes of memory that stay per byte sent, for either surface on either mount. It takes long."""

    async def program(case: Case) -> float:
        rng = Random(seed)
        bridge = Bridge(case.mount, driven=case.driven, presented=case.presented, surface=case.model)
        bridge.wire_log.sinks.clear()
        asyncio.get_running_loop().set_exception_handler(lambda *_: None)  # `throw` looks for these
        async with bridge:
            visitor, marks = bridge.client(), []
            for n in range(15):
                for packet in packets(rng, thrown(rng, KINDS[n % 3], case.presented, size // 6)):
                    visitor.send(packet)
                    await asyncio.sleep(0.02)
                visitor.received = b""
                await asyncio.sleep(60.0)
                gc.collect()  # a fault and its traceback refer to each other
                marks.append(tracemalloc.get_traced_memory()[0])
        return (min(marks[12:]) - min(marks[6:9])) / size  # everything loaded once has been loaded by then

    tracemalloc.start()
    figures = {}
    for case in {(case.presented, case.driven): case for case in reversed(cases())}.values():
        figures[str(case)] = run(program(case))
    tracemalloc.stop()
    return figures
