"""Format the log as lines: time, connection, direction, bytes, meaning. Lines fit the terminal, and are coloured there.

A line that is too long continues below, indented; no byte and no word is left out. With ``night_colours`` all colours
are shades of red, which preserve night vision best.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from typing import TextIO

from msgspec import Struct

from gateway.core.wire_log import printable

#: The number of columns if no terminal reports it, and the smallest number that lines are formatted for.
DEFAULT_COLUMNS, MIN_COLUMNS = 80, 40
#: Column widths for the connection and for the bytes; longer content moves the text to the right or to the next line.
NAME_COLUMNS, BYTES_COLUMNS = 15, 18
#: The text moves below the bytes if fewer columns than this are left beside them.
MIN_TEXT_COLUMNS = 24
#: The indentation of a continued line.
INDENTATION = "    "
#: The colour of each kind of line, as SGR parameters (ECMA-48); by day and by night.
DAY_COLOURS = {"program": "36", "mount": "32", "note": "33", "no": "31", "again": "2", "event": "2"}
NIGHT_COLOURS = {"program": "31", "mount": "31", "note": "1;31", "no": "1;31", "again": "2;31", "event": "2;31"}


class Row(Struct, frozen=True):
    """The content of a log line. ``kind`` is a key of ``DAY_COLOURS``; the mount's name is set if there are several."""

    time: float
    side: str  # the connection
    arrow: str  # the kind of event: > command, < reply, + connected, …
    data: bytes = b""
    text: str = ""
    kind: str = "event"  # a key of the colours
    mount_name: str = ""


def format_time(unix: float) -> str:
    """Format Unix seconds as the time of day, UTC, with milliseconds."""
    return datetime.fromtimestamp(unix, UTC).strftime("%H:%M:%S.%f")[:-3]


def as_one_line(row: Row, with_time: bool = True) -> str:
    """Format a row as one line, however long."""
    data = [printable(row.data).ljust(BYTES_COLUMNS)] if row.data else []
    return " ".join([_line_head(row, with_time), *data, row.text]).rstrip()


def wrap_row(row: Row, columns: int) -> list[str]:
    """Format a row as lines of at most ``columns`` characters, or ``MIN_COLUMNS`` if that is more."""
    head, columns = _line_head(row, with_time=True) + " ", max(columns, MIN_COLUMNS)
    start: list[str] = []
    if len(head) > columns - MIN_TEXT_COLUMNS:  # the rest moves to the lines below
        start, head = _split_text(head.rstrip(), columns - len(INDENTATION)), INDENTATION
    room, data = columns - len(head), printable(row.data)
    if not data:
        lines = _split_text(row.text, room)
    elif len(data.ljust(BYTES_COLUMNS)) + 1 + len(row.text) <= room:
        lines = [f"{data:<{BYTES_COLUMNS}} {row.text}"]
    else:
        lines = _lines_in_columns(data, row.text, room)
    indent = " " * len(head)
    if start:
        return [line.rstrip() for line in (start[0], *(INDENTATION + line for line in (*start[1:], *lines)))]
    return [line.rstrip() for line in (head + lines[0], *(indent + line for line in lines[1:]))]


def _lines_in_columns(data: str, note: str, width: int) -> list[str]:
    """Return lines with the bytes, and the text beside or below them."""
    beside = BYTES_COLUMNS + 1 if width - BYTES_COLUMNS - 1 >= MIN_TEXT_COLUMNS else 2
    pieces = _chunks(data, width)
    text = _split_text(note, width - beside)
    if len(pieces) == 1 and len(data) <= BYTES_COLUMNS and beside > 2:
        return [f"{data:<{BYTES_COLUMNS}} {text[0]}", *(" " * beside + line for line in text[1:])]
    if len(pieces) == 1 and len(data) + 1 + len(note) <= width:
        return [f"{data} {note}"]
    return [*pieces, *(" " * beside + line for line in text)]


def _line_head(row: Row, with_time: bool) -> str:
    """Return the beginning of a line: time, mount, connection, direction."""
    clock = [format_time(row.time)] if with_time else []
    name = [f"{row.mount_name:<8}"] if row.mount_name else []
    return " ".join([*clock, *name, f"{row.side:<{NAME_COLUMNS}}", row.arrow])


def _chunks(text: str, width: int) -> list[str]:
    return [text[start : start + width] for start in range(0, len(text), width)] or [""]


def _split_text(text: str, width: int) -> list[str]:
    """Break text between words; only a word that is longer than a line is split."""
    lines = [""]
    for word in text.split(" "):
        joined = f"{lines[-1]} {word}" if lines[-1] else word
        if len(joined) <= width:
            lines[-1] = joined
            continue
        lines += _chunks(word, width)
    return lines if lines[0] or len(lines) == 1 else lines[1:]


# --- the stream -----------------------------------------------------------------------------------------------------


def columns_getter(stream: TextIO) -> Callable[[], int]:
    """Return a function that returns the stream's present number of columns: its window may be resized."""

    def columns() -> int:
        try:
            return os.get_terminal_size(stream.fileno()).columns or DEFAULT_COLUMNS
        except (OSError, ValueError):
            return DEFAULT_COLUMNS

    return columns


def colours_of(stream: TextIO, night_colours: bool) -> dict[str, str]:
    """Return the colours for a stream; empty if it is no terminal or the user wants no colours."""
    shows = sys.platform != "win32" or "WT_SESSION" in os.environ
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not shows or not stream.isatty():
        return {}
    return NIGHT_COLOURS if night_colours else DAY_COLOURS


def paint_line(line: str, kind: str, colours: dict[str, str]) -> str:
    """Return the line in the colour of its kind."""
    return f"\x1b[{colours[kind]}m{line}\x1b[0m" if kind in colours else line
