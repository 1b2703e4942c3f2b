"""The mappings as objects: what a command looks like, what a surface does with it, how a driver carries it out.

Five files a protocol: ``commands.toml`` (the manual), ``surface.toml`` (a client says this -> what we do),
``own.toml`` (what a mount of the same protocol answers itself),
``driver.toml`` (to carry out an operation -> which commands), ``models.toml`` (what differs between models). A protocol
has those of them that it needs, and ``commands.toml`` always.
The verbs of a surface row are ask, keep, tell, say, call; those of a driver's way are send and call; there are no
others. Whatever cannot be used raises MappingError with file, row and reason. That a command ends a motion is said
once, beside the command (``urgent``), and which operation it is in its row of ``surface.toml``: whoever must know
before its turn, or before it is whole, asks here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TypeVar

import msgspec

from gateway.core import operations
from gateway.core.errors import MappingError
from gateway.core.tables import mappings_folder, read_table
from gateway.protocols.wireformat.command import Command, FrameTemplate
from gateway.protocols.wireformat.rows import KEEPS, OUTCOMES, CommandRow, Implementation, Model, OwnRow, SurfaceRow

_T = TypeVar("_T")
#: The words of ``urgent`` for what acts in the moment in which it comes.
AT_ONCE = ("stop", "restart", "axis")


class CommandSet:
    """One protocol: commands always, the other three tables when first asked for."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        rows = self._read("commands.toml", CommandRow)
        self.commands = {key: Command(self._where("commands.toml"), key, row) for key, row in rows.items()}
        self._by_literal: dict[bytes, list[tuple[Command, FrameTemplate]]] = {}
        for command in self.commands.values():
            for name in command.takes_back:
                if name not in self.commands:
                    raise MappingError(self._where("commands.toml"), command.name, f"takes_back: there is no [{name}]")
            for picture in command.requests if command.asked else ():
                self._by_literal.setdefault(picture.literal, []).append((command, picture))
        self._longest = max(map(len, self._by_literal), default=0)
        self._extra: dict[str, dict[str, Model]] = {}

    def _where(self, file: str) -> str:
        return f"mappings/{self.name}/{file}"

    def _read(self, file: str, form: type[_T]) -> dict[str, _T]:
        """One TOML file, row by row, so that an error can name its row; nothing where there is none."""
        path = self.folder / file
        if file != "commands.toml" and self.folder.is_dir() and not path.exists():
            return {}
        rows = {}
        for key, value in read_table(f"{self.name}/{file}", self.folder).items():
            try:
                rows[key] = msgspec.convert(value, form)
            except msgspec.ValidationError as error:
                raise MappingError(self._where(file), key, str(error)) from None
        return rows

    @cached_property
    def surface(self) -> dict[str, SurfaceRow]:
        """Command name -> what the surface does with it."""
        where, rows = self._where("surface.toml"), self._read("surface.toml", SurfaceRow)
        for key, row in rows.items():
            self._check_surface(where, key, row)
        return rows

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
        if self.commands[key].urgent in ("stop", "axis") and row.ask is None:
            raise MappingError(where, key, "a command that ends a motion says which operation that is: ask")
        if row.given and row.ask is None:
            raise MappingError(where, key, "given is for a row that asks an operation")
        if "refused" in (row.outcome, row.without) and not row.why:
            raise MappingError(where, key, "a refused row says why")

    @cached_property
    def own(self) -> dict[str, OwnRow]:
        """Command name -> who answers it where the mount itself is presented."""
        where, rows = self._where("own.toml"), self._read("own.toml", OwnRow)
        for key, row in rows.items():
            if key not in self.commands:
                raise MappingError(where, key, "commands.toml has no such command")
            if row.keep is not None and row.keep not in KEEPS:
                raise MappingError(where, key, f"keep = {row.keep!r} is none of {', '.join(KEEPS)}")
        return rows

    @cached_property
    def driver(self) -> dict[str, list[Implementation]]:
        """Operation name -> the ways to carry it out, best first."""
        where, rows = self._where("driver.toml"), self._read("driver.toml", list[Implementation])
        for key, ways in rows.items():
            if operations.named(key) is None:
                raise MappingError(where, key, "no operation is called so")
            for way in ways:
                self._check_way(where, key, way)
        return rows

    def _check_way(self, where: str, key: str, way: Implementation) -> None:
        if bool(way.send) == bool(way.call):
            raise MappingError(where, key, "one of send, call is needed")
        if key == "AbortMotion" and not way.ends:
            raise MappingError(where, key, "it needs ends: its commands that end a motion and do nothing else")
        for name in (*way.commands, *way.ends):
            if name not in self.commands:
                raise MappingError(where, key, f"commands.toml has no [{name}]")
        if way.outcome not in OUTCOMES:
            raise MappingError(where, key, f"outcome {way.outcome!r} is none of {', '.join(OUTCOMES)}")

    @cached_property
    def models(self) -> dict[str, Model]:
        return self._read("models.toml", Model)

    def traits(self, model: str, wedge: bool = False) -> frozenset[str]:
        """What rows may ask of a model: its name, how it is mounted, what it ``has``, and its keys that are true.

        A fork is ``alt-az``, or ``equatorial`` on a wedge, as a German mount always is.
        """
        facts = self.models.get(model, {})
        flags = (key for key, value in facts.items() if value is True)
        build = facts.get("mount", "")
        moves = {"german": "equatorial", "fork": "equatorial" if wedge else "alt-az"}.get(build, "")
        return frozenset((model, build, moves, *facts.get("has", ()), *flags))

    def extra(self, file: str) -> dict[str, Model]:
        """A further table of this protocol, such as ``rates.toml``."""
        if file not in self._extra:
            self._extra[file] = self._read(file, Model)
        return self._extra[file]

    @cached_property
    def ends_at_once(self) -> dict[bytes, Command]:
        """The commands that end something in the moment in which they come, by their frames."""
        urgent = [command for command in self.commands.values() if command.urgent in AT_ONCE]
        return {command.request.literal: command for command in urgent if command.name in self.surface}

    def taken_back_by(self, command: Command) -> frozenset[bytes]:
        """The commands that do not get their turn any more when it comes."""
        return frozenset([self.commands[name].request.literal for name in command.takes_back])

    @cached_property
    def _marks(self) -> re.Pattern[bytes] | None:
        marks = {command.mark for command in self.commands.values() if command.urgent}
        return re.compile(b"|".join(map(re.escape, sorted(marks)))) if marks else None

    def may_end_motion(self, data: bytes) -> bool:
        """Whether these bytes, which are not cut into commands yet, may be or hold the end of a motion."""
        return self._marks is not None and self._marks.search(data) is not None

    def find(self, frame: bytes) -> tuple[Command, FrameTemplate] | None:
        """The command whose template fits the whole frame, longest literal beginning first."""
        for command, picture in self._beginning(frame):
            if picture.matcher.fullmatch(frame):
                return command, picture
        return None

    def _beginning(self, data: bytes) -> Iterator[tuple[Command, FrameTemplate]]:
        """Those with whose literals these bytes begin, the longest first."""
        for length in range(min(len(data), self._longest), 0, -1):
            yield from self._by_literal.get(data[:length], ())

    def first(self, data: bytes) -> bytes:
        """The whole command that these bytes begin with; empty when they begin with none."""
        matches = (picture.matcher.match(data) for _, picture in self._beginning(data))
        return next((found[0] for found in matches if found), b"")

    def may_begin(self, data: bytes) -> bool:
        """Whether these bytes are nothing, or may be the beginning of a command."""
        return not data or any(literal.startswith(data[: len(literal)]) for literal in self._by_literal)

    def begun(self, beginning: bytes) -> Command | None:
        """The command that these bytes, which lack the end (``#``), begin: the one with the longest literal."""
        for length in range(min(len(beginning), self._longest), 0, -1):
            for literal in (beginning[:length] + b"#", beginning[:length]):
                for command, _ in self._by_literal.get(literal, ()):
                    return command
        return None


@lru_cache
def load(name: str) -> CommandSet:
    """The tables of the protocol of that name. Raises MappingError."""
    return CommandSet(name, mappings_folder() / name)
