"""Send a command through a rehearsal gateway and record its meaning, commands to the mount, log notes and the reply.

The record is called a trace. It ends some seconds after the reply. It also contains the queries that the gateway sends
for itself (it polls the position), before and after the reply.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import DEFAULT_SITE
from gateway.astro.ephemeris.sky import Sky
from gateway.core.errors import Unsupported
from gateway.core.operations import Read, operation_class
from gateway.core.wire_log import Entry
from gateway.diagnostics.rehearsal.meaning import meaning
from gateway.diagnostics.rehearsal.samples import START_TIME
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.protocols.base.driver import Driver
from gateway.protocols.base.surface import ACKNOWLEDGED, Surface
from gateway.protocols.base.wants import (
    ChangeBaudRate,
    CheckPossible,
    Defer,
    FireAndForget,
    Note,
    ReuseLastReading,
    SurfaceStep,
    relay_requests,
)
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet

#: Timeout of a reply, seconds.
REPLY_TIMEOUT = 30.0
#: Seconds after the reply for which a command that may change the mount is observed; settings may be delayed.
OBSERVATION_TIME, SETTING_OBSERVATION_TIME = 2.0, 8.0
#: How long a command without a reply may take to reach the mount, seconds.
BACKGROUND_TIMEOUT = 1.0
#: The factor by which rehearsed slews are faster than real ones.
SLEW_SPEEDUP = 10.0
#: How long a slew before the command may take, seconds.
SLEW_TIMEOUT = 300.0
#: How long a query is observed, seconds: by then it has been sent to the mount.
QUERY_OBSERVATION_TIME = 0.4
_CHECK_PERIOD = 0.05


class TraceStep(NamedTuple):
    """A step of a trace. ``kind``: means (the operation), baud (a new rate), act (a command that changes the mount),
    look (a query to the mount), answer (the mount's), note (a log entry) or reply (to the client).
    """

    kind: str
    text: str
    data: bytes = b""


class Prelude(NamedTuple):
    """Commands sent before a frame: the mount rests after those ``completed``; those ``in_progress`` still act."""

    completed: tuple[bytes, ...] = ()
    in_progress: tuple[bytes, ...] = ()


class Trace(NamedTuple):
    """All events after a frame was sent, in order; ``changing_commands`` are the commands that reached the mount and
    change it; ``refused``: whether the log has counted a refusal.
    """

    frame: bytes
    events: tuple[TraceStep, ...]
    reply: bytes
    changing_commands: tuple[bytes, ...]
    refused: bool = False

    def steps_of_kind(self, kind: str) -> tuple[TraceStep, ...]:
        return tuple(event for event in self.events if event.kind == kind)


def observation_time(command: Command, aligned: bool) -> float:
    """Return how many seconds a command is observed after its reply; longer unless ``aligned``, for late settings."""
    return QUERY_OBSERVATION_TIME if command.is_query else OBSERVATION_TIME if aligned else SETTING_OBSERVATION_TIME


def may_change_mount(name: str) -> bool:
    """Whether an operation of this name may change the mount."""
    kind = operation_class(name)
    return kind is not None and not issubclass(kind, Read)


def is_refused(trace: Trace, command: Command, surface: Surface) -> bool:
    """Whether a command was refused: by its reply, or if that is empty or a mere acknowledgement, by the log."""
    return is_refusal(command, trace.reply, surface, trace.frame) or (
        trace.refused and trace.reply in (b"", ACKNOWLEDGED)
    )


def is_refusal(command: Command, reply: bytes, surface: Surface, frame: bytes) -> bool:
    """Whether a reply is one of the command's refusals, or the surface's; False if it is empty."""
    forms = [form for answer, form in command.replies if answer.fault]
    if not reply:
        return False
    recognised = any(form.matcher.fullmatch(reply) for form in forms) or surface.is_refusal(reply)
    return recognised or reply == general_refusal(surface, frame)


def general_refusal(surface: Surface, frame: bytes) -> bytes:
    """Return the surface's refusal of a command that no mount has; empty if the protocol has no refusal."""
    reply = surface.fallback_reply(frame, Unsupported())
    return b"" if reply == ACKNOWLEDGED else reply


@cache
def query_commands(protocol: CommandSet) -> frozenset[str]:
    """Return the names of the commands that only query the mount: those of reading operations, if they have replies."""
    reads: set[str] = set()
    for name, ways in protocol.driver_rows.items():
        kind = operation_class(name)
        if kind is not None and issubclass(kind, Read):
            reads |= {command for way in ways for command in way.commands}
    return frozenset(name for name in reads if protocol.commands[name].replies)


def is_query(protocol: CommandSet, data: bytes) -> bool:
    match = protocol.find(data)
    return match is not None and match[0].name in query_commands(protocol)


def set_up_gateway(
    surface: Endpoint, mount: Endpoint, sky: Sky, *, aligned: bool = True, wedge: bool = False, missing: str = ""
) -> RehearsalGateway:
    """Return a gateway between a presented model and a simulated mount, each with its version, at ``START_TIME``.

    ``missing`` names a part that the simulated mount lacks. The gateway's settings state what old mounts do not
    report: model, site, and on a wedge the tracking mode.
    """
    spec = PROTOCOLS[mount.protocol]
    return RehearsalGateway(
        mount.model or spec.default_model,
        mount.version,
        start=START_TIME,
        driven=mount.protocol,
        presented=surface.protocol,
        surface=surface.model,
        surface_version=surface.version,
        aligned=aligned,
        sky=sky,
        speed=SLEW_SPEEDUP,
        named=True,
        config={"site": DEFAULT_SITE} | ({"mode": "eq-north"} if wedge else {}),
        simulated={name: has for name, has in spec.rehearsal_settings(wedge).items() if name != missing},
    )


async def _wait_until(condition: Callable[[], bool], timeout: float) -> None:
    """Wait until the condition holds, for so many seconds at most."""
    loop = asyncio.get_running_loop()
    end = loop.time() + timeout
    while not condition() and loop.time() < end:
        await asyncio.sleep(_CHECK_PERIOD)


class Tracer:
    """Sends frames through one rehearsal gateway, each on a new connection, and returns their traces."""

    def __init__(self, rehearsal: RehearsalGateway) -> None:
        self.rehearsal = rehearsal
        self.driver: Driver = rehearsal.driver
        self.surface = surface = rehearsal.binding.surface
        self._events: list[TraceStep] = []
        self._client_count = 0
        handle = surface.handle
        surface.subscriptions = lambda session: ()  # so that all bytes received are the reply
        surface.handle = lambda session, frame: relay_requests(handle(session, frame), self._note_request)  # type: ignore[method-assign]
        rehearsal.wire_log.sinks.append(self._note_entry)

    async def trace(
        self, frame: bytes, prelude: Prelude = Prelude(), seconds: float = SETTING_OBSERVATION_TIME
    ) -> Trace:
        """Send the commands of ``prelude``, then the frame; observe for some seconds after its reply."""
        self._client_count += 1
        visitor = self.rehearsal.client(f"rehearsal{self._client_count}")
        for command in prelude.completed:
            visitor.send(command)
            await self._wait_for_replies(visitor, 0.0)
            await asyncio.sleep(BACKGROUND_TIMEOUT)
            await self._wait_for_rest()
        for command in prelude.in_progress:
            visitor.send(command)
            await self._wait_for_replies(visitor, BACKGROUND_TIMEOUT)
        self.before_frame()
        sent_before, refusals = len(self.rehearsal.rx_data), self.rehearsal.wire_log.refusal_count
        self._events.clear()
        visitor.received = b""
        visitor.send(frame)
        await self._wait_for_replies(visitor, 0.0)
        reply = visitor.received
        self._events.append(TraceStep("reply", "", reply))
        await asyncio.sleep(seconds)
        protocol = self.driver.protocol
        acts = tuple(data for data in self.rehearsal.rx_data[sent_before:] if not is_query(protocol, data))
        return Trace(frame, tuple(self._events), reply, acts, refusals != self.rehearsal.wire_log.refusal_count)

    def before_frame(self) -> None:
        """For subclasses: called after the preceding commands, before the frame that is traced."""

    async def _wait_for_replies(self, client: RehearsalClient, min_wait: float) -> None:
        """Wait ``min_wait`` seconds, then until every expected reply has come, for `REPLY_TIMEOUT` at most."""
        await asyncio.sleep(min_wait)
        await _wait_until(lambda: client.all_answered, REPLY_TIMEOUT)

    async def _wait_for_rest(self) -> None:
        """Wait until no goto is under way and the gateway has noticed that, for `SLEW_TIMEOUT` at most."""
        await _wait_until(
            lambda: not (self.rehearsal.sim.slewing or self.rehearsal.controller.reconciler.busy), SLEW_TIMEOUT
        )

    def _note_request(self, request: SurfaceStep) -> bool:
        """Record a request of the surface; return False, so that it is also carried out."""
        if isinstance(request, ChangeBaudRate):
            self._events.append(TraceStep("baud", str(request.baud)))
        elif not isinstance(request, Defer | CheckPossible | Note):
            operation = request.operation if isinstance(request, FireAndForget | ReuseLastReading) else request
            self._events.append(TraceStep("means", meaning(operation)))
        return False

    def _note_entry(self, entry: Entry) -> None:
        """Record the wire log entries that belong to a trace: notes, and commands and replies of the mount."""
        if entry.arrow == "!":
            self._events.append(TraceStep("note", entry.note))
        elif entry.side == "mount" and entry.arrow == ">":
            kind = "look" if is_query(self.driver.protocol, entry.data) else "act"
            self._events.append(TraceStep(kind, "", entry.data))
        elif entry.side == "mount" and entry.arrow == "<":
            self._events.append(TraceStep("answer", "", entry.data))
