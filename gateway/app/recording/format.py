"""The file format of recordings: a log, as text, of all bytes and events on both sides of the gateway.

The header contains the settings; then every line is one event: seconds, side, an arrow, bytes or text. ``>`` is towards
the mount, ``<`` from it. Received bytes are recorded in the chunks in which they arrived, sent ones as they were
written. ``ARROWS`` names the other events.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from gateway.core.errors import UserError, explain_file_error
from gateway.core.wire_log import printable
from gateway.system.files import open_regular_file

FILE_HEADER = "# mount-gateway recording "
FORMAT_VERSION = 1
#: The side of the last line of a complete recording.
RECORDER_SIDE = "recording"
#: ``+ -`` are connections opened and closed, ``~`` the protocol that was recognised on a connection, ``!`` a note or a
#: refusal, ``*`` a person's request that was carried out, ``^ v`` the mount's port opened and lost.
ARROWS = "<>+-~!*^v"
#: The maximum length of a line; a file with a longer line is no recording.
MAX_LINE_LENGTH = 1_000_000
_LINE = re.compile(rf"(\d+\.\d+) (\S+) ([{re.escape(ARROWS)}])(?: (.*))?")


class Event(NamedTuple):
    """One recorded event; its time is in seconds since the recording began."""

    time: float
    side: str
    arrow: str
    data: bytes


def escape(data: bytes) -> str:
    """Return bytes as text, with unprintable characters, backslashes and blanks as ``\\xHH``."""
    return printable(data).replace(" ", "\\x20")


def unescape(text: str) -> bytes:
    """Return the bytes of an escaped text: ``\\xHH`` becomes that byte."""
    raw = text.encode("latin-1", "replace")
    return re.sub(rb"\\x([0-9a-fA-F]{2})", lambda hit: bytes((int(hit.group(1), 16),)), raw)


class Recording:
    """A recording in one or more files, oldest first. ``settings`` are those of the first file."""

    def __init__(self, parts: list[Path]) -> None:
        self.parts = parts
        self.settings = _read_settings(parts[0])
        #: After iterating: a sentence that says why the recording is incomplete; empty if it is complete.
        self.incomplete_reason = ""

    def __iter__(self) -> Iterator[Event]:
        """Yield the events, reading the files step by step. Raises UserError for an invalid line."""
        self.incomplete_reason, last = "", None
        for part in self.parts:
            with open_regular_file(part) as file:
                for event in self._read(part, file):
                    last = event
                    yield event
        if not self.incomplete_reason:
            self.incomplete_reason = self._missing_end_reason(last)

    def _missing_end_reason(self, last_event: Event | None) -> str:
        """Return why the recording is incomplete, judged by its last event; empty if it is complete."""
        if last_event is not None and (last_event.side, last_event.arrow) == (RECORDER_SIDE, "!"):
            return ""
        return (
            f"{self.parts[-1]}: the recording ends{_after_event(last_event)}, because the gateway was killed or still "
            "runs, the disk was full, or it continues in a newer file; everything before that is complete"
        )

    def _read(self, part: Path, file: BinaryIO) -> Iterator[Event]:
        for _ in range(2):
            file.readline(MAX_LINE_LENGTH)
        number, last = 2, None
        while raw := file.readline(MAX_LINE_LENGTH):
            number += 1
            if (not raw.endswith(b"\n") and len(raw) < MAX_LINE_LENGTH) or raw.startswith(b"\0"):
                self.incomplete_reason = (
                    f"{part}:{number}: the recording is cut off in the middle of a line{_after_event(last)}; "
                    f"everything before that is complete"
                )
                return
            line = raw.decode("latin-1").rstrip("\n")
            match = _LINE.fullmatch(line)
            if match is None:
                if not line:
                    continue
                raise UserError(f"{part}:{number}: {line[:60]!r} is not a line of a recording: SECONDS WHO ARROW BYTES")
            at, side, arrow, text = match.groups()
            data = unescape(text or "") if arrow in "<>" else (text or "").encode("latin-1")
            last = Event(float(at), side, arrow, data)
            yield last


def _after_event(last_event: Event | None) -> str:
    return f" after {last_event.time:.3f} s" if last_event is not None else ""


def part_path(path: Path, number: int) -> Path:
    """Return the path of an older file of a recording: FILE.1 is the file before FILE."""
    return path.with_name(f"{path.name}.{number}")


def read(path: Path) -> Recording:
    """Open a recording up to the end of this file, with the older files of its run. Raises UserError if invalid."""
    settings, parts = _read_settings(path), [path]
    base, dot, number = str(path).rpartition(".")
    first, name = (int(number) + 1, Path(base)) if dot and number.isdecimal() else (1, path)
    while settings["from"] or first == 1:
        older = part_path(name, first)
        if not older.exists() or not is_recording(older):
            break
        head = _read_settings(older)
        if head["began"] != settings["began"]:
            break  # it belongs to another run
        parts.append(older)
        settings, first = head, first + 1
    return Recording(parts[::-1])


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording. Raises UserError if it is unreadable or has another format number."""
    return _read_format_version(path) is not None


def _read_format_version(path: Path) -> int | None:
    """Return a recording's format number; None for other files. Raises UserError if unreadable or another format."""
    try:
        with open_regular_file(path) as file:
            line = file.readline(len(FILE_HEADER) + 8).decode("latin-1")
    except OSError as error:
        reason = explain_file_error(path, error, reading=True)
        makes = f"; mount-gateway run --record {path} makes one" if reason.endswith("no such file") else ""
        raise UserError(f"{path}: {reason}{makes}") from None
    number = line.removeprefix(FILE_HEADER).rstrip("\n")
    if not line.startswith(FILE_HEADER) or not number.isdecimal():
        return None
    if int(number) != FORMAT_VERSION:
        raise UserError(
            f"{path}: this recording has format {number}, and this version of mount-gateway reads format "
            f"{FORMAT_VERSION}: use the version that wrote it"
        )
    return int(number)


def _read_settings(path: Path) -> dict[str, Any]:
    """Return the settings in the header of a file. Raises UserError for any other file."""
    if not is_recording(path):
        raise UserError(f"{path}: this is not a recording of mount-gateway (run --record {path} makes one)")
    with open_regular_file(path) as file:
        file.readline(MAX_LINE_LENGTH)
        line = file.readline(MAX_LINE_LENGTH)
    try:
        settings: dict[str, Any] = json.loads(line.decode("latin-1").removeprefix("# "))
        if not {"began", "config", "from"} <= set(settings):
            raise ValueError
    except (ValueError, TypeError, RecursionError):
        raise UserError(f"{path}:2: the settings of the recording cannot be read") from None
    return settings
