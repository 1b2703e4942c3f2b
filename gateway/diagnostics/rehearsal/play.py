"""Play one command and note its meaning, what is sent to the mount, what is logged, and the reply.

A play is a value. Queries that the gateway sends for itself (it polls the position) are part of it only if they come
before the reply; commands that change the mount are always part of it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import DEFAULT_SITE
from gateway.astro.ephemeris.sky import Sky
from gateway.core.motion_kinds import ENDS
from gateway.core.operations import Operation, Read, Values, named
from gateway.core.wire_log import Entry
from gateway.diagnostics.rehearsal.meaning import meaning
from gateway.diagnostics.rehearsal.samples import START
from gateway.diagnostics.rehearsal.stage import Stage, Visitor
from gateway.protocols.base.driver import Driver
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import Ending
from gateway.protocols.base.wants import (
    ChangeBaudRate,
    CheckPossible,
    Defer,
    FireAndForget,
    Handling,
    Note,
    ReuseLastReading,
    SurfaceStep,
    relayed,
)
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet

#: Timeout of a reply, seconds.
PATIENCE = 30.0
#: How long a command that may change the mount is observed after its reply, seconds; a setting may wait for another.
WATCHED, WATCHED_SETTING = 2.0, 8.0
#: How long a command without a reply may take to reach the mount, seconds.
MAX_BACKGROUND = 1.0
#: By what factor rehearsed slews are faster than real ones.
HURRY = 10.0
#: How long a slew before the command may take, seconds.
ARRIVED = 300.0
#: How long a query is observed, seconds: by then it has been sent to the mount.
GLANCE = 0.4
_STEP = 0.05


class PlayedStep(NamedTuple):
    """``kind`` is means, baud, act (changes the mount), look (queries it), answer (the mount's), note or reply."""

    kind: str
    words: str
    data: bytes = b""


class Before(NamedTuple):
    """What a program sends first: after each of ``after`` the mount comes to rest, ``during`` is still in progress."""

    after: tuple[bytes, ...] = ()
    during: tuple[bytes, ...] = ()


class Play(NamedTuple):
    """Everything that one frame caused, in order; ``wire`` are the received commands that change the mount."""

    frame: bytes
    events: tuple[PlayedStep, ...]
    reply: bytes
    wire: tuple[bytes, ...]
    #: Whether something kept for clients has changed, and whether the driver's knowledge has.
    kept: bool
    learnt: bool
    #: The operations that the surface asked for, and those that changed the mount on its behalf; each once.
    asked: tuple[str, ...] = ()
    #: Whether the reply was made of what is kept for clients; whether the log counts a refusal.
    tells: bool = False
    refused: bool = False

    @property
    def lines(self) -> bytes:
        """The commands shown by ``explain`` that change the mount."""
        return b"".join(event.data for event in self.of("act"))

    def of(self, kind: str) -> tuple[PlayedStep, ...]:
        return tuple(event for event in self.events if event.kind == kind)


def watched(command: Command, aligned: bool) -> float:
    """Return how long a command is observed after its reply, seconds."""
    return GLANCE if command.question else WATCHED if aligned else WATCHED_SETTING


@cache
def looks(protocol: CommandSet) -> frozenset[str]:
    """Return the commands of a mount that are only queries: those that carry out reads."""
    reads: set[str] = set()
    for name, ways in protocol.driver.items():
        kind = named(name)
        if kind is not None and issubclass(kind, Read):
            reads |= {command for way in ways for command in way.commands}
    return frozenset(name for name in reads if protocol.commands[name].replies)


def is_look(protocol: CommandSet, data: bytes) -> bool:
    found = protocol.find(data)
    return found is not None and found[0].name in looks(protocol)


def stage(
    face: Endpoint, mount: Endpoint, sky: Sky, *, aligned: bool = True, wedge: bool = False, lacking: str = ""
) -> Stage:
    """Return a gateway between a presented model and a simulated mount, each with its version, at the time ``START``.

    ``lacking`` is a part of the simulated mount that this one has not.
    What old mounts do not report is in the settings: name, site, and on a wedge the tracking mode.
    """
    spec = PROTOCOLS[mount.protocol]
    return Stage(
        mount.model or spec.default_model,
        mount.version,
        start=START,
        driven=mount.protocol,
        presented=face.protocol,
        surface=face.model,
        surface_version=face.version,
        aligned=aligned,
        sky=sky,
        speed=HURRY,
        named=True,
        config={"site": DEFAULT_SITE} | ({"mode": "eq-north"} if wedge else {}),
        simulated={name: has for name, has in spec.rehearsed_with(wedge).items() if name != lacking},
    )


async def _until(reached: Callable[[], bool], seconds: float) -> None:
    """Wait until the condition holds, for so many seconds at most."""
    loop = asyncio.get_running_loop()
    end = loop.time() + seconds
    while not reached() and loop.time() < end:
        await asyncio.sleep(_STEP)


class Player:
    """Plays frames on one stage, each as a connection of its own."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.driver: Driver = stage.driver
        self._events: list[PlayedStep] = []
        self._visitors = 0
        self._session: Session | None = None
        #: What was kept when the frame arrived.
        self._before = ""
        self._asked: dict[str, None] = {}
        self._tells = False
        surface, handle, self._call = stage.face.surface, stage.face.surface.handle, stage.face.surface.call
        perform, ending = self.driver.perform, surface.ending
        surface.subscriptions = lambda session: ()  # so that all bytes received are the reply
        surface.handle = lambda session, frame: self._told(session, handle(session, frame))  # type: ignore[method-assign]
        surface.call = self._called  # type: ignore[method-assign]
        surface.ending = lambda session, frame: self._ended(ending(session, frame))  # type: ignore[method-assign]
        self.driver.perform = lambda operation: perform(self._performed(operation))  # type: ignore[method-assign, arg-type]
        stage.wire_log.sinks.append(self._note)

    async def play(self, frame: bytes, before: Before = Before(), watching: float = WATCHED_SETTING) -> Play:
        """Send ``before`` one by one, then the frame, and observe for ``watching`` seconds after its reply."""
        self._visitors += 1
        visitor = self.stage.client(f"rehearsal{self._visitors}")
        for said in before.after:
            visitor.tell(said)
            await self._settled(visitor, 0.0)
            await asyncio.sleep(MAX_BACKGROUND)
            await self._at_rest()
        for said in before.during:
            visitor.tell(said)
            await self._settled(visitor, MAX_BACKGROUND)
        self._session, self._before = None, ""
        known, wire = self._known(), len(self.stage.wire)
        self._events.clear()
        self._asked.clear()
        self._tells, refusals = False, self.stage.wire_log.refusals
        visitor.heard = b""
        visitor.tell(frame)
        await self._settled(visitor, 0.0)
        reply = visitor.heard
        self._events.append(PlayedStep("reply", "", reply))
        await asyncio.sleep(watching)
        protocol = self.driver.protocol
        acts = tuple(data for data in self.stage.wire[wire:] if not is_look(protocol, data))
        return Play(
            frame,
            tuple(self._events),
            reply,
            acts,
            self._before != self._kept(),
            known != self._known(),
            tuple(self._asked),
            self._tells,
            refusals != self.stage.wire_log.refusals,
        )

    async def _settled(self, visitor: Visitor, least: float) -> None:
        """Wait until everything sent was answered, at most as long as a program waits."""
        await asyncio.sleep(least)
        await _until(lambda: visitor.answered, PATIENCE)

    async def _at_rest(self) -> None:
        """Wait until the mount has arrived and the gateway has seen it there."""
        await _until(lambda: not (self.stage.sim.slewing or self.stage.controller.reconciler.busy), ARRIVED)

    def _kept(self) -> str:
        """Return what is kept for this client and for all clients, as comparable text."""
        return "" if self._session is None else repr((self._session.kept, self._session.shared))

    def _known(self) -> str:
        """Return what the driver and the site clock know, as comparable text."""
        return repr((vars(self.driver), vars(self.stage.site_clock)))

    def _told(self, session: Session, steps: Handling) -> Handling:
        """Handle the command and note each operation that it requests."""
        if self._session is None:
            self._session = session
            self._before = self._kept()
        return relayed(steps, self._ask)

    def _ask(self, wanted: SurfaceStep) -> bool:
        """Note a request; return False, as it is carried out as well."""
        if isinstance(wanted, ChangeBaudRate):
            self._events.append(PlayedStep("baud", str(wanted.baud)))
        elif not isinstance(wanted, Defer | CheckPossible | Note):
            operation = wanted.operation if isinstance(wanted, FireAndForget | ReuseLastReading) else wanted
            self._events.append(PlayedStep("means", meaning(operation)))
        return False

    def _ended(self, ending: Ending | None) -> Ending | None:
        """Note the operation of a command that ends something on its arrival."""
        if ending is not None:
            self._asked[type(ending.operation).__name__] = None
        return ending

    def _performed(self, operation: Operation) -> Operation:
        """Note an operation that changes the mount, also one made of another one; not the end of a pulse."""
        name = type(operation).__name__
        if not isinstance(operation, (Read, *ENDS)) and named(name) is not None:
            self._asked[name] = None
        return operation

    def _called(self, name: str, session: Session, command: Command | None, values: Values) -> Handling:
        """Run the function of a row: note what it asks for, and whether it looks at what is kept."""
        kind, player = type(session), self

        class Watched(kind):  # type: ignore[misc, valid-type]
            def __getattribute__(self, name: str) -> object:
                player._tells |= name in ("kept", "common")
                return super().__getattribute__(name)

        session.__class__ = Watched
        try:
            return (yield from relayed(self._call(name, session, command, values), self._asks))
        finally:
            session.__class__ = kind

    def _asks(self, wanted: SurfaceStep) -> bool:
        """Note the operation of a request; return False, as it is carried out as well."""
        operation = getattr(wanted, "operation", wanted)
        if isinstance(operation, Operation) and not isinstance(wanted, CheckPossible):
            self._asked[type(operation).__name__] = None
        return False

    def _note(self, entry: Entry) -> None:
        """Note the entries of the wire log that belong to a command."""
        if entry.arrow == "!":
            self._events.append(PlayedStep("note", entry.note))
        elif entry.side == "mount" and entry.arrow == ">":
            kind = "look" if is_look(self.driver.protocol, entry.data) else "act"
            self._events.append(PlayedStep(kind, "", entry.data))
        elif entry.side == "mount" and entry.arrow == "<":
            self._events.append(PlayedStep("answer", "", entry.data))
