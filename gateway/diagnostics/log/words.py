"""What the fields of a command or a reply mean, as a person writes such things.

The forms and the words are data: ``words.toml`` of each protocol, by the name of a field, or of a command and a field.
What no row names is told by its name and its value. Nothing here raises for a value that some mount has sent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import msgspec

from gateway.core.wire_log import show
from gateway.protocols.wireformat import sexagesimal
from gateway.protocols.wireformat.command_set import load


class Word(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a field is told: a label before it, one of the forms, or words for its values (``*``: for any other).

    A number is multiplied by ``scale`` and followed by ``unit``. A field that ``runs`` may change from one answer to
    the next without anything having happened.
    """

    label: str | None = None
    form: str | None = None
    words: dict[str, str] = {}
    scale: float = 1.0
    unit: str = ""
    runs: bool = False


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A protocol's ``words.toml``: by ``field`` or ``command.field``; sentences for all fields of a command at once."""

    fields: dict[str, Word] = {}
    commands: dict[str, str] = {}


@cache
def _table(protocol: str) -> Words:
    return msgspec.convert(load(protocol).extra("words.toml"), Words)


def _word(protocol: str, command: str, field: str) -> Word:
    fields = _table(protocol).fields
    return fields.get(f"{command}.{field}") or fields.get(field) or Word()


def in_words(protocol: str, command: str, values: Mapping[str, object]) -> str:
    """The fields of one command or reply; empty where it has none."""
    sentence = _table(protocol).commands.get(command)
    if sentence is not None and values:
        try:
            return sentence.format(**values)
        except (KeyError, ValueError):  # a form of the command without these fields
            pass
    return ", ".join(_told(protocol, name, value, _word(protocol, command, name)) for name, value in values.items())


def steady(protocol: str, command: str, values: Mapping[str, object]) -> tuple[object, ...]:
    """Those values that stay the same as long as nothing happens: all but places and clocks."""
    return tuple(value for name, value in values.items() if not _word(protocol, command, name).runs)


def _told(protocol: str, name: str, value: object, word: Word) -> str:
    label = name.replace("_", " ") if word.label is None else word.label
    words = word.words.get(_key(value), word.words.get("*"))
    if words is not None:
        text = words
    elif word.form == "model":
        text = next((model for model, row in load(protocol).models.items() if row.get("id") == value), str(value))
    elif word.form is not None:
        text = FORMS[word.form](value)
    elif isinstance(value, int | float):
        text = f"{value * word.scale:.10g}{' ' * bool(word.unit)}{word.unit}"
    else:
        text = f'"{_plain(value)}"' if isinstance(value, str) else str(value)
    return f"{label} {text}".strip()


def _key(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _plain(text: str) -> str:
    """What a program or a mount has sent cannot rewrite the terminal."""
    return show(text.encode("latin-1", "replace"))


# --- forms ----------------------------------------------------------------------------------------------------------


def _sexagesimal(ticks: int) -> tuple[int, int, int]:
    rest, seconds = divmod(ticks, 60)
    whole, minutes = divmod(rest, 60)
    return whole, minutes, seconds


def _angle(degrees: float) -> str:
    return "{:02d}°{:02d}'{:02d}\"".format(*_sexagesimal(round(abs(degrees) * 3600.0)))


def _signed(degrees: float) -> str:
    """``+22°00'52"``."""
    return ("-" if round(degrees * 3600.0) < 0 else "+") + _angle(degrees)


def _turn(degrees: float) -> str:
    """``180°00'00"``, from 0 to 360."""
    return _angle(round(degrees * 3600.0) % 1296000 / 3600.0)


def _north(degrees: float) -> str:
    return f"{_angle(degrees)} {'S' if degrees < 0 else 'N'}"


def _east(degrees: float) -> str:
    degrees = (degrees + 180.0) % 360.0 - 180.0
    return f"{_angle(degrees)} {'W' if degrees < 0 else 'E'}"


def _clock(seconds: float) -> str:
    return "{:02d}:{:02d}:{:02d}".format(*_sexagesimal(int(seconds)))


#: What a form makes of a value: degrees, seconds since midnight, or hours.
FORMS: dict[str, Callable[[Any], str]] = {
    "hours": sexagesimal.hours,
    "signed": _signed,
    "turn": _turn,
    "north": _north,
    "east": _east,
    "west": lambda degrees: _east(-degrees),
    "clock": _clock,
    "to UTC": lambda hours: f"UTC{-hours + 0.0:+g} h",
}
