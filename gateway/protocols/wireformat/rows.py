"""The rows of the mapping files (TOML tables) as structs, and the values that their keys may have."""

from typing import Any, Literal

import msgspec
from msgspec.structs import replace

from gateway.core.errors import MappingError

#: A request or reply in the notation of the tables (see ``command.py``).
FrameSource = str | list[str | int]
Version = tuple[int, ...]  # (4, 21) is version 4.21
#: A row of ``models.toml``: the properties of a model.
Model = dict[str, Any]

#: When the gateway asks the mount again if a client requests a reply of the mount itself, and when it reuses a reply.
ReplyReuse = Literal["fixed", "state", "moment", "clock", "site", "order", "library"]
REUSE_DESCRIPTIONS: dict[ReplyReuse, str] = {
    "fixed": "asked once, until the mount is identified again",
    "state": "one reply serves all programs for a second",
    "moment": "asked each time; programs that ask meanwhile share the reply",
    "clock": "asked each time, unless a program has set another clock that is kept here",
    "site": "one reply serves all programs for a second, unless a program has set another site that is kept here",
    "order": "sent each time",
    "library": "its own object library, and this program's target",
}
#: How the value in a reply changes between two requests, by which replies are verified: a position moves, a clock
#: runs, a state stays as it is until something is done, a stream is different every time.
AnswerKind = Literal["position", "clock", "state", "stream"]
#: What an urgent command, which is sent before queued commands, ends. stop: every motion, and it does nothing else;
#: restart: every motion, and it does more; axis: that of one axis; part: a single motion, and only in its turn.
UrgentKind = Literal["stop", "restart", "axis", "part"]
#: What the gateway does with a command, for the generated tables.
Outcome = Literal["translated", "derived", "kept", "synthesised", "refused", "silent"]
#: Keys of ``outcome`` are traits of the mount's model (``CommandSet.traits``), or one of these: an unaligned mount, a
#: mount that supports no operation of the row, any mount. ``no-OPERATION`` stands for mounts that do not support the
#: operation, ``as-TRAIT`` for a trait of the model that the surface presents.
UNALIGNED, UNABLE, ANY_MOUNT, LACKS_PREFIX, PRESENTED_PREFIX = "unaligned", "unable", "else", "no-", "as-"


def parse_version(text: str) -> Version:
    """Parse a version: ``"4.21"`` is (4, 21). Raises ValueError."""
    return tuple(int(part) for part in text.split("."))


def format_version(version: Version) -> str:
    """Write a version as the manual does: two minor digits (3.01); but one below 3 and from 100 on (1.6, 104.0)."""
    major, minor, *rest = version
    shown = f"{major}.{minor:02d}" if major > 2 and major < 100 else f"{major}.{minor}"
    return ".".join([shown, *(f"{part:02d}" for part in rest)])


class ReplyForm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One form of a command's reply: always used, or only in some cases, or for an error."""

    wire: FrameSource
    when: str | None = None  # only in this format of the client (high, low), for this model, or in this dialect
    fault: str | None = None  # only for this class of ``gateway.core.errors``
    says: str | None = None  # the meaning of the error, if the mount sends no text


class CommandRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``commands.toml``: one command of the protocol as the manual describes it."""

    help: str  # what it does, in a few words, for messages
    request: str | list[str | int] = ""
    reply: str | list[str | int | ReplyForm] | None = None
    models: list[str] | None = None  # the models that have it; None: all
    since: str | None = None  # the first version that has it
    beyond: str | None = None  # the programs that send it although the manual does not have it
    acts: bool = False  # it returns a value and also changes something
    answer: AnswerKind | None = None  # how the value in the reply may change between two requests
    urgent: UrgentKind | None = None  # what it ends as soon as it arrives
    urgent_at: dict[str, object] = {}  # it is only urgent with these values of its fields
    takes_back: list[str] = []  # the queued commands that are discarded when it arrives
    long: float | None = None  # the mount may be busy with it for this many seconds
    while_seeking: bool = False  # the mount accepts it while it seeks its home
    while_asleep: bool | None = None  # whether the mount accepts it while it hibernates
    by_hand: bool = False  # it begins a motion by hand, or sets its rate: sent at once or not at all
    may_be_silent: bool = False  # some mounts that have it do not reply
    pushed: float | None = None  # sent to programs every so many seconds without a request
    read: int | None = None  # some programs read only so many bytes of the reply, and take the rest for the next reply


class SurfaceRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A row of ``surface.toml``: what a surface does with a command. It has exactly one of ask, tell, say and call."""

    outcome: Outcome | dict[str, Outcome]  # for every mount, or kind of mount -> outcome: the first that fits counts
    ask: str | None = None  # perform this operation
    tell: list[str] | None = None  # reply with these fields of the client's settings or of the presented model
    say: dict[str, object] | None = None  # reply with these values
    call: str | None = None  # run this function (``module.function``)
    given: dict[str, object] = {}  # with ``ask``: fields of the operation that the command does not have
    asks: list[str] = []  # with ``call``: the operations that the function requests; only reads if it changes nothing
    passes: bool | None = None  # pass it on to a mount of the same protocol; None: only if it is refused here
    after: list[str] = []  # in examples: what a program sends before it, until the mount is at rest
    during: list[str] = []  # in examples: what a program sends before it, so that the mount moves
    why: str | None = None  # the remark in the generated tables

    @property
    def verbs(self) -> list[str]:
        """The keys of this row among ask, tell, say and call: exactly one if the row is valid."""
        return [verb for verb in ("ask", "tell", "say", "call") if getattr(self, verb) is not None]

    @property
    def is_passed_on(self) -> bool:
        """Whether the command is passed on unchanged to a mount of the same protocol."""
        return self.outcome == "refused" if self.passes is None else self.passes

    @property
    def outcomes(self) -> dict[str, Outcome]:
        """Kind of mount -> outcome."""
        return {ANY_MOUNT: self.outcome} if isinstance(self.outcome, str) else self.outcome

    @property
    def operations(self) -> list[str]:
        """Every operation that this row may request."""
        return ([self.ask] if self.ask else []) + self.asks


class OwnRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``own.toml``: whether the mount itself answers this command of programs that speak its protocol. The
    row applies unless the user has configured a model to present.
    """

    keep: ReplyReuse | None = None  # how often the mount is asked (``REUSE_DESCRIPTIONS``); None: the gateway answers
    why: str | None = None  # why the gateway answers


class Implementation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``driver.toml``: one implementation of an operation. A driver uses the first that the mount supports."""

    call: str  # the function that carries it out (``module.function``)
    needs: list[str] = []  # commands that it sends; a mount that lacks one cannot use this row
    uses: list[str] = []  # commands that it sends if the mount has them
    ends: list[str] = []  # in the row of a stop: the commands that end a motion and do nothing else
    part: str | None = None  # a trait that a model must have, for the generated tables and the list of abilities
    aligned: bool | None = None  # for the tables: only on an aligned mount (true), or only before alignment (false)
    outcome: Outcome = "translated"
    why: str | None = None  # the remark in the generated tables

    @property
    def commands(self) -> list[str]:
        return self.needs + self.uses


class Dialect(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The TOML file of a dialect (key ``dialect`` of ``models.toml``): how another maker's mounts differ."""

    has: list[str]  # the commands of ``commands.toml`` that these mounts have, although it names other models
    commands: dict[str, CommandRow] = {}  # additional commands, and those with another form or meaning
    driver: dict[str, list[Implementation]] = {}  # operation -> implementations that replace those of ``driver.toml``
    facts: dict[str, Any] = {}  # constants of these mounts, for the driver's functions

    def merged_commands(self, file_name: str, rows: dict[str, CommandRow]) -> dict[str, CommandRow]:
        """Return the dialect's commands: some ``rows`` of ``commands.toml``, and its own. Raises MappingError."""
        if absent := sorted(set(self.has) - rows.keys()):
            raise MappingError(file_name, "has", f"there is no {', '.join(absent)}")
        return {name: replace(rows[name], models=None, since=None) for name in self.has} | self.commands

    def merge(self, rows: dict[str, list[Implementation]], has: frozenset[str]) -> dict[str, list[Implementation]]:
        """Return operation -> implementations: the dialect's own, else ``rows`` that send commands, all in ``has``."""
        usable = {}
        for operation, ways in rows.items():
            possible = [replace(way, uses=[name for name in way.uses if name in has]) for way in ways]
            usable[operation] = [way for way in possible if way.commands and has.issuperset(way.needs)]
        return usable | self.driver
