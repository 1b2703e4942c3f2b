"""Driver: turns operations into commands and replies into answers, without I/O.

``perform(operation)`` is a generator: it yields steps, and the caller sends back the outcome of each. There are four
kinds of steps: ``Send`` (send this command and return the fields of its reply), ``Wait`` (leave the line to others for
some seconds), ``Schedule`` (perform this operation later) and ``Remark`` (write this to the log). The rows of
``driver.toml`` name functions of the protocol's own package (``call``).
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
#: Outcomes of rows that change nothing on the mount.
WITHOUT_EFFECT = ("refused", "silent")
#: Seconds before the driver checks again whether a goto has begun, after its acknowledgement was lost.
RECHECK_AFTER = 0.5
SLEWING = "The mount is slewing: the guide pulse is dropped."
BY_HAND = "The mount is moved by hand: the guide pulse is dropped."


class Send(NamedTuple):
    """Send a command with these field values. The generator receives the reply's fields, or a Fault is raised in it.

    patience          seconds after which no reply counts as an answer: ``Silence`` is raised, the line stays up
    long              the mount is busy with it for up to ``patience`` seconds: only a stop without a reply is sent
                      meanwhile, other commands are refused as busy, and no reply at the end is a fault of the line
    at_once_or_never  it begins a motion by hand: if the line or the mount is busy it is refused instead of delayed
    raw               return the bytes of the reply too, as the field ``raw``
    unverified_ok     accept the first reply without verification, because nothing depends on it; or if this function of
                      its fields is true
    once              accept the reply as it is: it concerns the command just before it, or only the client that asked
    """

    command: str
    values: Mapping[str, object] = {}
    patience: float | None = None
    long: bool = False
    at_once_or_never: bool = False
    raw: bool = False
    unverified_ok: bool | Callable[[Mapping[str, object]], bool] = False
    once: bool = False


class Wait(NamedTuple):
    """Wait while other requests may use the line."""

    seconds: float


class Schedule(NamedTuple):
    """Perform an operation after some seconds; a newer ``Schedule`` of an equal operation replaces it.

    An ``urgent`` operation has the priority of a stop (to repeat the end of a motion). A ``not_while_busy`` operation
    waits while the mount is busy with a long command, during which it accepts nothing but a stop.
    """

    seconds: float
    operation: op.Operation
    urgent: bool = False
    not_while_busy: bool = False


class Remark(NamedTuple):
    """A sentence for the log: the driver does something differently from what was requested.

    It is written once. Of remarks of one ``kind``, which differ only by numbers, only the first is written.
    """

    text: str
    kind: str = ""


Step = Send | Wait | Schedule | Remark
#: The steps of a driver's function. Its return value is the answer to the operation.
Steps = Generator[Step, Any, Any]
#: A function of a protocol's driver, (driver, operation) -> steps. Each handles a kind of operation.
Handler = Callable[..., Steps]
FollowUps = dict[type[op.Operation], Handler]
#: What the state file stores for a driver.
SavedValues = dict[str, Any]


class GotoUnderWay(Struct):
    """A goto under way since ``since`` (driver clock; infinite until it is acknowledged, so that a mount at rest does
    not count as its end). ``then``: park at its end.

    ``unconfirmed``: the acknowledgement was lost, and no reading has shown yet whether the goto has begun.
    ``slew_reported``: the mount has reported that it slews.
    """

    since: float = math.inf
    then: str | None = None
    unconfirmed: bool = False
    slew_reported: bool = False


class Driver:
    """Carries out operations by the rows of ``driver.toml``, and owns the known state of the mount.

    ``handlers``: the functions that rows call, ``(driver, operation) -> Steps``; they import the driver's state.
    """

    #: Whether site and time can be set on an aligned mount without consequences, or whether that costs the alignment.
    takes_site_aligned = loses_alignment = False
    #: How many commands it takes to read the position.
    position_reads = 1
    #: Loop times: when the last command was written and the next one can be; and, if they take one command each, when
    #: both halves of the last position were read.
    sent_at = next_at = 0.0
    read_at: tuple[float, float] | None = None
    #: Resolution of the reported position, degrees: at rest two readings differ by no more. The steps of its angles.
    resolution = 20.0 / 3600.0
    ticks: tuple[float, float] = (resolution, resolution)
    #: How many times faster than a real mount a simulated mount slews.
    speed_factor = 1.0
    #: The years that its clock, or the gateway's substitute for it, can be set to.
    years = range(1900, 2100)
    #: Whether the mount has a GPS receiver of its own, and whether it times guide pulses itself.
    gps = times_pulses = False
    #: Degrees that replace a sync that the mount cannot take, in RA and declination; its axes know nothing of them.
    offset: tuple[float, float] = (0.0, 0.0)
    #: Whether it does so because the hand control has no sync command.
    emulates_sync = False
    #: The last position, as the mount counts.
    last: op.Equatorial | None = None
    #: Whether the last reported declination was beyond the pole: the mount assumes that the tube was driven over it.
    told_beyond = False
    #: Whether motion by hand is a series of small gotos, in right ascension and declination on every kind of mount.
    moves_by_gotos = False
    #: The equinox of its coordinates, ``jnow`` or ``j2000``: as its version tells, and if the user has not chosen that.
    equinox = default_equinox = "jnow"
    #: Whether a sync aligns the mount. If not, an unaligned mount accepts neither a sync nor a goto to the sky.
    sync_aligns = True
    #: Whether it is a German mount, whose tube changes sides of the pier; None while that is unknown.
    german: bool | None = None
    #: Whether the mount tells no position while it seeks its home.
    seeks_unseen = False
    #: Whether a German mount tells on which side of the pier its tube is.
    tells_side = True
    protocol: CommandSet
    #: A monotonic clock, seconds.
    now: Callable[[], float]
    model: str | None = None
    version: Version | None = None
    #: Whether tracking was suspended for a motion and has not been resumed yet.
    tracking_suspended = False
    goto: GotoUnderWay | None = None
    #: The site that the mount has reported, or that was set on it.
    site: op.Place | None = None
    #: Whether the motors have no power although the mount still answers.
    powerless = False
    #: Seconds after which no reply to a passed-on command counts as an answer; None if the mount answers all it has.
    patience: float | None = None
    #: Whether the mount hibernates; whether it moves although no client ordered that, so that it may be slewing.
    asleep = moved_by_others = False
    #: Whether it was parked, and was not unparked or moved since; whether a goto is known to take it from there.
    parked = goto_unparks = False

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self.handlers = handlers

    @property
    def southern(self) -> bool:
        """Whether the site is known to be in the southern hemisphere."""
        return self.site is not None and self.site.latitude < 0

    @property
    def equatorial_mode(self) -> op.Tracking:
        """The equatorial tracking mode of its hemisphere."""
        return op.Tracking.EQ_SOUTH if self.southern else op.Tracking.EQ_NORTH

    def supports(self, name: str) -> bool:
        """Whether this model and version have the command according to the manual; nothing is sent to find out."""
        return (row := self.protocol.commands.get(name)) is not None and row.known_to(self.model, self.version)

    def implementation(self, operation: type[op.Operation]) -> Implementation | None:
        """Return the first row for this operation whose commands the mount supports, or None."""
        return next(filter(self._has, self.protocol.driver.get(operation.__name__, ())), None)

    def _has(self, row: Implementation) -> bool:
        return all(self.supports(name) for name in row.needs)

    @property
    def ends(self) -> frozenset[str]:
        """The commands of a stop that end a motion and do nothing else."""
        row = self.implementation(op.AbortMotion)
        return frozenset() if row is None else frozenset(row.ends)

    def impossible(self, operation: op.Operation) -> Fault | None:
        """Return the fault that this operation would certainly end with, as far as known without asking; else None."""
        return None

    def speed(self, rate: op.Rate) -> float:
        """Return how fast the mount moves at a hand rate, degrees per second."""
        raise NotImplementedError

    def can_do(self, equatorial: bool) -> op.Abilities:
        """Return what the mount can do according to the tables, without operations that would only be refused."""
        traits = self.protocol.traits(self.model or "", equatorial and not self.german)
        can = (
            name
            for name, rows in self.protocol.driver.items()
            for row in rows
            if row.outcome not in WITHOUT_EFFECT and (row.part is None or row.part in traits) and self._has(row)
        )
        keys = sorted({self.speed(op.Rate(key=key)) for key in range(1, 10)})
        return op.Abilities(frozenset(can), tuple((speed, speed) for speed in keys), german=self.german)

    def destination(self, operation: op.Operation) -> op.GotoAxes | None:
        """Return the axis readings at the end of Park or Home, or None if only the mount itself knows them."""
        return None

    def home_refused(self) -> None:
        """React to a refused Park or Home: on a mount that does not report its home state, the search has failed."""

    def tube_side(self, reported: str) -> str | None:
        """Return the real side of the pier (E, W) for an answer to PierSide; None if the mount has no sides."""
        return None

    def give_up_goto(self) -> None:
        """Forget the goto under way: it has ended before its goal."""
        self.goto = None

    def begin_goto(self, state: GotoUnderWay, order: Steps, is_slewing: Handler) -> Steps:
        """Begin a goto with the steps of ``order``. It counts as under way before they are sent: a stop must know.

        If the acknowledgement is lost, ``is_slewing`` finds out whether it slews. Raises NoAnswer if not.
        """
        self.parked, self.goto = False, state
        try:
            yield from order
        except NoAnswer:
            state.unconfirmed = True
            if not (yield from is_slewing(self)):
                yield Wait(RECHECK_AFTER)
                if not (yield from is_slewing(self)):
                    self.give_up_goto()
                    raise
            self.goto, state.unconfirmed = state, False
        except Fault:
            self.give_up_goto()
            raise
        finally:
            state.since = self.now()

    def saved_state(self, moving: bool) -> SavedValues:
        """Return the values to store in the state file; while the mount moves, also what is needed to stop it."""
        return {}

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        """Restore what ``saved_state`` returned in an earlier run; invalid values are ignored."""

    @property
    def emulated(self) -> str:
        """What the gateway keeps for the mount and a power cycle makes wrong, with the remedy; empty if nothing."""
        return ""

    def forget_emulated(self) -> Steps:
        """Forget these settings: the mount may have been switched off. If the value is known then, it is sent."""
        yield from ()

    def line_was_lost(self) -> None:
        """React to a lost line: the mount may have been switched off and on meanwhile."""

    def probe(self) -> Steps:
        """Check that a mount of this kind is on the line, before sending commands that another kind might misread."""
        yield from ()  # makes this a generator

    def contact(self) -> Steps:
        """Find out how to read the position; return the position if that is known already."""
        yield from ()

    def presented(self) -> Model:
        """Return the model constants for a surface of the same protocol that presents the mount itself."""
        return {}

    def reported_model(self, identity: op.Identity) -> str | None:
        """Return the model that the mount itself reports, whatever the user has configured; None if it reports none."""
        return None

    def native_reply(self, operation: op.NativeRequest) -> Steps:
        """Return the bytes of the mount's own reply. Raises Unsupported for a command that this mount lacks."""
        if not self.supports(operation.command):
            raise Unsupported
        return (yield Send(operation.command, dict(operation.fields), raw=True))["raw"]

    def perform(self, operation: op.Operation[_T]) -> Generator[Step, Any, _T]:
        """Carry out an operation. The generator's return value is the operation's answer. Raises Fault."""
        if isinstance(operation, op.PassThrough):
            if not self.supports(operation.command):
                raise Unsupported
            patience = self.patience if self.protocol.commands[operation.command].replies else None
            return cast(_T, (yield Send(operation.command, dict(operation.fields), patience, once=True)))
        if isinstance(operation, op.NativeRequest):
            return cast(_T, (yield from self.native_reply(operation)))
        row = self.implementation(type(operation))
        if row is None:
            raise Unsupported
        return cast(_T, (yield from self.handlers[row.call](self, operation)))
