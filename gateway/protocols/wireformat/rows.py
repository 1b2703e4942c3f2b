"""The rows of the mappings, as TOML has them, the words that may stand in them, and the functions that they call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

import msgspec

#: A frame as it is drawn (``command.py``).
Source = str | list[str | int]
Version = tuple[int, ...]
#: What differs between models, as a row of ``models.toml`` says it.
Model = dict[str, Any]

#: How long what a mount answers itself serves everybody, and what stands against it.
KEEPS = {
    "fixed": "asked once, until the mount is found anew",
    "state": "one answer serves everybody for a second",
    "moment": "asked each time, and shared by those who ask meanwhile",
    "clock": "asked each time, unless a program has set another clock that is kept here",
    "site": "one answer serves everybody for a second, unless a program has set another site that is kept here",
    "order": "sent each time",
    "library": "its own object library, and this program's target",
}
#: What a question's answer does from one time to the next: by this it is told whether an answer can be believed.
ANSWERS = {
    "position": "moves",
    "clock": "runs as a clock does",
    "state": "stays as it is until something is done",
    "stream": "is another one every time",
}
#: What a command ends that must not wait behind others.
URGENT = {
    "stop": "every motion, and does nothing else",
    "restart": "every motion, and does more",
    "axis": "the motion of one axis",
    "part": "something else, or a motion in its turn",
}
OUTCOMES = ("translated", "derived", "kept", "synthesised", "refused", "silent")


def parse_version(text: str) -> Version:
    """``"4.21"`` -> (4, 21). Raises ValueError."""
    return tuple(int(part) for part in text.split("."))


def show_version(version: Version) -> str:
    """The manual's way of writing: one digit below 3 (1.6, 2.2), two from 3 on (3.01, 4.10)."""
    major, minor = version[:2]
    return f"{major}.{minor:02d}" if major > 2 and major < 100 else f"{major}.{minor}"


@cache
def handlers_of(*modules: ModuleType) -> Mapping[str, Callable[..., Any]]:
    """What the rows of a surface or a driver may ``call``: the functions that these modules define for others, by name.

    Raises ValueError where two have one name.
    """
    found: dict[str, Callable[..., Any]] = {}
    for module in modules:
        for name, value in vars(module).items():
            if isinstance(value, FunctionType) and value.__module__ == module.__name__ and not name.startswith("_"):
                if name in found:
                    raise ValueError(f"two functions that rows may call are named {name}")
                found[name] = value
    return found


class Reply(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One form of reply. ``when`` chooses by the client's format, ``fault`` is the error it stands for."""

    wire: Source
    when: str | None = None
    fault: str | None = None


class CommandRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A command as ``commands.toml`` writes it. One that ``acts`` tells a value, and does something besides.

    answer        what a question's answer does from one time to the next: a word of ``ANSWERS``
    urgent        what it ends: a word of ``URGENT``; ``urgent_at``: only with these values
    takes_back    the commands that have not had their turn yet, and do not get it, when this one comes
    long          it is work that takes the mount up to so many seconds
    while_seeking, while_asleep   whether the mount hears it while it seeks its home, or sleeps
    by_hand       it begins a motion by hand, or sets the rate of one: done at once or not at all
    may_be_silent   some mounts that have it leave it unanswered
    pushed        a program is told it every so many seconds without asking; then there may be no request
    """

    help: str
    request: str | list[str | int] = ""
    reply: str | list[str | int | Reply] | None = None
    models: list[str] | None = None
    since: str | None = None
    beyond: str | None = None
    acts: bool = False
    answer: str | None = None
    urgent: str | None = None
    urgent_at: dict[str, object] = {}
    takes_back: list[str] = []
    long: float | None = None
    while_seeking: bool = False
    while_asleep: bool | None = None
    by_hand: bool = False
    may_be_silent: bool = False
    pushed: float | None = None


class SurfaceRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a surface does with a command: exactly one of the five verbs, and what a reader should know.

    One that ``passes`` means nothing here, but something to a mount of the same protocol that has it. Without a word
    on that, what is refused here passes. Where ``models`` names the presented models that it is for, or what they
    are or have (``traits``), the outcome on all others is ``elsewhere``, as it is over mounts
    that are or have what ``apart`` names. An operation that is asked has the values of the command, those that are
    ``given`` here, and what the client has set before. For an example of it a program has said
    ``after`` before, the mount has come to rest, and then ``during``.
    """

    ask: str | None = None
    keep: list[str] | None = None
    tell: list[str] | None = None
    say: dict[str, object] | None = None
    call: str | None = None
    given: dict[str, object] = {}
    asks: list[str] = []
    outcome: str | None = None
    without: str | None = None
    passes: bool | None = None
    models: list[str] | None = None
    elsewhere: str | None = None
    apart: list[str] = []
    after: list[str] = []
    during: list[str] = []
    why: str | None = None

    @property
    def verbs(self) -> list[str]:
        return [verb for verb in ("ask", "keep", "tell", "say", "call") if getattr(self, verb) is not None]

    @property
    def handed_on(self) -> bool:
        """Whether it goes to a mount of the same protocol as it is."""
        return self.outcome == "refused" if self.passes is None else self.passes

    @property
    def operations(self) -> list[str]:
        """Every operation this row may ask of the mount."""
        return ([self.ask] if self.ask else []) + self.asks


class OwnRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the mount itself answers to programs of its own protocol, where nobody has named a model to present.

    ``keep`` is a word of ``KEEPS``; without one the gateway goes on answering, and ``why`` says why.
    """

    keep: str | None = None
    why: str | None = None


class Implementation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One way of carrying out an operation: the commands it sends, or a Python special, what it needs and what it uses.

    A way whose ``send`` or ``needs`` the mount lacks is passed over; the others it uses where there are some. ``part``
    names what a model must be or have for it (``traits``); the tables count by it. Of the commands that a stop consists
    of, ``ends`` are those that end a motion and do nothing else. ``aligned`` says that it is taken on
    an aligned mount alone, or only before the alignment.
    """

    send: list[str] = []
    call: str | None = None
    needs: list[str] = []
    uses: list[str] = []
    ends: list[str] = []
    part: str | None = None
    aligned: bool | None = None
    outcome: str = "translated"
    why: str | None = None

    @property
    def commands(self) -> list[str]:
        return self.send + self.needs + self.uses
