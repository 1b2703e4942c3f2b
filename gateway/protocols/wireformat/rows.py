"""The rows of the mapping files as structs, and the words allowed in them."""

from typing import Any, Literal

import msgspec
from msgspec.structs import replace

from gateway.core.errors import MappingError

#: A frame as the tables write it (``command.py``).
Source = str | list[str | int]
Version = tuple[int, ...]
#: A row of ``models.toml``: the properties of a model.
Model = dict[str, Any]

#: How long the gateway reuses a reply of the mount itself for all clients, and when it answers instead of the mount.
Keep = Literal["fixed", "state", "moment", "clock", "site", "order", "library"]
KEEPS: dict[Keep, str] = {
    "fixed": "asked once, until the mount is identified again",
    "state": "one reply serves all programs for a second",
    "moment": "asked each time; programs that ask meanwhile share the reply",
    "clock": "asked each time, unless a program has set another clock that is kept here",
    "site": "one reply serves all programs for a second, unless a program has set another site that is kept here",
    "order": "sent each time",
    "library": "its own object library, and this program's target",
}
#: How the answer to a question may change from one time to the next, by which replies are verified: it moves; runs as a
#: clock does; stays as it is until something is done; is different every time.
Answer = Literal["position", "clock", "state", "stream"]
#: What an urgent command ends, which must not wait behind other commands: every motion, and it does nothing else; every
#: motion, and it does more; the motion of one axis; something else, or a motion in its turn.
Urgent = Literal["stop", "restart", "axis", "part"]
Outcome = Literal["translated", "derived", "kept", "synthesised", "refused", "silent"]
#: Words for kinds of mounts, besides the traits of their models (``CommandSet.traits``): one that is not aligned, one
#: that can carry out none of the operations of the row, every one. Before an operation: a mount that cannot carry it
#: out. Before a trait: the presented model.
UNALIGNED, UNABLE, ELSE, LACKS, PRESENTED = "unaligned", "unable", "else", "no-", "as-"


def parse_version(text: str) -> Version:
    """``"4.21"`` -> (4, 21). Raises ValueError."""
    return tuple(int(part) for part in text.split("."))


def show_version(version: Version) -> str:
    """Write a version as the manual does: one minor digit below version 3 (1.6, 2.2), two from 3 on (3.01, 4.10)."""
    major, minor, *rest = version
    shown = f"{major}.{minor:02d}" if major > 2 and major < 100 else f"{major}.{minor}"
    return ".".join([shown, *(f"{part:02d}" for part in rest)])


class ReplyForm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A form of reply, for the client's format, the model or the dialect ``when``, or for the error ``fault``.

    ``says`` is the meaning of the error, if the mount sends no text.
    """

    wire: Source
    when: str | None = None
    fault: str | None = None
    says: str | None = None


class CommandRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``commands.toml``.

    models, since   the models that have the command, and the first version
    acts          it returns a value and also changes something
    answer        how the answer to a question may change
    urgent        what it ends; ``urgent_at``: only with these values
    takes_back    the queued commands that are discarded when this command arrives
    long          the mount may be busy with it for this many seconds
    while_seeking, while_asleep   whether the mount accepts it while it seeks its home, or hibernates
    by_hand       it begins a motion by hand, or sets its rate: done at once or not at all
    may_be_silent   some mounts that have it do not answer it
    pushed        it is sent to a program every so many seconds without being asked for; it may have no request
    read          some programs read only so many bytes of the reply, and take the rest for the next reply
    """

    help: str
    request: str | list[str | int] = ""
    reply: str | list[str | int | ReplyForm] | None = None
    models: list[str] | None = None
    since: str | None = None
    beyond: str | None = None
    acts: bool = False
    answer: Answer | None = None
    urgent: Urgent | None = None
    urgent_at: dict[str, object] = {}
    takes_back: list[str] = []
    long: float | None = None
    while_seeking: bool = False
    while_asleep: bool | None = None
    by_hand: bool = False
    may_be_silent: bool = False
    pushed: float | None = None
    read: int | None = None


class SurfaceRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A row of ``surface.toml``: exactly one of the four verbs says what a surface does with a command.

    ask, given      perform this operation; its fields are those of the command, these, and the client's own settings
    tell            reply with these fields of the client's settings or the presented model
    say             reply with these values
    call            run this function (``module.function``)
    asks            the operations that the function asks for: those that change the mount, or else the reads
    outcome         a word of ``Outcome``, or one for each kind of mount, the first that fits (``fits``)
    why             the remark in the generated tables
    passes          pass it on to a mount of the same protocol that has it; by default true if refused here
    after, during   for examples: what a program sends before, until the mount is at rest, and then in motion
    """

    outcome: Outcome | dict[str, Outcome]
    ask: str | None = None
    tell: list[str] | None = None
    say: dict[str, object] | None = None
    call: str | None = None
    given: dict[str, object] = {}
    asks: list[str] = []
    passes: bool | None = None
    after: list[str] = []
    during: list[str] = []
    why: str | None = None

    @property
    def verbs(self) -> list[str]:
        return [verb for verb in ("ask", "tell", "say", "call") if getattr(self, verb) is not None]

    @property
    def handed_on(self) -> bool:
        """Whether it is passed on unchanged to a mount of the same protocol."""
        return self.outcome == "refused" if self.passes is None else self.passes

    @property
    def outcomes(self) -> dict[str, Outcome]:
        """Kind of mount -> outcome."""
        return {ELSE: self.outcome} if isinstance(self.outcome, str) else self.outcome

    @property
    def operations(self) -> list[str]:
        """Every operation that this row may request."""
        return ([self.ask] if self.ask else []) + self.asks


class OwnRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``own.toml``: the mount itself answers programs of its protocol, if no model to present is configured.

    ``keep`` says how (``KEEPS``); without it the gateway answers, and ``why`` gives the reason.
    """

    keep: Keep | None = None
    why: str | None = None


class Implementation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``driver.toml``: an implementation of an operation.

    call          the function that carries it out (``module.function``)
    needs, uses   the commands that it sends: without those of ``needs`` it is skipped, ``uses`` are optional
    ends          of the commands of a stop, those that end a motion and do nothing else
    part          a trait (``traits``) that a model must have, for the generated tables and the list of abilities
    aligned       for the tables: only used on an aligned mount (true), or only before the alignment (false)
    """

    call: str
    needs: list[str] = []
    uses: list[str] = []
    ends: list[str] = []
    part: str | None = None
    aligned: bool | None = None
    outcome: Outcome = "translated"
    why: str | None = None

    @property
    def commands(self) -> list[str]:
        return self.needs + self.uses


class Dialect(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file of the protocol's folder that is named like the ``dialect`` of a model: what its mounts do otherwise.

    has       the commands of ``commands.toml`` that they have, whatever that file says of models
    commands  those with another form or meaning, and those of their own
    driver    operation -> its implementations, instead of those of ``driver.toml``
    facts     what the driver's functions need to know
    """

    has: list[str]
    commands: dict[str, CommandRow] = {}
    driver: dict[str, list[Implementation]] = {}
    facts: dict[str, Any] = {}

    def spoken(self, where: str, rows: dict[str, CommandRow]) -> dict[str, CommandRow]:
        """Return its commands. Raises MappingError if it names a command that the protocol does not have."""
        if absent := sorted(set(self.has) - rows.keys()):
            raise MappingError(where, "has", f"there is no {', '.join(absent)}")
        return {name: replace(rows[name], models=None, since=None) for name in self.has} | self.commands

    def driven(self, rows: dict[str, list[Implementation]], has: frozenset[str]) -> dict[str, list[Implementation]]:
        """Return the implementations of operations: the rows whose commands the dialect has, and its own rows."""
        usable = {}
        for operation, ways in rows.items():
            possible = [replace(way, uses=[name for name in way.uses if name in has]) for way in ways]
            usable[operation] = [way for way in possible if way.commands and has.issuperset(way.needs)]
        return usable | self.driver
