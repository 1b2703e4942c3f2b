"""Format the fields of a command or a reply for people.

Each protocol's ``words.toml`` defines the texts and formats, with a row per field, or per command and field. A field
without a row is shown with its name and value. Nothing here raises for any value that a mount may send.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import msgspec

from gateway.core.wire_log import printable
from gateway.protocols.wireformat import sexagesimal
from gateway.protocols.wireformat.command_set import load


class FieldFormat(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How to show a field: a label, and a format (``form``) or a text for each value (``*`` for any other value). A
    number is multiplied by ``scale`` and followed by ``unit``.
    """

    label: str | None = None
    form: str | None = None  # a key of FORMATS, or "model"
    words: dict[str, str] = {}  # the text for each value
    scale: float = 1.0
    unit: str = ""
    runs: bool = False  # changes by itself between two replies, as positions and clocks do


class WordsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A protocol's ``words.toml``: rows by ``field`` or ``command.field``, and sentences for whole commands."""

    fields: dict[str, FieldFormat] = {}
    commands: dict[str, str] = {}  # sentences for whole commands


@cache
def _words_file(protocol: str) -> WordsFile:
    return msgspec.convert(load(protocol).extra_table("words.toml"), WordsFile)


def _field_format(protocol: str, command: str, field: str) -> FieldFormat:
    fields = _words_file(protocol).fields
    return fields.get(f"{command}.{field}") or fields.get(field) or FieldFormat()


def format_fields(protocol: str, command: str, values: Mapping[str, object]) -> str:
    """Format the fields of a command or reply; empty if it has none."""
    sentence = _words_file(protocol).commands.get(command)
    if sentence is not None and values:
        try:
            return sentence.format(**values)
        except (KeyError, ValueError):  # a variant of the command without these fields
            pass
    return ", ".join(
        _format_value(protocol, name, value, _field_format(protocol, command, name)) for name, value in values.items()
    )


def constant_values(protocol: str, command: str, values: Mapping[str, object]) -> tuple[object, ...]:
    """Return the values that stay constant while nothing happens: all but positions and clocks."""
    return tuple(value for name, value in values.items() if not _field_format(protocol, command, name).runs)


def _format_value(protocol: str, name: str, value: object, fmt: FieldFormat) -> str:
    label = name.replace("_", " ") if fmt.label is None else fmt.label
    terms = fmt.words.get(_value_key(value), fmt.words.get("*"))
    if terms is not None:
        text = terms
    elif fmt.form == "model":
        text = next((model for model, row in load(protocol).models.items() if row.get("id") == value), str(value))
    elif fmt.form is not None:
        text = FORMATS[fmt.form](value)
    elif isinstance(value, int | float):
        text = f"{value * fmt.scale:.10g}{' ' * bool(fmt.unit)}{fmt.unit}"
    else:
        text = f'"{_escape_control_chars(value)}"' if isinstance(value, str) else str(value)
    return f"{label} {text}".strip()


def _value_key(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _escape_control_chars(text: str) -> str:
    """Escape control characters that a client or a mount has sent: they must not control the terminal."""
    return printable(text.encode("latin-1", "replace"))


# --- formats --------------------------------------------------------------------------------------------------------


def _split_sexagesimal(total: int) -> tuple[int, int, int]:
    rest, seconds = divmod(total, 60)
    whole, minutes = divmod(rest, 60)
    return whole, minutes, seconds


def _format_angle(degrees: float) -> str:
    return "{:02d}°{:02d}'{:02d}\"".format(*_split_sexagesimal(round(abs(degrees) * 3600.0)))


def _format_signed(degrees: float) -> str:
    """Format degrees as ``+22°00'52"``."""
    return ("-" if round(degrees * 3600.0) < 0 else "+") + _format_angle(degrees)


def _format_0_to_360(degrees: float) -> str:
    """Format degrees as ``180°00'00"``, from 0 to 360."""
    return _format_angle(round(degrees * 3600.0) % 1296000 / 3600.0)


def _format_longitude(degrees: float) -> str:
    degrees = (degrees + 180.0) % 360.0 - 180.0
    return f"{_format_angle(degrees)} {'W' if degrees < 0 else 'E'}"


def _format_time_of_day(seconds: float) -> str:
    return "{:02d}:{:02d}:{:02d}".format(*_split_sexagesimal(int(seconds)))


#: The formatting function of each format. Values are degrees, seconds since midnight, or hours.
FORMATS: dict[str, Callable[[Any], str]] = {
    "hours": sexagesimal.hours,
    "signed": _format_signed,
    "turn": _format_0_to_360,
    "north": lambda degrees: f"{_format_angle(degrees)} {'S' if degrees < 0 else 'N'}",
    "east": _format_longitude,
    "west": lambda degrees: _format_longitude(-degrees),
    "clock": _format_time_of_day,
    "to UTC": lambda hours: f"UTC{-hours + 0.0:+g} h",
}
