"""The mappings as objects: what a command looks like, what a surface does with it, how a driver carries it out.

Five files a protocol: ``commands.toml`` (the manual), ``surface.toml`` (a client says this -> what we do),
``own.toml`` (what a mount of the same protocol answers itself),
``driver.toml`` (to carry out an operation -> which commands), ``models.toml`` (what differs between models).
The verbs of a surface row are ask, keep, tell, say, call; those of a driver's way are send and call; there are no
others. Whatever cannot be used raises MappingError with file, row and reason. (tomli is the standard library's own
parser, compiled: starting takes 20 ms less.)
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import tomli

import gateway
from gateway.core import operations
from gateway.core.errors import MappingError
from gateway.protocols.wireformat.template import FrameTemplate, Source

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
OUTCOMES = ("translated", "derived", "kept", "synthesised", "refused", "silent")


def parse_version(text: str) -> Version:
    """``"4.21"`` -> (4, 21). Raises ValueError."""
    return tuple(int(part) for part in text.split("."))


def show_version(version: Version) -> str:
    """The manual's way of writing: one digit below 3 (1.6, 2.2), two from 3 on (3.01, 4.10)."""
    major, minor = version[:2]
    return f"{major}.{minor:02d}" if major > 2 and major < 100 else f"{major}.{minor}"


class Reply(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One form of reply. ``when`` chooses by the client's format, ``fault`` is the error it stands for."""

    wire: Source
    when: str | None = None
    fault: str | None = None


class CommandRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A command as ``commands.toml`` writes it. One that ``acts`` tells a value, and does something besides."""

    request: str | list[str | int]
    help: str
    reply: str | list[str | int | Reply] | None = None
    models: list[str] | None = None
    since: str | None = None
    beyond: str | None = None
    acts: bool = False


class SurfaceRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a surface does with a command: exactly one of the five verbs, and what a reader should know.

    One that ``passes`` means nothing here, but something to a mount of the same protocol that has it. Without a word
    on that, what is refused here passes. Where ``models`` names the presented models that it is for, or what they
    are or have (``traits``), the outcome on all others is ``elsewhere``, as it is over mounts
    that are or have what ``apart`` names. For an example of it a program has said
    ``after`` before, the mount has come to rest, and then ``during``.
    """

    ask: str | None = None
    keep: list[str] | None = None
    tell: list[str] | None = None
    say: dict[str, Any] | None = None
    call: str | None = None
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


class Way(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One way of carrying out an operation: the commands it sends, or a Python special, what it needs and what it uses.

    A way whose ``send`` or ``needs`` the mount lacks is passed over; the others it uses where there are some. ``part``
    names what a model must be or have for it (``traits``); the tables count by it. ``aligned`` says that it is taken on
    an aligned mount alone, or only before the alignment.
    """

    send: list[str] = []
    call: str | None = None
    needs: list[str] = []
    uses: list[str] = []
    part: str | None = None
    aligned: bool | None = None
    outcome: str = "translated"
    why: str | None = None

    @property
    def commands(self) -> list[str]:
        return self.send + self.needs + self.uses


class Command:
    """A command ready for use: its request forms, its reply forms, and who has it."""

    __slots__ = ("acts", "beyond", "help", "models", "name", "replies", "request", "requests", "since")

    def __init__(self, where: str, name: str, row: CommandRow) -> None:
        self.name, self.help, self.beyond, self.acts = name, row.help, row.beyond, row.acts
        self.models = frozenset(row.models) if row.models is not None else None
        try:
            self.since = parse_version(row.since) if row.since else None
            self.requests = [FrameTemplate(source) for source in _requests(row.request)]
            self.replies = [(reply, FrameTemplate(reply.wire)) for reply in _replies(row.reply)]
        except ValueError as error:
            raise MappingError(where, name, str(error)) from None
        self.request = self.requests[0]

    @property
    def question(self) -> bool:
        """Whether it asks for a value and does nothing else."""
        return not self.acts and any(reply.fault is None and picture.fields for reply, picture in self.replies)

    def known_to(self, model: str | None, version: Version | None) -> bool:
        """Whether this model and version have the command, by the manual."""
        if self.models is not None and model is not None and model not in self.models:
            return False
        return self.since is None or version is None or version >= self.since

    def __repr__(self) -> str:
        return f"Command({self.name})"


def _requests(request: str | list[str | int]) -> list[Source]:
    """A list of letters, numbers and fields is one binary frame; a list of longer strings is alternatives."""
    if isinstance(request, str):
        return [request]
    if all(isinstance(piece, int) or len(piece) == 1 or piece.startswith("{") for piece in request):
        return [request]
    return [str(piece) for piece in request]


def _replies(reply: str | list[str | int | Reply] | None) -> list[Reply]:
    if reply is None:
        return []
    variants = [item for item in reply if isinstance(item, Reply)]
    if isinstance(reply, str) or not variants:
        return [Reply(wire=reply)]  # type: ignore[arg-type]
    return variants


class CommandSet:
    """One protocol: commands always, the other three tables when first asked for."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        rows = self._read("commands.toml", CommandRow)
        self.commands = {key: Command(self._where("commands.toml"), key, row) for key, row in rows.items()}
        self._by_literal: dict[bytes, list[tuple[Command, FrameTemplate]]] = {}
        for command in self.commands.values():
            for picture in command.requests:
                self._by_literal.setdefault(picture.literal, []).append((command, picture))
        self._surface: dict[str, SurfaceRow] | None = None
        self._own: dict[str, OwnRow] | None = None
        self._driver: dict[str, list[Way]] | None = None
        self._models: dict[str, Model] | None = None

    def _where(self, file: str) -> str:
        return f"mappings/{self.name}/{file}"

    def _read(self, file: str, form: Any) -> dict[str, Any]:
        """One TOML file, row by row, so that an error can name its row."""
        try:
            tables = tomli.loads((self.folder / file).read_text("utf-8"))
        except (OSError, tomli.TOMLDecodeError) as error:
            raise MappingError(self._where(file), "file", str(error)) from None
        rows = {}
        for key, value in tables.items():
            try:
                rows[key] = msgspec.convert(value, form)
            except msgspec.ValidationError as error:
                raise MappingError(self._where(file), key, str(error)) from None
        return rows

    @property
    def surface(self) -> dict[str, SurfaceRow]:
        """Command name -> what the surface does with it."""
        if self._surface is None:
            where, rows = self._where("surface.toml"), self._read("surface.toml", SurfaceRow)
            for key, row in rows.items():
                self._check_surface(where, key, row)
            self._surface = rows
        return self._surface

    def _check_surface(self, where: str, key: str, row: SurfaceRow) -> None:
        if key not in self.commands:
            raise MappingError(where, key, "commands.toml has no such command")
        if len(row.verbs) != 1:
            raise MappingError(where, key, "one verb of ask, keep, tell, say, call is needed")
        for name in row.operations:
            if operations.named(name) is None:
                raise MappingError(where, key, f"no operation is called {name!r}")
        for outcome in (row.outcome, row.without, row.elsewhere):
            if outcome is not None and outcome not in OUTCOMES:
                raise MappingError(where, key, f"outcome {outcome!r} is none of {', '.join(OUTCOMES)}")
        if "refused" in (row.outcome, row.without) and not row.why:
            raise MappingError(where, key, "a refused row says why")

    @property
    def own(self) -> dict[str, OwnRow]:
        """Command name -> who answers it where the mount itself is presented."""
        if self._own is None:
            where, rows = self._where("own.toml"), self._read("own.toml", OwnRow)
            for key, row in rows.items():
                if key not in self.commands:
                    raise MappingError(where, key, "commands.toml has no such command")
                if row.keep is not None and row.keep not in KEEPS:
                    raise MappingError(where, key, f"keep = {row.keep!r} is none of {', '.join(KEEPS)}")
            self._own = rows
        return self._own

    @property
    def driver(self) -> dict[str, list[Way]]:
        """Operation name -> the ways to carry it out, best first."""
        if self._driver is None:
            where, rows = self._where("driver.toml"), self._read("driver.toml", list[Way])
            for key, ways in rows.items():
                if operations.named(key) is None:
                    raise MappingError(where, key, "no operation is called so")
                for way in ways:
                    self._check_way(where, key, way)
            self._driver = rows
        return self._driver

    def _check_way(self, where: str, key: str, way: Way) -> None:
        if bool(way.send) == bool(way.call):
            raise MappingError(where, key, "one of send, call is needed")
        for name in way.commands:
            if name not in self.commands:
                raise MappingError(where, key, f"commands.toml has no [{name}]")
        if way.outcome not in OUTCOMES:
            raise MappingError(where, key, f"outcome {way.outcome!r} is none of {', '.join(OUTCOMES)}")

    @property
    def models(self) -> dict[str, Model]:
        """Model name -> what differs."""
        if self._models is None:
            self._models = self._read("models.toml", dict[str, Any])
        return self._models

    def traits(self, model: str, wedge: bool = False) -> frozenset[str]:
        """What rows may ask of a model: its name, how it is mounted, what it ``has``, and its keys that are true.

        A fork is ``alt-az``, or ``equatorial`` on a wedge, as a German mount always is.
        """
        facts = self.models[model]
        flags = (key for key, value in facts.items() if value is True)
        build = facts.get("mount", "")
        moves = {"german": "equatorial", "fork": "equatorial" if wedge else "alt-az"}.get(build, "")
        return frozenset((model, build, moves, *facts.get("has", ()), *flags))

    def extra(self, file: str) -> dict[str, dict[str, Any]]:
        """A further table of this protocol, such as ``rates.toml``."""
        return self._read(file, dict[str, Any])

    def find(self, frame: bytes) -> tuple[Command, FrameTemplate] | None:
        """The command whose picture fits the whole frame, longest literal beginning first."""
        for length in range(min(len(frame), 8), 0, -1):
            for command, picture in self._by_literal.get(frame[:length], ()):
                if picture.matcher.fullmatch(frame):
                    return command, picture
        return None

    def first(self, data: bytes) -> bytes:
        """The whole command that these bytes begin with; empty when they begin with none."""
        for length in range(min(len(data), 8), 0, -1):
            for _, picture in self._by_literal.get(data[:length], ()):
                if found := picture.matcher.match(data):
                    return found[0]
        return b""

    def may_begin(self, data: bytes) -> bool:
        """Whether these bytes are nothing, or may be the beginning of a command."""
        return not data or any(literal.startswith(data[: len(literal)]) for literal in self._by_literal)

    def begun(self, beginning: bytes) -> Command | None:
        """The command that these bytes, which lack the end (``#``), begin: the one with the longest literal."""
        for length in range(min(len(beginning), 8), 0, -1):
            for literal in (beginning[:length] + b"#", beginning[:length]):
                for command, _ in self._by_literal.get(literal, ()):
                    return command
        return None


def mappings_folder() -> Path:
    """Where ``mappings/`` lies: inside the installed package, or beside it in a checkout."""
    here = Path(gateway.__file__).resolve().parent
    inside = here / "mappings"
    return inside if inside.is_dir() else here.parent / "mappings"


@lru_cache
def load(name: str) -> CommandSet:
    """The protocol of that name (``lx200`` or ``nexstar``). Raises MappingError."""
    return CommandSet(name, mappings_folder() / name)
