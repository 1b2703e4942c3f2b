"""Driver: turns operations into commands and replies into answers, without I/O.

``perform(operation)`` is a generator: it yields steps, and the caller sends back the outcome of each. There are four
kinds of steps: ``Send`` (send this command and return the fields of its reply), ``Wait`` (let other requests use the
line for some seconds), ``Schedule`` (perform this operation later) and ``Remark`` (write this to the log). The rows of
``driver.toml`` name the functions of the protocol that carry out operations (``call``).
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
#: The values of ``outcome`` in driver rows that have no effect on the mount.
NOOP_OUTCOMES = ("refused", "silent")
#: Seconds before the driver checks again whether a goto has begun, after its acknowledgement was lost.
RECHECK_DELAY = 0.5
SLEWING_MESSAGE = "The mount is slewing: the guide pulse is dropped."
BY_HAND_MESSAGE = "The mount is moved by hand: the guide pulse is dropped."


class Send(NamedTuple):
    """Send a command with these field values. The generator receives the reply's fields, or a Fault is raised in it."""

    command: str
    values: Mapping[str, object] = {}
    #: Seconds without a reply after which ``Silence`` is raised although the line stays up; None: the line then counts
    #: as lost.
    timeout: float | None = None
    #: Whether this command keeps the mount busy, for up to ``timeout`` seconds. Others are refused meanwhile,
    #: except a stop that has no reply. If no reply arrives in this time, the line counts as lost.
    long: bool = False
    #: Whether it begins a motion by hand: if the line or the mount is busy it is refused instead of delayed.
    at_once_or_never: bool = False
    #: Whether the bytes of the reply are returned too, as the field ``raw``.
    include_raw: bool = False
    #: Whether the first reply is accepted without a second one; or a function that decides this by the reply's fields.
    unverified_ok: bool | Callable[[Mapping[str, object]], bool] = False
    #: Whether it must not be sent again to verify the reply, because the reply belongs to the command before it, or
    #: concerns only the client that requested it.
    once: bool = False


class Wait(NamedTuple):
    """Wait for some seconds, in which other requests may use the line."""

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
    """A sentence for the log: the driver does something differently from what was requested. The same text is written
    once. Of remarks of the same ``kind``, which differ only in their numbers, only the first is written.
    """

    text: str
    kind: str = ""


Step = Send | Wait | Schedule | Remark
#: The steps of a driver's function. Its return value is the answer to the operation.
Steps = Generator[Step, Any, Any]
#: A function of a protocol's driver, (driver, operation) -> steps. Each handles a kind of operation.
Handler = Callable[..., Steps]
#: Class of an operation that a driver schedules for itself -> its handler.
FollowUps = dict[type[op.Operation], Handler]
#: What the state file stores for a driver.
SavedValues = dict[str, Any]


class GotoUnderWay(Struct):
    """A goto under way; the motion to the park or home position counts as one."""

    #: When it began, by the driver's clock; infinite until the mount acknowledges it: until then a mount at rest does
    #: not mean that the goto has ended.
    began: float = math.inf
    #: ``park`` or ``home`` if it leads to that position; None for a goto to a target.
    purpose: str | None = None
    #: Whether the acknowledgement was lost and no reading has shown yet whether the goto has begun.
    unconfirmed: bool = False
    #: Whether the mount has reported that it slews.
    slew_reported: bool = False


class Driver:
    """Carries out operations by the rows of ``driver.toml``, and holds what is known of the mount's state. ``handlers``
    are the functions that these rows name, ``(driver, operation) -> Steps``.
    """

    #: Whether site and time can be set on an aligned mount without side effects; whether setting them ends alignment.
    can_set_site_aligned = site_unaligns = False
    #: How many commands it takes to read both coordinates of the position.
    position_reads = 1
    #: When the last command was sent, and when the next can be sent, by the event loop's clock.
    sent_at = next_send_at = 0.0
    #: When each coordinate of the last position was read, by the same clock; None if one command reads both.
    read_at: tuple[float, float] | None = None
    #: Degrees by which two reported positions may differ at rest; and the resolution of RA and of declination, degrees.
    rest_tolerance = 20.0 / 3600.0
    angle_steps: tuple[float, float] = (rest_tolerance, rest_tolerance)
    #: How many times faster than a real mount a simulated mount slews.
    speed_factor = 1.0
    #: The years to which the clock can be set: the mount's, or the gateway's own for a mount without a clock.
    clock_years = range(1900, 2100)
    #: Whether the mount has a GPS receiver of its own, and whether it times guide pulses itself.
    gps = times_pulses = False
    #: Degrees in RA and declination that the gateway adds to the mount's position, instead of a sync of the mount.
    sync_offset: tuple[float, float] = (0.0, 0.0)
    #: Whether the gateway uses ``sync_offset`` for syncs because the hand control has no sync command.
    emulates_sync = False
    #: The last position that the mount reported, without ``sync_offset``.
    last_position: op.Equatorial | None = None
    #: Whether the last reported declination was beyond 90 degrees: the mount assumes that the tube has passed the pole.
    reports_beyond_pole = False
    #: Whether motion by hand is a series of small gotos in right ascension and declination, also on alt-az mounts.
    moves_by_gotos = False
    #: The equinox of the mount's coordinates, ``jnow`` or ``j2000``; and the one assumed if the user configures none.
    equinox = default_equinox = "jnow"
    #: Whether a sync aligns the mount. If not, an unaligned mount accepts neither a sync nor a goto to the sky.
    sync_aligns = True
    #: Whether it is a German mount, whose tube changes sides of the pier; None while that is unknown.
    german: bool | None = None
    #: Whether the mount reports no position while it seeks its home position.
    no_position_while_homing = False
    #: Whether a German mount reports on which side of the pier its tube is.
    reports_pier_side = True
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
    #: Seconds after which ``Silence`` is raised if a passed-on command has no reply; None if the mount replies to all.
    silence_timeout: float | None = None
    #: Whether the mount hibernates; whether it moves, and may be slewing, without an order of the gateway.
    asleep = moved_by_others = False
    #: Whether the mount is parked, by the last report or order; whether a goto is known to unpark it.
    parked = goto_unparks = False

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self.handlers = handlers

    @property
    def southern(self) -> bool:
        """Whether the site is known to be in the southern hemisphere."""
        return self.site is not None and self.site.latitude < 0

    @property
    def equatorial_mode(self) -> op.Tracking:
        """The tracking mode of an equatorial mount in the hemisphere of the site."""
        return op.Tracking.EQ_SOUTH if self.southern else op.Tracking.EQ_NORTH

    def supports(self, command: str) -> bool:
        """Whether this model and version have the command according to the manual; nothing is sent to find out."""
        return (row := self.protocol.commands.get(command)) is not None and row.exists_on(self.model, self.version)

    def implementation(self, operation: type[op.Operation]) -> Implementation | None:
        """Return the first row of ``driver.toml`` for this operation whose commands the mount supports, or None."""
        return next(filter(self._is_usable, self.protocol.driver_rows.get(operation.__name__, ())), None)

    def _is_usable(self, row: Implementation) -> bool:
        return all(self.supports(name) for name in row.needs)

    @property
    def ending_commands(self) -> frozenset[str]:
        """The commands of this driver's stop that end a motion and do nothing else."""
        row = self.implementation(op.AbortMotion)
        return frozenset() if row is None else frozenset(row.ends)

    def certain_fault(self, operation: op.Operation) -> Fault | None:
        """Return the fault with which this operation would certainly fail, else None. Nothing is sent to find out."""
        return None

    def speed(self, rate: op.Rate) -> float:
        """Return the speed of motion by hand at this rate, degrees per second."""
        raise NotImplementedError

    def abilities(self, equatorial: bool) -> op.Abilities:
        """Return the mount's abilities according to the tables. ``equatorial``: whether its first axis is polar."""
        traits = self.protocol.traits(self.model or "", equatorial and not self.german)
        can = (
            name
            for name, rows in self.protocol.driver_rows.items()
            for row in rows
            if row.outcome not in NOOP_OUTCOMES and (row.part is None or row.part in traits) and self._is_usable(row)
        )
        keys = sorted({self.speed(op.Rate(key=key)) for key in range(1, 10)})
        return op.Abilities(frozenset(can), tuple((speed, speed) for speed in keys), german=self.german)

    def destination(self, operation: op.Operation) -> op.GotoAxes | None:
        """Return the axis readings at the end of Park or Home, or None if only the mount itself knows them."""
        return None

    def on_home_refusal(self) -> None:
        """Note that the gateway has refused Park or Home; mounts without a home state then count as not at home."""

    def tube_side(self, reported_side: str) -> str | None:
        """Return the tube's real side of the pier, E or W, from the reported one; None if unknown or without a pier."""
        return None

    def give_up_goto(self) -> None:
        """Forget the goto under way: it has ended before its goal."""
        self.goto = None

    def begin_goto(self, new_goto: GotoUnderWay, order: Steps, is_slewing: Handler) -> Steps:
        """Begin a goto with the steps of ``order``; it counts as under way before they are sent, so a stop ends it. If
        the acknowledgement is lost, ``is_slewing`` reads whether the mount slews. Raises NoAnswer if it does not slew.
        """
        self.parked, self.goto = False, new_goto
        try:
            yield from order
        except NoAnswer:
            new_goto.unconfirmed = True
            if not (yield from is_slewing(self)):
                yield Wait(RECHECK_DELAY)
                if not (yield from is_slewing(self)):
                    self.give_up_goto()
                    raise
            self.goto, new_goto.unconfirmed = new_goto, False
        except Fault:
            self.give_up_goto()
            raise
        finally:
            new_goto.began = self.now()

    def saved_state(self, moving: bool) -> SavedValues:
        """Return the values to store in the state file; if ``moving``, also those needed to stop the mount later."""
        return {}

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        """Restore what ``saved_state`` returned in an earlier run; invalid values are ignored."""

    @property
    def stale_note(self) -> str:
        """A message: which settings kept by the gateway a power cycle of the mount resets; empty if it resets none."""
        return ""

    def renew_settings(self) -> Steps:
        """After a possible power cycle, reset the settings that the gateway keeps for the mount, or send them again."""
        yield from ()

    def on_line_up(self) -> None:
        """React to a line that has come up: the mount may have been switched off and on meanwhile."""

    def probe(self) -> Steps:
        """Check that a mount of this kind is on the line, before sending commands that another kind might misread."""
        yield from ()  # makes this a generator

    def contact(self) -> Steps:
        """Find out which command reads the position. Return the position if it was read in doing so, else None."""
        yield from ()

    def presented_model(self) -> Model:
        """Return the model constants of this mount, for a surface of the same protocol that presents it unchanged."""
        return {}

    def reported_model(self, identity: op.Identity) -> str | None:
        """Return the model that the mount itself reports, whatever the user has configured; None if it reports none."""
        return None

    def native_reply(self, operation: op.NativeRequest) -> Steps:
        """Return the bytes of the mount's own reply. Raises Unsupported for a command that this mount lacks."""
        if not self.supports(operation.command):
            raise Unsupported
        return (yield Send(operation.command, dict(operation.fields), include_raw=True))["raw"]

    def perform(self, operation: op.Operation[_T]) -> Generator[Step, Any, _T]:
        """Carry out an operation. The generator's return value is the operation's answer. Raises Fault."""
        if isinstance(operation, op.PassThrough):
            if not self.supports(operation.command):
                raise Unsupported
            patience = self.silence_timeout if self.protocol.commands[operation.command].replies else None
            return cast(_T, (yield Send(operation.command, dict(operation.fields), patience, once=True)))
        if isinstance(operation, op.NativeRequest):
            return cast(_T, (yield from self.native_reply(operation)))
        row = self.implementation(type(operation))
        if row is None:
            raise Unsupported
        return cast(_T, (yield from self.handlers[row.call](self, operation)))
