"""One command, played: what it came to mean, what went to the mount, what was said in the log, and the reply.

A play is a value. Commands that the gateway sends on its own account while nobody asks for anything (it looks where the
mount points) are part of it only as far as they come before the reply; what changes the mount is always part of it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import DEFAULT_SITE
from gateway.astro.ephemeris.sky import Sky
from gateway.core.operations import Read, named
from gateway.core.wire_log import Entry
from gateway.diagnostics.rehearsal.meaning import meaning
from gateway.diagnostics.rehearsal.samples import START
from gateway.diagnostics.rehearsal.stage import Stage, Visitor
from gateway.protocols.base.driver import Driver
from gateway.protocols.base.session import Session
from gateway.protocols.base.wants import (
    Defer,
    FireAndForget,
    Handling,
    Possible,
    ReuseLastReading,
    Speed,
    Want,
    relayed,
)
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import CommandSet, load

#: How long a reply may take, seconds.
PATIENCE = 30.0
#: How long a command is watched after its reply that may change the mount; a setting waits for its other half.
WATCHED, WATCHED_SETTING = 2.0, 8.0
#: How long what has no reply takes to reach the mount, seconds.
BEGUN = 1.0
#: Rehearsed slews are so much faster than real ones.
HURRY = 10.0
#: How long a mount may be under way before a command, seconds.
ARRIVED = 300.0
#: How long anything at all takes to begin: what is only read has been asked for by then.
GLANCE = 0.4
_STEP = 0.05


class Event(NamedTuple):
    """``kind`` is means, baud, act (it changes the mount), look (it does not), answer (the mount's), note or reply."""

    kind: str
    words: str
    data: bytes = b""


class Before(NamedTuple):
    """What a program has said: ``after`` which the mount came to rest, and ``during`` what then goes on."""

    after: tuple[bytes, ...] = ()
    during: tuple[bytes, ...] = ()


class Play(NamedTuple):
    """All that came of one frame, in order; ``wire`` is what the mount itself heard that changes it."""

    frame: bytes
    events: tuple[Event, ...]
    reply: bytes
    wire: tuple[bytes, ...]
    #: Whether something that clients have said is otherwise than before, and whether the driver knows anything new.
    kept: bool
    learnt: bool

    @property
    def lines(self) -> bytes:
        """What ``explain`` shows of what changes the mount."""
        return b"".join(event.data for event in self.of("act"))

    def of(self, kind: str) -> tuple[Event, ...]:
        return tuple(event for event in self.events if event.kind == kind)


@cache
def looks(protocol: str) -> frozenset[str]:
    """The commands of a mount that only ask: those by which reads are carried out, and nothing else is."""
    reads: set[str] = set()
    for name, ways in load(protocol).driver.items():
        kind = named(name)
        if kind is not None and issubclass(kind, Read):
            reads |= {command for way in ways for command in way.commands}
    return frozenset(name for name in reads if load(protocol).commands[name].replies)


def is_look(protocol: CommandSet, data: bytes) -> bool:
    found = protocol.find(data)
    return found is not None and found[0].name in looks(protocol.name)


def stage(face: Endpoint, mount: Endpoint, sky: Sky, *, aligned: bool = True, wedge: bool = False) -> Stage:
    """The gateway between a presented model and a simulated mount, each with its version, in the night of ``START``.

    What old mounts do not tell is in the settings: name, site, and on a wedge the tracking mode.
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
        simulated=spec.rehearsed_with(wedge),
    )


async def _until(reached: Callable[[], bool], seconds: float) -> None:
    """Wait for it, no longer than so many seconds."""
    loop = asyncio.get_running_loop()
    end = loop.time() + seconds
    while not reached() and loop.time() < end:
        await asyncio.sleep(_STEP)


class Player:
    """Plays frames on one stage, each as a connection of its own."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.driver: Driver = stage.driver
        self._events: list[Event] = []
        self._visitors = 0
        self._session: Session | None = None
        #: What was kept when the frame came.
        self._before = ""
        surface, handle = stage.face.surface, stage.face.surface.handle
        surface.subscriptions = lambda session: ()  # what is heard is the answer
        surface.handle = lambda session, frame: self._told(session, handle(session, frame))  # type: ignore[method-assign]
        stage.wire_log.sinks.append(self._note)

    async def play(self, frame: bytes, before: Before = Before(), watched: float = WATCHED_SETTING) -> Play:
        """Say ``before``, one after the other, then the frame; ``watched`` seconds are looked on after its answer."""
        self._visitors += 1
        visitor = self.stage.client(f"rehearsal{self._visitors}")
        for said in before.after:
            visitor.tell(said)
            await self._settled(visitor, 0.0)
            await asyncio.sleep(BEGUN)
            await self._at_rest()
        for said in before.during:
            visitor.tell(said)
            await self._settled(visitor, BEGUN)
        self._session, self._before = None, ""
        known, wire = self._known(), len(self.stage.wire)
        self._events.clear()
        visitor.heard = b""
        visitor.tell(frame)
        await self._settled(visitor, 0.0)
        reply = visitor.heard
        self._events.append(Event("reply", "", reply))
        await asyncio.sleep(watched)
        protocol = self.driver.protocol
        acts = tuple(data for data in self.stage.wire[wire:] if not is_look(protocol, data))
        return Play(frame, tuple(self._events), reply, acts, self._before != self._kept(), known != self._known())

    async def _settled(self, visitor: Visitor, least: float) -> None:
        """Until everything said was answered, and no longer than a program waits."""
        await asyncio.sleep(least)
        await _until(lambda: visitor.answered, PATIENCE)

    async def _at_rest(self) -> None:
        """Until the mount has come to where it was sent, and the gateway has seen it there."""
        await _until(lambda: not (self.stage.sim.slewing or self.stage.controller.reconciler.busy), ARRIVED)

    def _kept(self) -> str:
        """What this client and all of them together keep, as one comparable text."""
        return "" if self._session is None else repr((self._session.kept, self._session.shared))

    def _known(self) -> str:
        """The same of the driver and of who knows site and time."""
        return repr((vars(self.driver), vars(self.stage.site_clock)))

    def _told(self, session: Session, steps: Handling) -> Handling:
        """The same command, each operation noted as it is asked for."""
        if self._session is None:
            self._session = session
            self._before = self._kept()
        return relayed(steps, self._ask)

    def _ask(self, wanted: Want) -> bool:
        """Note it; it is asked for all the same."""
        if isinstance(wanted, Speed):
            self._events.append(Event("baud", str(wanted.baud)))
        elif not isinstance(wanted, Defer | Possible):
            operation = wanted.operation if isinstance(wanted, FireAndForget | ReuseLastReading) else wanted
            self._events.append(Event("means", meaning(operation)))
        return False

    def _note(self, entry: Entry) -> None:
        """What the wire log takes down, as far as it belongs to a command."""
        if entry.arrow == "!":
            self._events.append(Event("note", entry.note))
        elif entry.side == "mount" and entry.arrow == ">":
            kind = "look" if is_look(self.driver.protocol, entry.data) else "act"
            self._events.append(Event(kind, "", entry.data))
        elif entry.side == "mount" and entry.arrow == "<":
            self._events.append(Event("answer", "", entry.data))
