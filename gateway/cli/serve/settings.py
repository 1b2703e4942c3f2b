"""Merges flags and ``gateway.toml``: keys of ``[mount]`` have flags of the same name, and flags win.

A key of a surface has a flag, too, which may be used if only one surface can be meant. If neither a file nor a mount is
named, the gateway.toml of the current folder is read.
"""

from __future__ import annotations

import argparse
import contextlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from gateway.app.config import Config, Source, make_config, read_tables
from gateway.app.config.describing import Key, keys_of
from gateway.app.config.endpoints import parse_site
from gateway.app.config.keys import OFF
from gateway.app.config.tables import TABLES
from gateway.core.errors import UserError
from gateway.system import streams

#: The groups of flags in ``--help``; a key that is in none of them belongs to the group of the mount.
FLAG_GROUPS = {
    "safety": (
        "lowest",
        "highest",
        "sun",
        "hour-angle-limit",
        "sync-limit",
        "unaligned",
        "run-on",
        "dead-man",
        "dead-man-closed",
        "watchdog",
    ),
    "how it runs": ("wait", "log", "night", "status", "record", "record-keep", "state", "almanac"),
    "simulated mounts": ("latency", "speed"),
}
MOUNT_GROUP = "about the mount"
SURFACE_GROUP_TITLE = "about the surface, where programs connect (if there are several: in the file)"
_NETWORK = (r".*@(tcp|rfc2217)://", "on a network (tcp:// or rfc2217://)")
#: Key that applies to some surfaces only -> pattern of the addresses of these surfaces, and their description.
KEY_SURFACES = {"allow": _NETWORK, "max-clients": _NETWORK, "names": (r"(alpaca|any)@", "for HTTP (alpaca@ or any@)")}
#: The value that means true for a flag that may be true or a list.
ALL = "all"
#: Table of gateway.toml -> title of its group of flags, and the key for each flag. Keys not listed have no flag.
TABLE_FLAGS = {
    "console": ("the console, a page in the browser", {"console": "at"}),
    "mqtt": (
        "an MQTT broker on which the mounts are shown, and from which they are stopped",
        {"mqtt": "at", "mqtt-id": "id"},
    ),
}
#: The file that is read if none is named.
DEFAULT_FILE = Path("gateway.toml")


def surface_keys() -> list[Key]:
    """Return the keys of a surface that have flags: those whose names no other table uses for flags."""
    others = {key.name for key in (*keys_of("mount"), *keys_of(""))} | {"mount"}
    return [key for key in keys_of("surface") if key.name not in others]


def add_setting_flags(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Add to a command the flags for everything that can be configured; return the flags that few users need."""
    before = {action.dest for action in parser._actions}
    ends = parser.add_argument_group("connections")
    ends.add_argument(
        "--mount",
        metavar="PROTOCOL@WHERE",
        help="for example nexstar@/dev/ttyUSB0",
        action=OnceAction,
        reason="write several mounts into gateway.toml, each under its own [[mount]] (mount-gateway config "
        "--example shows how)",
    )
    ends.add_argument(
        "--surface",
        metavar="PROTOCOL@WHERE",
        action="append",
        default=[],
        help="where programs connect, for example lx200@tcp://127.0.0.1:4030; may be repeated",
    )
    ends.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="read this gateway.toml; options given here win",
        action=OnceAction,
        reason="write one file",
    )
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help=argparse.SUPPRESS)
    groups = {title: parser.add_argument_group(title) for title in (MOUNT_GROUP, SURFACE_GROUP_TITLE, *FLAG_GROUPS)}
    for key in (*keys_of("mount"), *keys_of("")):
        group = groups[next((title for title, names in FLAG_GROUPS.items() if key.name in names), MOUNT_GROUP)]
        add_flag(group, key)
    for key in surface_keys():
        add_flag(groups[SURFACE_GROUP_TITLE], key)
    for table in TABLE_FLAGS:
        add_table_flags(parser, table)
    common = {key.name.replace("-", "_") for table in TABLES for key in keys_of(table) if key.in_short_help}
    common |= {*before, "mount", "surface", "config", "file", "console"}
    return [action for action in parser._actions if action.dest not in common]


def add_table_flags(parser: argparse.ArgumentParser, table: str) -> None:
    """Add the flags of a table of ``TABLE_FLAGS``."""
    about, flags = TABLE_FLAGS[table]
    group, known = parser.add_argument_group(about), {key.name: key for key in keys_of(table)}
    for flag, name in flags.items():
        group.add_argument(f"--{flag}", metavar=known[name].metavar, help=known[name].help)
    if table == "console":
        group.add_argument("--no-console", dest="console", action="store_const", const=OFF, help="no console")


def put_table_flags(arguments: argparse.Namespace, table: str, tables: dict[str, object], source: Source) -> None:
    """Put the flags of a table of ``TABLE_FLAGS`` into ``tables``, the content of gateway.toml, and into ``source``."""
    for flag, name in TABLE_FLAGS[table][1].items():
        value, table_values = getattr(arguments, flag.replace("-", "_")), tables.get(table, {})
        if value is not None and isinstance(table_values, dict):
            tables[table] = {**table_values, name: value}
            source.flags[(table, name)] = f"--no-{flag}" if value == OFF and table == "console" else f"--{flag}"


def add_flag(group: argparse._ActionsContainer, key: Key) -> None:
    """Add the flag of a key, if it has one. A flag that may stand alone then means true, or ``ALL`` for a list."""
    help_text = f"{key.description} (default: yes)" if key.default is True else key.description
    if isinstance(key.default, bool) and key.choices:
        group.add_argument(f"--{key.name}", nargs="?", const=True, type=_to_value, metavar=key.metavar, help=help_text)
        group.add_argument(f"--no-{key.name}", dest=key.name, action="store_const", const=False, help=argparse.SUPPRESS)
    elif isinstance(key.default, bool) and key.is_list:
        group.add_argument(f"--{key.name}", nargs="?", const=ALL, metavar=f"{ALL},{key.metavar}", help=help_text)
    elif isinstance(key.default, bool) or key.allowed == "true or false":
        group.add_argument(f"--{key.name}", action=argparse.BooleanOptionalAction, default=None, help=help_text)
    elif key.has_flag:
        group.add_argument(f"--{key.name}", metavar=key.metavar.replace("|", ","), help=key.help)


def _to_value(text: str) -> bool | str:
    """Convert ``true`` and ``false`` to booleans, as in gateway.toml; return any other word unchanged."""
    return {"true": True, "false": False}.get(text, text)


@contextlib.contextmanager
def errors_naming_flag(flag: str) -> Iterator[None]:
    """Put the name of a flag before the message of a UserError that the block raises about its value."""
    try:
        yield
    except UserError as error:
        raise UserError(f"{flag} {error}") from None


class OnceAction(argparse.Action):
    """A flag that may be given only once; ``reason`` says what to write instead of a second one."""

    def __init__(self, *arguments: Any, reason: str, **action_options: Any) -> None:
        super().__init__(*arguments, **action_options)
        self._reason = reason

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        if getattr(namespace, self.dest) is not None:
            raise UserError(f"{option_string} is given twice: {self._reason}")
        setattr(namespace, self.dest, values)


def load_config(arguments: argparse.Namespace, needs_surfaces: bool = True) -> tuple[Config, Source]:
    """Return the configuration, merged from gateway.toml and flags, and the source of its values. Raises UserError,
    also for a configuration without surfaces if ``needs_surfaces``.
    """
    tables: dict[str, object] = {}
    source = Source("command line")
    path = _config_path(arguments)
    if path is not None:
        tables, source = read_tables(path)
    _put_flags(arguments, tables, source)
    try:
        config = make_config(tables, source, needs_surfaces)
    except UserError as error:
        if path is None and not arguments.surface and DEFAULT_FILE.is_file():
            raise UserError(f"{error} ({DEFAULT_FILE} of this folder is not read where --mount is given)") from None
        raise
    if path is DEFAULT_FILE:
        streams.warn(f"using {DEFAULT_FILE} from this folder; --config FILE reads another one", streams.INFO)
    return config, source


def _config_path(arguments: argparse.Namespace) -> Path | None:
    """Return the file to read, if any: the named one, or ``DEFAULT_FILE`` if no mount is named. Raises UserError."""
    given: Path | None = arguments.config
    alone: Path | None = arguments.file
    if alone is not None:
        if given is not None and given != alone:
            raise UserError(f"{alone} and --config {given}: write one file")
        for flag, value in (("--mount", arguments.mount), *(("--surface", surface) for surface in arguments.surface)):
            if value and "@" not in value:
                place = re.sub(r"^(\w+):/(?=[^/])", r"\1://", str(alone))  # a path has lost its second slash
                raise UserError(f"{flag} {value} {place}: write {flag} {value}@{place}")
        if "@" in str(alone) and not alone.exists():
            raise UserError(f"{alone}: write --mount before the mount, and --surface before where programs connect")
        if alone.suffix != ".toml" and not alone.exists():
            raise UserError(f"{alone}: there is no such file. Values of one flag have no blanks: --site 48.1,11.6")
        given = alone
    return given or (DEFAULT_FILE if not arguments.mount and DEFAULT_FILE.is_file() else None)


def _given_values(arguments: argparse.Namespace, known_keys: Iterable[Key]) -> dict[str, Any]:
    """Return the values of the keys whose flags were given. Raises UserError for an invalid value."""
    given = {}
    for key in known_keys:
        if (text := getattr(arguments, key.name.replace("-", "_"))) is not None:
            given[key.name] = _parse_value(key, text)
    return given


def _put_flags(arguments: argparse.Namespace, tables: dict[str, object], source: Source) -> None:
    given = _given_values(arguments, [key for key in keys_of("mount") if key.has_flag])
    mounts = tables.get("mount", [{}])
    several = isinstance(mounts, list) and len(mounts) > 1
    if several and (given or arguments.mount or arguments.surface):
        flag = next(iter([*given, *(["mount"] if arguments.mount else []), "surface"]))
        raise UserError(f"--{flag}: {source.name} has several mounts; write it there, under the right one")
    if arguments.mount:
        given["at"] = arguments.mount
    if given and isinstance(mounts, list) and mounts and isinstance(mounts[0], dict):
        tables["mount"] = [mounts[0] | given]
        source.flags |= {("mount", 0, key): f"--{'mount' if key == 'at' else key}" for key in given}
    if arguments.surface:
        tables["surface"] = [{"at": surface} for surface in arguments.surface]
        source.flags |= {("surface", number): "--surface" for number in range(len(arguments.surface))}
    _put_surface_flags(arguments, tables, source)
    for table in TABLE_FLAGS:
        put_table_flags(arguments, table, tables, source)
    for key in keys_of(""):
        value = getattr(arguments, key.name)
        if value is not None:
            tables[key.name] = value
            source.flags[(key.name,)] = f"--{key.name}" if value else f"--no-{key.name}"


def _put_surface_flags(arguments: argparse.Namespace, tables: dict[str, object], source: Source) -> None:
    """Put the flags of a surface into the only ``[[surface]]`` that they fit. Raises UserError for several or none."""
    given = _given_values(arguments, surface_keys())
    surfaces = tables.get("surface", [])
    if not isinstance(surfaces, list) or not all(isinstance(surface, dict) for surface in surfaces):
        return  # ``make_config`` reports it
    for name, value in given.items():
        meant = [
            number
            for number, surface in enumerate(surfaces)
            if len(surfaces) == 1 or name not in KEY_SURFACES or re.match(KEY_SURFACES[name][0], str(surface.get("at")))
        ]
        if len(meant) > 1:
            raise UserError(
                f"--{name}: there are {len(meant)} surfaces; write {name} in gateway.toml, under the right "
                f"[[surface]] (mount-gateway config --example shows how)"
            )
        if surfaces and not meant:
            raise UserError(f"--{name}: none of these surfaces is {KEY_SURFACES[name][1]}")
        for number in meant:
            tables["surface"] = surfaces = list(surfaces)
            surfaces[number] = surfaces[number] | {name: value}
            source.flags[("surface", number, name)] = f"--{name}"


def _parse_value(key: Key, text: Any) -> Any:
    """Convert a flag's text to the type that its key has in gateway.toml. Raises UserError."""
    if key.name == "site":
        with errors_naming_flag("--site"):
            return list(parse_site(text))
    if text == ALL and isinstance(key.default, bool):
        return True
    value = text.split(",") if key.is_list and text not in key.choices else text
    try:
        return msgspec.to_builtins(msgspec.convert(value, key.value_type, strict=False))
    except msgspec.ValidationError:
        right = key.allowed.replace(' in "quotes"', "").replace("[", "").replace("]", "")
        raise UserError(f"--{key.name} {text!r}: write {right}") from None
