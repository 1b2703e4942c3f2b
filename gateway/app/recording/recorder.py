"""Writes a recording: a sink of the wire log with log rotation, into files that only their owner can read.

A long file is renamed to FILE.1, older ones to FILE.2 and so on, and the oldest is deleted. The recording of an earlier
run is renamed in the same way, never overwritten. If the disk is full, the recording ends with a line that says so, the
user is warned, and the gateway continues.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import stat
import sys
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.app.recording.format import FORMAT, MARK, RECORDER, STOPPED, WITHOUT_TURNS, escape, is_recording, part_path
from gateway.app.recording.turns import TurnLoop
from gateway.core.errors import UserError, about_file, told
from gateway.core.wire_log import MOUNT, Entry
from gateway.system.files import plain_file

#: Bytes after which a new file is begun, and how many files are kept, including the one being written.
LONGEST, KEPT = 10_000_000, 20
#: Only the owner may read a recording: the site's coordinates are in it.
PRIVATE = 0o600
#: Bytes that are cut off on a full disk, to make room for the line that says so.
ROOM = 300
#: The ends of so many writes are remembered, so that a recording can be cut between two of them.
REMEMBERED = 64


class Recorder:
    """Writes a recording. ``now`` is the event loop's clock; ``warn`` gets messages for the user.

    On a ``TurnLoop`` the turns are recorded as well. Raises UserError for a file that cannot be written.
    """

    def __init__(
        self,
        path: Path,
        now: Callable[[], float],
        settings: dict[str, Any],
        longest: int = LONGEST,
        keep: int = KEPT,
        warn: Callable[[str], object] = lambda text: None,
        loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        self._path, self._now, self._longest, self._keep, self._warn = path, now, longest, keep, warn
        self._turns = loop if isinstance(loop, TurnLoop) else None
        self._began = now()
        self._settings = {**settings, "python": "{}.{}".format(*sys.version_info)}
        if self._turns is not None:
            self._settings |= {"began": settings["began"] - self._turns.elapsed, "elapsed": self._turns.elapsed}
            self._turns.on_time.append(self._turn)
        self._file = -1
        self._lines: list[str] = []
        self._size = 0
        self._ends: deque[int] = deque(maxlen=REMEMBERED)
        self._warned = False
        try:
            _rotate(path, keep)
            self._open(first=True)
        except OSError as error:
            self._close_file()
            raise UserError(f"cannot record to {path}: {about_file(path, error)}") from None

    @property
    def _at(self) -> float:
        """Seconds since the beginning of the recording."""
        return self._turns.elapsed if self._turns is not None else self._now() - self._began

    def _open(self, first: bool) -> None:
        """Begin a file. Raises OSError."""
        self._file, self._size = _open_private(self._path), 0
        self._ends.clear()
        number = WITHOUT_TURNS if self._turns is None else FORMAT
        settings = {**self._settings, "from": 0.0 if first else round(self._at, 6)}
        self._write(f"{MARK}{number}\n# {json.dumps(settings)}\n")

    def _write(self, text: str) -> None:
        """Write the whole text to the file. Raises OSError."""
        data = text.encode("latin-1", "replace")
        while data:
            written = os.write(self._file, data)
            data = data[written:]
            self._size += written
        self._ends.append(self._size)

    # --- what is written --------------------------------------------------------------------------------------------

    def put(self, entry: Entry) -> None:
        """Write an entry of the wire log, if a recording holds entries of its kind."""
        side, arrow, data, note = entry.side, entry.arrow, entry.data, entry.note
        if arrow == "raw":
            if side == MOUNT or self._turns is None:  # else the entrance has recorded it
                self.line(side, "<" if side == MOUNT else ">", escape(data))
        elif arrow in ("<", ">"):
            if arrow == (">" if side == MOUNT else "<"):  # the others are parts of raw chunks
                self.line(side, arrow, escape(data))
        elif arrow != "x":  # dropped bytes are parts of raw chunks, too
            self.line(side, arrow, note.replace("\n", " "))

    def line(self, side: str, arrow: str, text: str = "") -> None:
        if self._file < 0:
            return
        if self._turns is not None and not self._lines:
            self._turns.call_soon(self.flush)
        self._lines.append(f"{self._at:.6f} {side.replace(' ', '_')} {arrow} {text}".rstrip(" ") + "\n")
        if self._turns is None and (arrow != ">" or side == MOUNT):
            self.flush()

    def _turn(self) -> None:
        assert self._turns is not None
        self.line(RECORDER, "t", str(self._turns.turn))

    def flush(self) -> None:
        text = "".join(self._lines)
        self._lines.clear()
        if self._file < 0 or not text:
            return
        try:
            self._write(text)
            if self._size >= self._longest:
                self._next_file()
        except OSError as error:  # a full disk must not end the night
            self._end_early(told(error))

    # --- the end of a file ------------------------------------------------------------------------------------------

    def _next_file(self) -> None:
        """Begin the next file. Raises OSError."""
        os.close(self._file)
        self._file = -1
        full = _rotate(self._path, self._keep)
        self._open(first=False)
        if full and not self._warned:
            self._warned = True
            self._warn(
                f"the recording {self._path} has filled {self._keep} files: from now on the oldest is deleted "
                "whenever a new one begins, and it can no longer be replayed from its beginning; "
                "record-keep says how many files are kept"
            )

    def _end_early(self, reason: str) -> None:
        """End a file that cannot be written any more at a point where it can still be replayed; warn the user."""
        cut = next((end for end in reversed(self._ends) if end <= self._size - ROOM), None)
        with contextlib.suppress(OSError):
            if cut is not None and stat.S_ISREG(os.fstat(self._file).st_mode):
                os.ftruncate(self._file, cut)
                os.lseek(self._file, cut, os.SEEK_SET)
                self._write(self._last(f"{STOPPED}, it could not be written any more: {reason}"))
        self._close_file()
        self._warn(
            f"the recording {self._path} could not be written any more and ends here: {reason}. The gateway "
            "continues without it; make room on the disk and restart the gateway to record again"
        )

    def _last(self, words: str) -> str:
        return f"{self._at:.6f} {RECORDER} ! {words}\n"

    def _close_file(self) -> None:
        """Close the file; later events are dropped."""
        file, self._file = self._file, -1
        self._lines.clear()
        if self._turns is not None and self._turn in self._turns.on_time:
            self._turns.on_time.remove(self._turn)
        if file >= 0:
            with contextlib.suppress(OSError):
                os.close(file)

    def close(self) -> None:
        """Write the last line and close the file."""
        if self._turns is not None and self._file >= 0:
            self._lines.append(self._last("ends here: the gateway has ended"))
        self.flush()
        self._close_file()


def _rotate(path: Path, keep: int) -> bool:
    """Rename existing files to FILE.1 and so on; return whether the oldest had to be deleted.

    Raises OSError, and UserError for a file that is no recording, which is left alone.
    """
    if not path.is_file():
        return False
    if path.stat().st_size and not is_recording(path):
        raise UserError(f"cannot record to {path}: there is a file that is no recording; it is left alone")
    parts = [path]
    while part_path(path, len(parts)).exists():
        parts.append(part_path(path, len(parts)))
    full = len(parts) >= keep
    for number in range(len(parts) - 1, -1, -1):
        part = parts[number]
        if number + 1 >= keep:
            part.unlink()
            continue
        if not part.is_symlink() and stat.S_IMODE(part.stat().st_mode) & ~PRIVATE:
            part.chmod(PRIVATE)
        part.replace(part_path(path, number + 1))
    return full


def _open_private(path: Path) -> int:
    """Open a file for writing that only its owner can read, whatever the umask. Raises OSError."""
    file = plain_file(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, PRIVATE)
    with contextlib.suppress(OSError, AttributeError):  # Windows has no such modes
        os.fchmod(file, PRIVATE)
    return file
