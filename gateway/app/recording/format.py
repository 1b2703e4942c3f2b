"""A recording: everything that passed on both sides, as text that a person reads and ``replay`` plays again.

The head says with which settings; then one line is one thing: seconds, who, an arrow, bytes. ``>`` goes towards the
mount, ``<`` comes from it; raw chunks as they arrived, requests and replies as they were written. ``ARROWS`` names the
others. In format 2 every ``t`` line says at which turn of the event loop and at what time the things entered that
follow it, which is the order in which they took effect; recordings of format 1 have no such lines.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from gateway.core.errors import UserError, about_file
from gateway.core.wire_log import show

MARK = "# mount-gateway recording "
#: The format that is written by an event loop whose turns can be told apart, and the one before it.
FORMAT, WITHOUT_TURNS = 2, 1
#: Who says the last line of a recording that came to its end.
RECORDER = "recording"
#: How that line begins when the recording could not be written any more.
STOPPED = "stopped here"
#: What is neither bytes nor of use in words: ``t`` a turn and its number, ``g`` something outside the gateway that it
#: waited for has come (number, failure), ``l`` the mount's port was lost, ``w`` it could not be written to, ``k`` what
#: the host's clock showed at 0 s, ``b s q`` the gateway begins, is told to stop the mount, and ends,
#: ``d`` its watchdog has stopped the mount, ``o`` it is ordered to stop it and see that it rests, ``h u`` the mount is
#: held and released, ``e`` a connection's other side has closed its end, ``c`` a wish from the command line.
BOOKKEEPING = "tglwkbsqdohuec"
#: ``+ -`` are connections that come and go, ``~`` is what one turns out to speak, ``!`` is a note, ``^ v`` are the
#: mount's port opened and lost, ``r`` is the hub's decision to read something anew.
ARROWS = "<>+-~!^vr" + BOOKKEEPING
#: No line is longer; a file that has a longer one is no recording.
LONGEST_LINE = 1_000_000
_LINE = re.compile(rf"(\d+\.\d+) (\S+) ([{re.escape(ARROWS)}])(?: (.*))?")


class Event(NamedTuple):
    """One thing that happened, ``at`` seconds after the beginning."""

    at: float
    side: str
    arrow: str
    data: bytes


def escape(data: bytes) -> str:
    """Bytes as text: what is not printable, a backslash, and a blank, as ``\\xHH``."""
    return show(data).replace(" ", "\\x20")


def unescape(text: str) -> bytes:
    """The reverse: ``\\xHH`` becomes that byte."""
    raw = text.encode("latin-1", "replace")
    return re.sub(rb"\\x([0-9a-fA-F]{2})", lambda hit: bytes((int(hit.group(1), 16),)), raw)


class Recording:
    """The parts of a recording, oldest first. ``settings`` are those of the first head, ``format`` is its number."""

    def __init__(self, parts: list[Path]) -> None:
        self.parts = parts
        self.settings = _head(parts[0])
        self.format = _format(parts[0]) or WITHOUT_TURNS
        #: After everything has been read: why that is less than there was, in words; empty when it is all.
        self.cut = ""
        #: The file that it goes on in, where it does.
        self.goes_on: Path | None = None

    def __iter__(self) -> Iterator[Event]:
        """Everything that happened, read as it is wanted. Raises UserError with file and line."""
        self.cut, last = "", None
        for part in self.parts:
            with part.open("rb") as file:
                for event in self._read(part, file):
                    last = event
                    yield event
        if not self.cut:
            self.cut = self._missing(last)

    def _missing(self, last: Event | None) -> str:
        """Why this is less than there was, by its last line; empty when it is all."""
        file = self.parts[-1]
        ended = last is not None and (last.side, last.arrow) == (RECORDER, "!")
        if self.goes_on is not None:
            return f"{file}: the recording goes on{_when(last)} in {self.goes_on}"
        if ended and last is not None and last.data.startswith(STOPPED.encode()):
            return f"{file}: the recording {last.data.decode('latin-1')}"
        if ended or self.format == WITHOUT_TURNS:
            return ""
        return (
            f"{file}: the recording breaks off{_when(last)}, because the gateway was killed or still runs: what "
            "was written is good up to there"
        )

    def _read(self, part: Path, file: BinaryIO) -> Iterator[Event]:
        for _ in range(2):
            file.readline(LONGEST_LINE)
        number, last = 2, None
        while raw := file.readline(LONGEST_LINE):
            number += 1
            if (not raw.endswith(b"\n") and len(raw) < LONGEST_LINE) or raw.startswith(b"\0"):
                self.cut = (
                    f"{part}:{number}: the recording is cut off in the middle of a line{_when(last)}: "
                    "what was written is good up to there"
                )
                return
            line = raw.decode("latin-1").rstrip("\n")
            found = _LINE.fullmatch(line)
            if found is None:
                if not line:
                    continue
                raise UserError(f"{part}:{number}: {line[:60]!r} is no line of a recording: SECONDS WHO ARROW BYTES")
            at, side, arrow, text = found.groups()
            data = unescape(text or "") if arrow in "<>" else (text or "").encode("latin-1")
            last = Event(float(at), side, arrow, data)
            yield last


def _when(last: Event | None) -> str:
    return f" after {last.at:.3f} s" if last is not None else ""


def part_of(path: Path, number: int) -> Path:
    """The file that a part is put aside as."""
    return path.with_name(f"{path.name}.{number}")


def read(path: Path) -> Recording:
    """A recording up to the end of this file, with the parts that were put aside before it.

    Raises UserError with file and line.
    """
    settings, parts = _head(path), [path]
    base, dot, number = str(path).rpartition(".")
    first, name = (int(number) + 1, Path(base)) if dot and number.isdecimal() else (1, path)
    while settings["from"] or first == 1:
        older = part_of(name, first)
        if not older.exists() or not is_recording(older):
            break
        head = _head(older)
        if head["began"] != settings["began"]:
            break  # of another run
        parts.append(older)
        settings, first = head, first + 1
    recording = Recording(parts[::-1])
    if name != path:
        newer = part_of(name, int(number) - 1) if int(number) > 1 else name
        if newer.exists() and is_recording(newer) and _head(newer)["began"] == settings["began"]:
            recording.goes_on = newer
    return recording


def is_recording(path: Path) -> bool:
    """Whether a file begins as a recording does. Raises UserError when it cannot be read."""
    return _format(path) is not None


def _format(path: Path) -> int | None:
    """The number of a recording's format; None for a file that is no recording. Raises UserError."""
    try:
        with path.open("rb") as file:
            line = file.readline(len(MARK) + 8).decode("latin-1")
    except OSError as error:
        words = about_file(path, error)
        makes = f"; mount-gateway run --record {path} makes one" if words.endswith("no such file") else ""
        raise UserError(f"{path}: {words}{makes}") from None
    number = line.removeprefix(MARK).rstrip("\n")
    if not line.startswith(MARK) or not number.isdecimal():
        return None
    if int(number) not in (FORMAT, WITHOUT_TURNS):
        raise UserError(
            f"{path}: this recording has format {number}, which is newer than this version of "
            f"mount-gateway: it reads up to format {FORMAT}"
        )
    return int(number)


def _head(path: Path) -> dict[str, Any]:
    """The settings that a part of a recording begins with. Raises UserError."""
    if not is_recording(path):
        raise UserError(f"{path}: this is no recording of mount-gateway (run --record {path} makes one)")
    with path.open("rb") as file:
        file.readline(LONGEST_LINE)
        line = file.readline(LONGEST_LINE)
    try:
        settings: dict[str, Any] = json.loads(line.decode("latin-1").removeprefix("# "))
        if not {"began", "config", "from"} <= set(settings):
            raise ValueError
    except (ValueError, TypeError, RecursionError):
        raise UserError(f"{path}:2: the settings of the recording cannot be read") from None
    return settings
