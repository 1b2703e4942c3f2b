"""The tables of a protocol as objects: its commands, what a surface does with them, how a driver uses them.

A protocol has up to five files: ``commands.toml`` (always; the manual), ``surface.toml`` (command -> what the gateway
does), ``own.toml`` (commands that a mount of the same protocol answers itself), ``driver.toml`` (operation -> commands)
and ``models.toml`` (differences between models). The file of a dialect, for another maker's mounts, changes commands
and driver (``of``). The verbs of a surface row are ask, tell, say and call; a driver row has call. Types and keys are
checked when a file is loaded: a mistake raises MappingError with file, row and reason. The names in rows are checked by
docs/tools/mistakes.py, for all files at once, before they are released.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import msgspec

from gateway.core.errors import MappingError
from gateway.core.tables import mappings_folder, read_table
from gateway.protocols.wireformat.command import Command, FrameTemplate
from gateway.protocols.wireformat.rows import CommandRow, Dialect, Implementation, Model, OwnRow, SurfaceRow

_T = TypeVar("_T")
#: What the function of a surface row may take, by name: each takes what it uses.
GIVEN = ("session", "command", "values")
#: The values of ``urgent`` for commands that act as soon as they arrive.
AT_ONCE = ("stop", "restart", "axis")


class CommandSet:
    """The tables of a protocol, or of a ``dialect`` of it: commands and models are loaded at once, others later."""

    def __init__(self, name: str, folder: Path, dialect: str = "") -> None:
        self.name, self.folder, self.dialect = name, folder, dialect
        rows = self._read("commands.toml", CommandRow)
        self.other = self._dialect(dialect) if dialect else None
        if self.other is not None:
            rows = self.other.spoken(self._where(f"{dialect}.toml"), rows)
        self.commands = {key: Command(self._where("commands.toml"), key, row) for key, row in rows.items()}
        self._by_prefix: dict[bytes, list[tuple[Command, FrameTemplate]]] = {}
        for command in self.commands.values():
            for template in command.requests if command.asked else ():
                self._by_prefix.setdefault(template.prefix, []).append((command, template))
        self._longest = max(map(len, self._by_prefix), default=0)
        self._extra: dict[str, dict[str, Model]] = {}
        self._spoken: dict[str, CommandSet] = {}
        for model, facts in () if dialect else self.models.items():
            for name in self.commands.keys() - frozenset(facts.get("commands", self.commands)):
                self.commands[name].lacking |= {model}

    def _where(self, file: str) -> str:
        return f"mappings/{self.name}/{file}"

    def _dialect(self, dialect: str) -> Dialect:
        try:
            return msgspec.convert(read_table(f"{self.name}/{dialect}.toml", self.folder), Dialect)
        except msgspec.ValidationError as error:
            raise MappingError(self._where(f"{dialect}.toml"), dialect, str(error)) from None

    @cached_property
    def dialects(self) -> dict[str, str]:
        """Model -> its dialect, for the models of a dialect that has a file."""
        spoken = {model: row.get("dialect", "") for model, row in self.models.items()}
        return {model: name for model, name in spoken.items() if name and (self.folder / f"{name}.toml").exists()}

    @property
    def presented(self) -> list[str]:
        """The models that a surface can present: those without a dialect."""
        return [model for model in self.models if model not in self.dialects]

    def by_product(self, product: str) -> str | None:
        """Return the model with a dialect that has this product name; ``other`` if the name is of no known maker; None
        for a mount of the protocol's own maker.
        """
        beginnings = [name for row in self.models.values() for name in row.get("names_begin", ())]
        named = dict.fromkeys(beginnings) | {self.models[model]["product"]: model for model in self.dialects}
        return next((model for name, model in named.items() if name and product.startswith(name)), "other")

    def of(self, model: str | None) -> CommandSet:
        """Return the tables in the dialect of this model, which are loaded with the first mount that speaks it."""
        dialect = self.dialects.get(model or "")
        if dialect is None:
            return self
        if dialect not in self._spoken:
            self._spoken[dialect] = CommandSet(self.name, self.folder, dialect)
        return self._spoken[dialect]

    def _read(self, file: str, form: type[_T]) -> dict[str, _T]:
        """Convert a TOML file row by row, so that an error can name its row; an optional file may be missing."""
        path = self.folder / file
        if file != "commands.toml" and self.folder.is_dir() and not path.exists():
            return {}
        table = read_table(f"{self.name}/{file}", self.folder)
        return {key: self._converted(file, key, row, form) for key, row in table.items()}

    def _converted(self, file: str, key: str, row: Any, form: type[_T]) -> _T:
        try:
            return msgspec.convert(row, form)
        except msgspec.ValidationError as error:
            raise MappingError(self._where(file), key, str(error)) from None

    @cached_property
    def surface(self) -> dict[str, SurfaceRow]:
        """Command name -> the row that says what the surface does with it."""
        return self._read("surface.toml", SurfaceRow)

    @cached_property
    def own(self) -> dict[str, OwnRow]:
        """Command name -> the row that says who answers it when a surface presents the mount itself."""
        return self._read("own.toml", OwnRow)

    @cached_property
    def driver(self) -> dict[str, list[Implementation]]:
        """Operation name -> its implementations, the preferred first."""
        rows = self._read("driver.toml", list[Implementation])
        return rows if self.other is None else self.other.driven(rows, frozenset(self.commands))

    @cached_property
    def models(self) -> dict[str, Model]:
        """Model -> its row, completed by the row of the model that it is ``like``."""
        rows = self._read("models.toml", Model)
        return {name: {**rows.get(row.get("like", ""), {}), **row} for name, row in rows.items()}

    def lacking(self, model: str | None) -> frozenset[str]:
        """Return the commands that the row of a model leaves out."""
        return frozenset(name for name, command in self.commands.items() if model in command.lacking)

    def title(self, product: str, model: str) -> str:
        """Return the name by which people know a mount of this model; ``product`` if the mount's product is another."""
        row = self.models.get(model, {})
        return str(row.get("title", product)) if product and row.get("product", "").startswith(product) else product

    def traits(self, model: str, wedge: bool = False, facts: Model | None = None) -> frozenset[str]:
        """Return the traits that rows may require of a model: name, dialect, mount type, what it ``has``, true keys.

        ``facts`` are those of its row, unless they differ on a surface. A fork is ``alt-az``, or ``equatorial`` on a
        wedge; a German mount is always ``equatorial``.
        """
        facts = self.models.get(model, {}) if facts is None else facts
        flags = (key for key, value in facts.items() if value is True)
        build = facts.get("mount", "")
        moves = {"german": "equatorial", "fork": "equatorial" if wedge else "alt-az"}.get(build, build)
        return frozenset((model, build, moves, facts.get("dialect", ""), *facts.get("has", ()), *flags))

    def extra(self, file: str) -> dict[str, Model]:
        """Return another table of this protocol, such as ``rates.toml``."""
        if file not in self._extra:
            self._extra[file] = self._read(file, Model)
        return self._extra[file]

    @cached_property
    def ends_at_once(self) -> dict[bytes, Command]:
        """Frame -> command, for the commands that end something as soon as they arrive."""
        urgent = [command for command in self.commands.values() if command.urgent in AT_ONCE]
        return {command.request.prefix: command for command in urgent if command.name in self.surface}

    @cached_property
    def partly_read(self) -> dict[bytes, int]:
        """Frame -> the number of bytes that some programs read of its reply, for commands whose reply is longer."""
        return {command.request.prefix: command.read for command in self.commands.values() if command.read is not None}

    def taken_back_by(self, command: Command) -> frozenset[bytes]:
        """Return the frames of the queued commands that this command discards when it arrives."""
        return frozenset([self.commands[name].request.prefix for name in command.takes_back])

    def find(self, frame: bytes) -> tuple[Command, FrameTemplate] | None:
        """Return the command and the template that fit the whole frame; the longest prefix is tried first."""
        for command, template in self._beginning(frame):
            if template.matcher.fullmatch(frame):
                return command, template
        return None

    def _beginning(self, data: bytes) -> Iterator[tuple[Command, FrameTemplate]]:
        """Yield the commands whose prefix these bytes begin with, the longest prefix first."""
        for length in range(min(len(data), self._longest), 0, -1):
            yield from self._by_prefix.get(data[:length], ())

    def first(self, data: bytes) -> bytes:
        """Return the whole command that these bytes begin with, or empty bytes."""
        matches = (template.matcher.match(data) for _, template in self._beginning(data))
        return next((match[0] for match in matches if match), b"")

    def may_begin(self, data: bytes) -> bool:
        """Whether these bytes are empty or may be the beginning of a command."""
        return not data or any(prefix.startswith(data[: len(prefix)]) for prefix in self._by_prefix)

    def begun(self, beginning: bytes) -> Command | None:
        """Return the command that begins like these bytes without the ``#``; of several, that of the longest prefix."""
        for length in range(min(len(beginning), self._longest), 0, -1):
            for prefix in (beginning[:length] + b"#", beginning[:length]):
                for command, _ in self._by_prefix.get(prefix, ()):
                    return command
        return None


def functions(*modules: ModuleType) -> Mapping[str, Callable[..., Any]]:
    """Return the public functions of these modules, ``module.function`` -> function, for the rows of a driver."""
    return {
        f"{module.__name__.rpartition('.')[2]}.{name}": value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__ and not name.startswith("_")
    }


def surface_functions(*modules: ModuleType) -> Mapping[str, Callable[..., Any]]:
    """Return the same for the rows of a surface: each is called with all of ``GIVEN``, and takes what it names."""
    return {name: _given(function) for name, function in functions(*modules).items()}


def parameters(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    code = function.__code__
    return code.co_varnames[: code.co_argcount]


def _given(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that accepts all of ``GIVEN``, and passes on the parameters that ``function`` has."""
    names = parameters(function)
    if names == GIVEN or not set(names).issubset(GIVEN):
        return function
    places = [GIVEN.index(name) for name in names]
    return lambda *given: function(*[given[place] for place in places])


@lru_cache
def load(name: str) -> CommandSet:
    """Return the command set of a protocol. Raises MappingError."""
    return CommandSet(name, mappings_folder() / name)
