"""The mapping files of a protocol as objects: its commands, what a surface does with them, how a driver uses them.

A protocol has up to five files: ``commands.toml`` (always; the manual), ``surface.toml`` (command -> what the gateway
does), ``own.toml`` (commands that a mount of the same protocol answers itself), ``driver.toml`` (operation -> commands)
and ``models.toml`` (differences between models). A dialect, of another maker's mounts, has a file that replaces some
commands and driver rows. Types and keys are checked when a file is loaded: a mistake raises MappingError with file, row
and reason. docs/tools/mistakes.py checks the names in the rows of all files before a release.
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
#: The parameters that the function of a surface row may have; each function names only those that it uses.
HANDLER_PARAMETERS = ("session", "command", "values")
#: The values of ``urgent`` for commands that act as soon as they arrive.
IMMEDIATE_KINDS = ("stop", "restart", "axis")


class CommandSet:
    """The tables of a protocol or ``dialect``. All but commands and models load on first use. Raises MappingError."""

    def __init__(self, name: str, folder: Path, dialect: str = "") -> None:
        self.name, self.folder, self.dialect = name, folder, dialect
        rows = self._read_rows("commands.toml", CommandRow)
        self.dialect_rows = self._read_dialect(dialect) if dialect else None
        if self.dialect_rows is not None:
            rows = self.dialect_rows.merged_commands(self._file_name(f"{dialect}.toml"), rows)
        self.commands = {key: Command(self._file_name("commands.toml"), key, row) for key, row in rows.items()}
        self._by_prefix: dict[bytes, list[tuple[Command, FrameTemplate]]] = {}
        for command in self.commands.values():
            for template in command.requests if command.requested else ():
                self._by_prefix.setdefault(template.prefix, []).append((command, template))
        self._max_prefix_length = max(map(len, self._by_prefix), default=0)
        self._extra_tables: dict[str, dict[str, Model]] = {}
        self._sets_by_dialect: dict[str, CommandSet] = {}
        for model, facts in () if dialect else self.models.items():
            for name in self.commands.keys() - frozenset(facts.get("commands", self.commands)):
                self.commands[name].lacking_models |= {model}

    def _file_name(self, file: str) -> str:
        return f"mappings/{self.name}/{file}"

    def _read_dialect(self, dialect: str) -> Dialect:
        try:
            return msgspec.convert(read_table(f"{self.name}/{dialect}.toml", self.folder), Dialect)
        except msgspec.ValidationError as error:
            raise MappingError(self._file_name(f"{dialect}.toml"), dialect, str(error)) from None

    @cached_property
    def dialect_by_model(self) -> dict[str, str]:
        """Model -> its dialect, for the models of a dialect that has a file."""
        spoken = {model: row.get("dialect", "") for model, row in self.models.items()}
        return {model: name for model, name in spoken.items() if name and (self.folder / f"{name}.toml").exists()}

    @property
    def presented_models(self) -> list[str]:
        """The models that a surface can present: those without a dialect that has a file."""
        return [model for model in self.models if model not in self.dialect_by_model]

    def model_of_product(self, product: str) -> str | None:
        """Return the model of another maker whose product name is the beginning of ``product``; None for a mount of the
        protocol's own maker, ``other`` for one of an unknown maker.
        """
        beginnings = [name for row in self.models.values() for name in row.get("names_begin", ())]
        named = dict.fromkeys(beginnings) | {self.models[model]["product"]: model for model in self.dialect_by_model}
        return next((model for name, model in named.items() if name and product.startswith(name)), "other")

    def in_dialect_of(self, model: str | None) -> CommandSet:
        """Return the tables in the dialect of this model; a dialect is loaded when it is first needed."""
        dialect = self.dialect_by_model.get(model or "")
        if dialect is None:
            return self
        if dialect not in self._sets_by_dialect:
            self._sets_by_dialect[dialect] = CommandSet(self.name, self.folder, dialect)
        return self._sets_by_dialect[dialect]

    def _read_rows(self, file: str, row_type: type[_T]) -> dict[str, _T]:
        """Return the rows of a TOML file as ``row_type``; empty if an optional file is missing. Raises MappingError."""
        path = self.folder / file
        if file != "commands.toml" and self.folder.is_dir() and not path.exists():
            return {}
        table = read_table(f"{self.name}/{file}", self.folder)
        return {key: self._convert_row(file, key, row, row_type) for key, row in table.items()}

    def _convert_row(self, file: str, key: str, row: Any, row_type: type[_T]) -> _T:
        try:
            return msgspec.convert(row, row_type)
        except msgspec.ValidationError as error:
            raise MappingError(self._file_name(file), key, str(error)) from None

    @cached_property
    def surface_rows(self) -> dict[str, SurfaceRow]:
        """Command name -> the row that says what the surface does with it."""
        return self._read_rows("surface.toml", SurfaceRow)

    @cached_property
    def own_rows(self) -> dict[str, OwnRow]:
        """Command name -> its row of ``own.toml``: whether the mount itself answers it."""
        return self._read_rows("own.toml", OwnRow)

    @cached_property
    def driver_rows(self) -> dict[str, list[Implementation]]:
        """Operation name -> its implementations, the preferred first."""
        rows = self._read_rows("driver.toml", list[Implementation])
        return rows if self.dialect_rows is None else self.dialect_rows.merge(rows, frozenset(self.commands))

    @cached_property
    def models(self) -> dict[str, Model]:
        """Model -> its row of ``models.toml``; keys that it lacks come from the model that its key ``like`` names."""
        rows = self._read_rows("models.toml", Model)
        return {name: {**rows.get(row.get("like", ""), {}), **row} for name, row in rows.items()}

    def lacking_commands(self, model: str | None) -> frozenset[str]:
        """Return the commands that a model lacks, by its row in ``models.toml``."""
        return frozenset(name for name, command in self.commands.items() if model in command.lacking_models)

    def model_title(self, product: str, model: str) -> str:
        """Return the usual name of a model; the reported ``product`` if that is not a name of this model."""
        row = self.models.get(model, {})
        return str(row.get("title", product)) if product and row.get("product", "").startswith(product) else product

    def traits(self, model: str, on_wedge: bool = False, facts: Model | None = None) -> frozenset[str]:
        """Return the traits of a model, which rows may require: its name, dialect, mount type, the words of its key
        ``has``, and its keys that are true. A fork is ``alt-az``, or ``equatorial`` on a wedge; a German mount is
        ``equatorial``. ``facts`` is its row in ``models.toml`` unless given.
        """
        facts = self.models.get(model, {}) if facts is None else facts
        flags = (key for key, value in facts.items() if value is True)
        build = facts.get("mount", "")
        moves = {"german": "equatorial", "fork": "equatorial" if on_wedge else "alt-az"}.get(build, build)
        return frozenset((model, build, moves, facts.get("dialect", ""), *facts.get("has", ()), *flags))

    def extra_table(self, file: str) -> dict[str, Model]:
        """Return another table, such as ``rates.toml``; empty if the protocol has no such file. Raises MappingError."""
        if file not in self._extra_tables:
            self._extra_tables[file] = self._read_rows(file, Model)
        return self._extra_tables[file]

    @cached_property
    def immediate_commands(self) -> dict[bytes, Command]:
        """Frame -> command, for the urgent commands that end a motion as soon as they arrive."""
        urgent = [command for command in self.commands.values() if command.urgent in IMMEDIATE_KINDS]
        return {command.request.prefix: command for command in urgent if command.name in self.surface_rows}

    @cached_property
    def partly_read_replies(self) -> dict[bytes, int]:
        """Frame -> how many bytes some programs read of its reply; only commands whose reply is not read to the end."""
        return {command.request.prefix: command.read for command in self.commands.values() if command.read is not None}

    def discarded_prefixes(self, command: Command) -> frozenset[bytes]:
        """Return the request prefixes of the commands that this command, when it arrives, discards from the queue."""
        return frozenset([self.commands[name].request.prefix for name in command.discarded_commands])

    def find(self, frame: bytes) -> tuple[Command, FrameTemplate] | None:
        """Return the command of a frame, and which of its request templates the frame has; None if there is none."""
        for command, template in self._prefix_matches(frame):
            if template.matcher.fullmatch(frame):
                return command, template
        return None

    def _prefix_matches(self, data: bytes) -> Iterator[tuple[Command, FrameTemplate]]:
        """Yield the commands and templates whose literal prefix ``data`` begins with, the longest prefix first."""
        for length in range(min(len(data), self._max_prefix_length), 0, -1):
            yield from self._by_prefix.get(data[:length], ())

    def first_command(self, data: bytes) -> bytes:
        """Return the bytes of the complete command that ``data`` begins with; empty if there is none."""
        matches = (template.matcher.match(data) for _, template in self._prefix_matches(data))
        return next((match[0] for match in matches if match), b"")

    def may_begin(self, data: bytes) -> bool:
        """Whether a command can begin with these bytes; true for empty bytes."""
        return not data or any(prefix.startswith(data[: len(prefix)]) for prefix in self._by_prefix)

    def begun_command(self, beginning: bytes) -> Command | None:
        """Return the command with the longest prefix (without its ``#``) that these bytes begin with; None if none."""
        for length in range(min(len(beginning), self._max_prefix_length), 0, -1):
            for prefix in (beginning[:length] + b"#", beginning[:length]):
                for command, _ in self._by_prefix.get(prefix, ()):
                    return command
        return None


@lru_cache
def functions_of(*modules: ModuleType) -> Mapping[str, Callable[..., Any]]:
    """Return ``module.function`` -> function for the public functions of these modules, which driver rows may name."""
    return {
        f"{module.__name__.rpartition('.')[2]}.{name}": value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__ and not name.startswith("_")
    }


@lru_cache
def surface_functions(*modules: ModuleType) -> Mapping[str, Callable[..., Any]]:
    """Return ``module.function`` -> function for surface rows; each accepts all of ``HANDLER_PARAMETERS``."""
    return {name: _with_all_parameters(function) for name, function in functions_of(*modules).items()}


def parameter_names(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    code = function.__code__
    return code.co_varnames[: code.co_argcount]


def _with_all_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function: the wrapper accepts all of ``HANDLER_PARAMETERS``, and passes on those that ``function`` has."""
    names = parameter_names(function)
    if names == HANDLER_PARAMETERS or not set(names).issubset(HANDLER_PARAMETERS):
        return function
    indices = [HANDLER_PARAMETERS.index(name) for name in names]
    return lambda *arguments: function(*[arguments[index] for index in indices])


@lru_cache
def load(name: str) -> CommandSet:
    """Return the command set of a protocol, loaded once. Raises MappingError."""
    return CommandSet(name, mappings_folder() / name)
