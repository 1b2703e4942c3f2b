"""A recording: everything that passed on both sides, as text that a person reads and ``replay`` plays again.

The head says with which settings; then one line is one thing: seconds since the beginning, who, an arrow, bytes. ``>``
goes towards the mount, ``<`` comes from it; raw chunks as they arrived, requests and replies as they were written.
``+`` and ``-`` are connections that come and go, ``!`` is a note, ``^`` and ``v`` are the mount's port opened and lost,
``r`` is the hub's decision to read something anew.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from gateway.errors import UserError
from gateway.logline import show
from gateway.transcript import Entry

MARK = "# mount-gateway recording 1"
MOUNT = "mount"
#: A file that has grown to this many bytes is put aside as FILE.1, the older ones as FILE.2 and so on.
LONGEST, KEPT = 10_000_000, 9
_LINE = re.compile(r"(\d+\.\d+) (\S+) ([<>+\-!^vr])(?: (.*))?")


class Event(NamedTuple):
    """One thing that happened, ``at`` seconds after the beginning."""

    at: float
    side: str
    arrow: str
    data: bytes


class Recording(NamedTuple):
    """``settings`` are those of the head: at least ``began`` (Unix seconds) and ``config``."""

    settings: dict[str, Any]
    events: list[Event]


def escape(data: bytes) -> str:
    """Bytes as text: what is not printable, a backslash, and a blank, as ``\\xHH``."""
    return show(data).replace(" ", "\\x20")


def unescape(text: str) -> bytes:
    """The reverse: ``\\xHH`` becomes that byte."""
    raw = text.encode("latin-1", "replace")
    return re.sub(rb"\\x([0-9a-fA-F]{2})", lambda hit: bytes((int(hit.group(1), 16),)), raw)


class Recorder:
    """A transcript's sink that writes a file. ``now`` is the event loop's clock."""

    def __init__(self, path: Path, now: Callable[[], float], settings: dict[str, Any], longest: int = LONGEST) -> None:
        self._path, self._now, self._settings, self._longest = path, now, settings, longest
        self._began = now()
        self._file: TextIO | None = None
        self._size = 0
        self._open(at=0.0)

    def _open(self, at: float) -> None:
        try:
            self._file = self._path.open("w", encoding="latin-1", errors="replace", newline="\n")
        except OSError as error:
            raise UserError(f"cannot record to {self._path}: {error.strerror}") from None
        self._size = 0
        self._write(f"{MARK}\n# {json.dumps({**self._settings, 'from': round(at, 6)})}\n")

    def _write(self, text: str) -> None:
        if self._file is not None:
            self._file.write(text)
            self._size += len(text)

    def put(self, entry: Entry) -> None:
        """Write an entry, where it is one of those that a recording holds."""
        event = _event(entry)
        if event is None or self._file is None:
            return
        at = self._now() - self._began
        side, arrow, data = event
        text = data if isinstance(data, str) else escape(data)
        try:
            self._write(f"{at:.6f} {side.replace(' ', '_')} {arrow} {text}".rstrip(" ") + "\n")
            if arrow != ">" or side == MOUNT:
                self._file.flush()
            if self._size >= self._longest:
                self._turn(at)
        except (OSError, UserError):  # a full disk must not end the night
            self.close()

    def _turn(self, at: float) -> None:
        """Put the file aside and begin the next one."""
        self.close()
        for number in range(KEPT - 1, 0, -1):
            with contextlib.suppress(OSError):
                _part(self._path, number).replace(_part(self._path, number + 1))
        self._path.replace(_part(self._path, 1))
        self._open(at)

    def close(self) -> None:
        """Nothing is written from now on."""
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                file.close()


def _part(path: Path, number: int) -> Path:
    return path.with_name(f"{path.name}.{number}")


def _event(entry: Entry) -> tuple[str, str, bytes | str] | None:
    """What a recording holds of an entry: raw chunks instead of what was cut out of them."""
    side, arrow, data, note = entry.side, entry.arrow, entry.data, entry.note
    if arrow == "raw":
        return side, "<" if side == MOUNT else ">", data
    if arrow in ("<", ">"):
        cut = arrow == ("<" if side == MOUNT else ">")
        return None if cut else (side, arrow, data)
    return side, arrow, note.replace("\n", " ")


def read(path: Path) -> Recording:
    """Read a recording with the parts that were put aside before it. Raises UserError with file and line."""
    parts = [path]
    while _part(path, len(parts)).exists():
        parts.append(_part(path, len(parts)))
    settings: dict[str, Any] = {}
    events: list[Event] = []
    for part in reversed(parts):
        head, more = _read_part(part)
        settings = settings or head
        events += more
    return Recording(settings, events)


def is_recording(path: Path) -> bool:
    """Whether a file begins as a recording does. Raises UserError when it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(len(MARK)) == MARK.encode()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None


def _read_part(path: Path) -> tuple[dict[str, Any], list[Event]]:
    if not is_recording(path):
        raise UserError(f"{path}: this is no recording of mount-gateway (run --record {path} makes one)")
    lines = path.read_text("latin-1").split("\n")
    try:
        settings = json.loads(lines[1].removeprefix("# "))
        if not {"began", "config", "from"} <= set(settings):
            raise ValueError
    except (IndexError, ValueError, TypeError):
        raise UserError(f"{path}:2: the settings of the recording cannot be read") from None
    events = []
    for number, line in enumerate(lines[2:], 3):
        found = _LINE.fullmatch(line)
        if found is None:
            if number == len(lines) or not line:  # cut off by a crash, or the end
                continue
            raise UserError(f"{path}:{number}: {line[:60]!r} is no line of a recording: SECONDS WHO ARROW BYTES")
        at, side, arrow, text = found.groups()
        data = (text or "").encode("latin-1") if arrow in "+-!^vr" else unescape(text or "")
        events.append(Event(float(at), side, arrow, data))
    return settings, events
