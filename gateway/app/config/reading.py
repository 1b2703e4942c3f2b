"""Turns ``gateway.toml`` and flags into a ``Config``, or into one line that says where the mistake is."""

from __future__ import annotations

import codecs
import contextlib
import re
from bisect import bisect_left
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import tomli

from gateway.app.config.checks import Mistake, mistakes_in
from gateway.app.config.describing import Key, find_key, header_of, keys_of
from gateway.app.config.endpoints import parse_site, site_mistake, suggest_choice
from gateway.app.config.source import Place, Source
from gateway.app.config.tables import TABLES, Config
from gateway.core.errors import UserError, explain_file_error
from gateway.system.files import open_regular_fd

#: Beginning of a message of the parser -> hint: what the user may have meant.
_PARSER_HINTS = {
    "Invalid value": '; text is written in "quotes", a number with a point: 0.5',
    "Expected newline": "; two numbers go into [ ], as in [48.1, 11.6]; a single one has a point: 10.5",
    **dict.fromkeys(
        ("Unescaped '\\'", "Invalid hex value"),
        "; \\ is special in \"double quotes\": write / for it, or put the text into 'single quotes'",
    ),
    "Cannot overwrite": "; it is already defined above",
    "Cannot declare": "; it is already defined above: several surfaces are [[surface]], several mounts [[mount]]",
}

#: Typographic quotes, which word processors and web pages put in place of plain ones.
_CURLY_QUOTES = set("\u201c\u201d\u201e\u2018\u2019\u201a\u00ab\u00bb")

#: Control characters are refused in every value, before anything is opened or shown: a NUL ends a path early, an
#: escape sequence rewrites a terminal.
_CONTROL_CHARACTERS = r"[\x00-\x1f\x7f-\x9f\u2028\u2029]"

#: Messages for texts that TOML allows and the parser cannot read.
_UNREADABLE_TOML: dict[type[Exception], str] = {
    RecursionError: "this is nested too deep; no key here needs more than [ ] around a few values",
    ValueError: "this number has thousands of digits; no key here takes such a number",
}


def read_tables(path: Path) -> tuple[dict[str, object], Source]:
    """Read a file; return its tables, and the source of their values. Raises UserError if it is unreadable."""
    try:
        with open(open_regular_fd(path), encoding="utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        reason = explain_file_error(path, error, reading=True)
        makes = f"; mount-gateway detect --write {path} makes one" if reason.endswith("no such file") else ""
        raise UserError(f"{path}: {reason}{makes}") from None
    except UnicodeDecodeError as error:
        if error.object.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise UserError(f"{path}: this is UTF-16, as PowerShell's > writes it; save it as UTF-8") from None
        raise UserError(f"{path}: this is not UTF-8 text ({error.reason} at byte {error.start})") from None
    try:
        tables = tomli.loads(text)
    except tomli.TOMLDecodeError as error:
        hint = next((reason for start, reason in _PARSER_HINTS.items() if error.msg.startswith(start)), "")
        line = text.split("\n")[error.lineno - 1]
        if "Expected newline" in error.msg and line[error.colno - 1 : error.colno] != ",":
            hint = ""
        if set(line) & _CURLY_QUOTES:
            hint = '; the quotes here are typographic ones: write plain ones, as in "nexstar@/dev/ttyUSB0"'
        raise UserError(f"{path}:{error.lineno}: column {error.colno}: {error.msg}{hint}") from None
    except (RecursionError, ValueError) as error:
        raise UserError(f"{path}:{_failing_line(text)}: {_UNREADABLE_TOML[type(error)]}") from None
    source = Source(str(path), text, is_file=True)
    if isinstance(tables.get("mount"), dict):
        tables["mount"] = [tables["mount"]]
    if isinstance(tables.get("surface"), dict):
        raise UserError(f"{source.locate(('surface',))}: [surface]: write [[surface]], because there may be several")
    return tables, source


def _failing_line(text: str) -> int:
    """Return the line, from 1, at which the parser fails on a text that TOML allows (``_UNREADABLE_TOML``)."""
    lines = text.split("\n")

    def fails_up_to(line: int) -> bool:
        try:
            tomli.loads("\n".join(lines[:line]))
        except tomli.TOMLDecodeError:  # cut within a statement of several lines
            return False
        except (RecursionError, ValueError):
            return True
        return False

    return bisect_left(range(1, len(lines)), True, key=fails_up_to) + 1


def _control_characters(tables: object, path: Place = ()) -> Iterator[Mistake]:
    """Yield a mistake for every text in the tables that has a control character."""
    if isinstance(tables, str):
        if not tables.isprintable() and (match := re.search(_CONTROL_CHARACTERS, tables)):
            yield Mistake(path, f"there is a control character (U+{ord(match.group()):04X}) in it; write it without")
    elif isinstance(tables, dict):
        for key, value in tables.items():
            yield from _control_characters(value, (*path, key))
    elif isinstance(tables, list):
        for number, value in enumerate(tables):
            yield from _control_characters(value, (*path, number))


def make_config(tables: dict[str, object], source: Source, needs_surface: bool = True) -> Config:
    """Make the configuration from plain tables; ``mount`` is a list. Raises UserError for a mistake in them.

    ``needs_surface``: at least one surface is required.
    """
    for place, reason in _control_characters(tables):
        raise _to_error(source, Mistake(_cut_after_key(place), reason))
    try:
        config = msgspec.convert(tables, Config)
    except msgspec.ValidationError as error:
        raise _msgspec_error(tables, source, *_parse_msgspec_error(str(error))) from None
    for mistake in mistakes_in(config, needs_surface, source.is_file):
        raise _to_error(source, mistake)
    return config


def _parse_msgspec_error(message: str) -> tuple[Place, str | None, str]:
    """Return path and key in msgspec's message, and ``unknown`` or ``missing required``; for a wrong value no key."""
    where = re.search(r" - at `\$\.?([^`]*)`$", message)
    steps = re.findall(r"[^.\[\]]+|\[\d+\]", where.group(1) if where else "")
    place = tuple(int(step[1:-1]) if step.startswith("[") else step for step in steps)
    field = re.search(r"(unknown|missing required) field `([^`]*)`", message)
    return (place, field.group(2), field.group(1)) if field else (place, None, "")


def _msgspec_error(tables: dict[str, object], source: Source, path: Place, field: str | None, kind: str) -> UserError:
    """Return the error for what msgspec did not accept: an ``unknown`` or ``missing required`` key, or a value ("")."""
    table = str(path[0]) if path and path[0] in TABLES else ""
    if field is None:
        return _value_error(tables, source, table, path)
    if kind == "unknown":
        right_table = next((name for name in TABLES if name != table and find_key(name, field)), None)
        known = [key.name for key in keys_of(table)] + ([] if table else ["mount", "surface"])
        hint = suggest_choice(field, known) if right_table is None else f"it belongs under {header_of(right_table)}"
        return _to_error(source, Mistake((*path, field), f"there is no such key; {hint}"))
    key = find_key(table, field)
    if (key is None or (table == "mount" and not source.text)) and source.is_file:
        return UserError(
            f'{source.name}: which mount? Write [mount] into it, and below it at = "nexstar@/dev/ttyUSB0", or add '
            "--mount nexstar@/dev/ttyUSB0 to the command (mount-gateway detect finds the port)"
        )
    if key is None or (table == "mount" and not source.text):
        return UserError(
            f"{source.name}: which mount? Write --mount nexstar@/dev/ttyUSB0 (mount-gateway detect finds "
            "the port), or --config FILE with a gateway.toml"
        )
    return _to_error(source, Mistake((*path, field), f'is needed: {key.description}; for example "{key.example}"'))


def _value_error(tables: dict[str, object], source: Source, table: str, key_path: Place) -> UserError:
    """Return the error for a value of the wrong type or out of range, or for a value in place of a table."""
    whole = _cut_after_key(key_path)
    key = find_key(table, str(whole[-1]))
    if key is None:
        return _to_error(source, Mistake(key_path, f"write {header_of(table)} and KEY = VALUE under it"))
    value = _value_at(tables, whole)
    example = f", for example {key.name} = {_example_value(key, value)}" if key.allowed.startswith("[") else ""
    if "a word of" in key.allowed and isinstance(value, str) and (plain := re.sub(r"[^\w.-]+", "_", value, flags=re.A)):
        example = f', for example "{plain}"'
    return _to_error(
        source, Mistake(whole, f"{_shorten(value)}: write {key.allowed}{example}{_swapped_site_hint(key.name, value)}")
    )


def _example_value(key: Key, value: object) -> Any:
    """Return the key's example; for a site written as ``LAT,LON``, that site as the file writes it."""
    with contextlib.suppress(UserError):
        if key.name == "site" and isinstance(value, str):
            return list(parse_site(value))
    return key.example


def _cut_after_key(key_path: Place) -> Place:
    """Return the path up to its key: msgspec's paths may lead further, into the value of the key."""
    return key_path[: 3 if key_path[0] in ("mount", "surface") else 2 if key_path[0] in TABLES else 1]


def _value_at(tables: Any, key_path: Place) -> Any:
    for step in key_path:
        tables = tables[step]
    return tables


def _swapped_site_hint(name: str, value: object) -> str:
    """Return the hint for a site with latitude and longitude in the wrong order; empty for other keys."""
    if name != "site" or not isinstance(value, list | tuple) or len(value) != 2:
        return ""
    numbers = all(isinstance(part, int | float) for part in value)
    hint = site_mistake(value[0], value[1]).partition("; ")[2] if numbers else ""
    return f"; {hint}" if hint else "; the latitude comes first"


def _to_error(source: Source, mistake: Mistake) -> UserError:
    """Return the error for a mistake: ``gateway.toml:12: [mount] lowest: …``."""
    table, key = mistake.key_path[0], mistake.key_path[-1]
    where = source.locate(mistake.key_path)
    if where.startswith("--") or not (source.is_file or len(mistake.key_path) > 1):
        return UserError(
            f"{where} {mistake.message}" if mistake.message[:1] in "'0123456789-" else f"{where}: {mistake.message}"
        )
    head = f"{header_of(str(table))} " if table in TABLES else ""
    name = key if isinstance(key, str) and (len(mistake.key_path) > 1 or key not in TABLES) else ""
    return UserError(f"{where}: {f'{head}{name}'.strip()}: {mistake.message}")


def _shorten(value: object) -> str:
    """Return a value as TOML writes it, shortened to 60 characters."""
    try:
        text = repr(value).lower() if isinstance(value, bool) else repr(value)
    except ValueError:  # Python refuses to print a number of thousands of digits
        return "this number"
    return text if len(text) <= 60 else f"{text[:57]}..."
