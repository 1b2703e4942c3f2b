"""Driver: operations in, commands out, without I/O.

A driver is a generator machine: ``perform(operation)`` yields what it wants done and is sent the outcome. It may
yield four things only: ``Send`` (send this command, give me its fields), ``Wait`` (give the line to others for a
while), ``Schedule`` (do this operation after some seconds) and ``Remark`` (say this in the log). Rows of
``driver.toml`` with ``send`` are carried out here; those with ``call`` are functions of the protocol's own package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from typing import Any, NamedTuple, TypeVar, cast

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Unsupported
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import Implementation, Model, Version

_T = TypeVar("_T")
#: Outcomes of ways by which nothing is done.
WITHOUT_EFFECT = ("refused", "silent")
#: Seconds between two looks whether a goto has begun whose acknowledgement was lost.
RECHECK_AFTER = 0.5
#: Why there is no guide pulse.
SLEWING = "The mount is slewing: the guide pulse is dropped."


class Send(NamedTuple):
    """Send a command with these field values; answered with the reply's fields, or a Fault is thrown in.

    With ``patience`` (seconds) silence is an answer, too: ``Silence`` is thrown in and the line is not said to be down.
    A ``prompt`` one begins a motion by hand: it waits for no line and no mount that is busy, but is refused.
    A ``long`` one is work that takes the mount up to that many seconds: a stop that needs no answer goes out meanwhile,
    everything else is refused as busy, and silence at the end is a fault of the line.
    A ``raw`` one is answered with the reply's bytes, too, as the field ``raw``. Of a ``light`` one the first answer
    will do: nothing hangs on it. One that is asked ``once`` is believed as it comes: its answer belongs to what was
    sent just before, or to nobody but the program that asked.
    """

    command: str
    values: Mapping[str, object] = {}
    patience: float | None = None
    long: bool = False
    prompt: bool = False
    raw: bool = False
    light: bool = False
    once: bool = False


class Wait(NamedTuple):
    """Wait without holding the line."""

    seconds: float


class Schedule(NamedTuple):
    """Have an operation performed after some seconds; a newer one with the same operation replaces it.

    ``urgent`` operations go to the line like a stop does (the end of a motion that is sent again). A ``heard`` one
    waits while the mount is at a long piece of work, in which it hears nothing but a stop.
    """

    seconds: float
    operation: op.Operation
    urgent: bool = False
    heard: bool = False


class Remark(NamedTuple):
    """Something is done otherwise than it was asked for: said once in the log, in words."""

    text: str


Step = Send | Wait | Schedule | Remark
#: What a driver does, step by step, and what comes of it.
Steps = Generator[Step, Any, Any]
#: A function of a protocol's driver, (state, operation) -> steps: each for its own kind of operation.
Handler = Callable[..., Steps]
FollowUps = dict[type[op.Operation], Handler]
#: What must outlive the gateway.
SavedValues = dict[str, Any]


class GotoUnderWay(Struct):
    """A goto under way: since when, and what is done at its goal.

    ``unconfirmed``: its acknowledgement was lost, and nobody has seen whether it was begun.
    """

    since: float
    then: str | None = None
    unconfirmed: bool = False


class Driver:
    """Carries out operations by the rows of ``driver.toml``, and keeps what is known of the mount.

    ``handlers`` are the functions that rows call, ``(driver, operation) -> Steps``. They are given to it: what a driver
    knows and remembers has no part in how it is used.
    """

    #: Whether an aligned mount may be told site and time without losing its alignment.
    takes_site_aligned = False
    loses_alignment = False
    #: How many questions it takes to learn where the mount points.
    position_reads = 1
    #: When the two halves of the last place were told, where they come one after the other: loop times.
    read_at: tuple[float, float] | None = None
    #: How finely it tells where it points, degrees: at rest two answers differ by no more.
    resolution = 20.0 / 3600.0
    #: How many times faster than a real one the mount slews: simulated ones may.
    speed_factor = 1.0
    #: The years that its clock, or what stands in for it here, can be set to.
    years = range(1900, 2100)
    #: Whether the mount has a GPS receiver of its own.
    gps = False
    #: Whether a sync is kept here that the mount's own axes know nothing of.
    has_sync_offset = False
    #: Whether motion by hand is a chain of small gotos, in right ascension and declination whatever the mount.
    moves_by_gotos = False
    #: What the mount's coordinates mean, where that is known by its version: ``jnow`` or ``j2000``.
    equinox = "jnow"
    #: Whether a sync aligns the mount; else one that is not aligned takes none, and cannot be sent to the sky.
    sync_aligns = True
    #: Whether it is a German mount, whose tube changes sides of the pier; None where that is not known.
    german: bool | None = None
    protocol: CommandSet
    #: Any clock that never goes back, seconds.
    now: Callable[[], float]
    model: str | None = None
    version: Version | None = None
    #: Whether tracking was put off for a motion and has not been put back yet.
    tracking_suspended = False
    goto: GotoUnderWay | None = None
    #: The site that the mount has told, or was told.
    site: op.Place | None = None
    #: Whether its motors have no power while it answers all the same.
    powerless = False
    #: Seconds after which it counts as an answer that what was handed on to the mount stays unanswered; None where all
    #: that it has is answered.
    patience: float | None = None
    #: Whether the mount was sent to sleep.
    asleep = False
    #: Whether it stands at its park position, to which it was sent, and nobody has taken it up again.
    parked = False

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self.handlers = handlers

    @property
    def goto_unconfirmed(self) -> bool:
        """Whether a goto may be under way that the mount was sent and has not acknowledged."""
        return self.goto is not None and self.goto.unconfirmed

    @property
    def southern(self) -> bool:
        """Whether it is known to stand in the south."""
        return self.site is not None and self.site.latitude < 0

    @property
    def equatorial_mode(self) -> op.Tracking:
        """The mode in which it tracks by one axis."""
        return op.Tracking.EQ_SOUTH if self.southern else op.Tracking.EQ_NORTH

    def supports(self, name: str) -> bool:
        """Whether the mount that was found has this command, by the manual: nothing is probed."""
        return self.protocol.commands[name].known_to(self.model, self.version)

    def implementation(self, operation: type[op.Operation]) -> Implementation | None:
        """The first way of carrying out an operation whose commands this mount has."""
        return next(filter(self._has, self.protocol.driver.get(operation.__name__, ())), None)

    def _has(self, way: Implementation) -> bool:
        return all(self.supports(name) for name in (*way.send, *way.needs))

    @property
    def ends(self) -> frozenset[str]:
        """The commands that end a motion and do nothing else, where a stop consists of more."""
        way = self.implementation(op.AbortMotion)
        return frozenset() if way is None else frozenset(way.ends)

    def impossible(self, operation: op.Operation) -> Fault | None:
        """What an operation would be refused with, as far as that is known without asking the mount."""
        return None

    def speed(self, rate: op.Rate) -> float:
        """How fast the mount moves at a hand rate, degrees a second."""
        raise NotImplementedError

    def can_do(self, equatorial: bool) -> op.Abilities:
        """What it can do by the tables, as it stands; a way that ends in a refusal is none."""
        traits = self.protocol.traits(self.model or "", equatorial and not self.german)
        can = (
            name
            for name, ways in self.protocol.driver.items()
            for way in ways
            if way.outcome not in WITHOUT_EFFECT and (way.part is None or way.part in traits) and self._has(way)
        )
        keys = sorted({self.speed(op.Rate(key=key)) for key in range(1, 10)})
        return op.Abilities(frozenset(can), tuple((speed, speed) for speed in keys), german=self.german)

    def destination(self, operation: op.Operation) -> op.GotoAxes | None:
        """The axis readings that Park or Home leads to; None where only the mount itself knows them."""
        return None

    def home_refused(self) -> None:
        """Park or Home was refused: where the mount does not tell of its home itself, that has failed."""

    def tube_side(self, told: str) -> str | None:
        """The side of the pier (E, W) that the tube really is on, by the answer to PierSide; None if there is none."""
        return None

    def give_up_goto(self) -> None:
        """The goto under way is over before it came to its goal."""
        self.goto = None

    def begin_goto(self, state: GotoUnderWay, order: Steps, moves: Handler) -> Steps:
        """Begin a goto by an order. It counts as under way before that is sent, for a stop must know of it.

        Where the acknowledgement is lost ``moves`` tells whether it was begun. Raises NoAnswer while nobody can.
        """
        self.parked, self.goto = False, state
        state.since = math.inf  # a mount that was not told yet stands still, and that is not its end
        try:
            yield from order
        except NoAnswer:
            state.unconfirmed = True
            if not (yield from moves(self)):
                yield Wait(RECHECK_AFTER)
                if not (yield from moves(self)):
                    self.give_up_goto()
                    raise
            self.goto, state.unconfirmed = state, False
        except Fault:
            self.give_up_goto()
            raise
        finally:
            state.since = self.now()

    def saved_state(self, moving: bool) -> SavedValues:
        """What must outlive the gateway; while the mount moves, also what it takes to stop it."""
        return {}

    def restore_state(self, saved: SavedValues, moving: bool) -> None:
        """Take up what an earlier run has remembered; nonsense is ignored."""

    def line_was_lost(self) -> None:
        """Nobody knows what has happened to the mount meanwhile: perhaps it was switched off and on."""

    def probe(self) -> Steps:
        """Prove that a mount of this kind is on the line, before it is sent what another kind might misread."""
        yield from ()  # a generator like all others

    def contact(self) -> Steps:
        """What must be known before the mount can be asked where it points, and where that is, if it was told.

        Its name is asked for after that. By the handler ``contact``, where there is one.
        """
        return (yield from self.handlers["contact"](self, None)) if "contact" in self.handlers else None

    def presented(self) -> Model:
        """The model's constants that a surface of this protocol presents when it is to be the mount itself."""
        return {}

    def reported_model(self, identity: op.Identity) -> str | None:
        """The model that the mount itself says it is, whatever it was named; None where it does not say."""
        return None

    def own(self, operation: op.Own) -> Steps:
        """What the mount itself answers -> bytes. Raises Unsupported for a command that this mount has not."""
        if not self.supports(operation.command):
            raise Unsupported
        return (yield Send(operation.command, dict(operation.fields), raw=True))["raw"]

    def perform(self, operation: op.Operation[_T]) -> Generator[Step, Any, _T]:
        """Carry out one operation; the generator's value is the operation's answer. Raises Fault."""
        if isinstance(operation, op.PassThrough):
            if not self.supports(operation.command):
                raise Unsupported
            patience = self.patience if self.protocol.commands[operation.command].replies else None
            return cast(_T, (yield Send(operation.command, dict(operation.fields), patience, once=True)))
        if isinstance(operation, op.Own):
            return cast(_T, (yield from self.own(operation)))
        way = self.implementation(type(operation))
        if way is None:
            raise Unsupported
        if way.call:
            return cast(_T, (yield from self.handlers[way.call](self, operation)))
        given = {name: getattr(operation, name) for name in operation.__struct_fields__}
        fields: op.Values = {}
        for name in way.send:
            fields |= yield Send(name, given)
        if isinstance(operation, op.Read) and operation.answers is not None:
            return cast(_T, operation.answers(**fields))
        return cast(_T, fields or None)
