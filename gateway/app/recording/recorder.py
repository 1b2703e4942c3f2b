"""Writes a recording: a sink of the wire log, into files that only their owner can read.

What happens is written a moment later, on a thread, so that no disk delays a program or a stop; a process that is
killed loses that moment. A long file is renamed to FILE.1, older ones to FILE.2 and so on, and the oldest is deleted.
The recording of another run is renamed in the same way, never overwritten. If the disk is full or hangs, the recording
ends, the user is warned, and the gateway continues.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import stat
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from gateway.app.recording.format import FILE_HEADER, FORMAT_VERSION, RECORDER_SIDE, escape, is_recording, part_path
from gateway.core.about import short_commit, version
from gateway.core.errors import UserError, explain_file_error, explain_os_error
from gateway.core.waiting import TimedEvent, mark_exception_retrieved, run_in_thread
from gateway.core.wire_log import MOUNT_SIDE, Entry
from gateway.system.files import open_regular_fd

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Bytes after which a new file is begun, and how many files are kept, including the file being written.
MAX_FILE_BYTES, MAX_FILES = 10_000_000, 20
#: Seconds until an event is written; seconds between two checks of a disk that hangs; how many events may queue.
WRITE_DELAY, DISK_CHECK_PERIOD, MAX_UNWRITTEN_LINES = 0.1, 1.0, 100_000
#: How many lines are formatted at a time; the event loop waits meanwhile.
LINES_PER_WRITE = 32
#: Only the owner may read a recording: the site's coordinates are in it.
OWNER_ONLY_MODE = 0o600


class Recorder:
    """Writes a recording whose header holds ``header_fields``. ``clock`` returns the Unix time of entries, ``now``
    monotonic seconds; ``warn`` gets messages for the user. Raises UserError for a file that cannot be written.
    """

    def __init__(
        self,
        path: Path,
        header_fields: dict[str, Any],
        max_bytes: int = MAX_FILE_BYTES,
        max_files: int = MAX_FILES,
        warn: Callable[[str], object] = lambda text: None,
        clock: Callable[[], float] = time.time,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._max_bytes, self._max_files, self._warn = path, max_bytes, max_files, warn
        self._clock, self._loop_time, self._start_time = clock, now, now()
        self._header = {**header_fields, "python": "{}.{}".format(*sys.version_info)}
        self._entry_queue: deque[Entry] = deque(maxlen=MAX_UNWRITTEN_LINES)
        #: Queues an entry of the wire log. It is written later, because a program waits for its reply now.
        self.put = self._entry_queue.append
        self._lock, self._flush_event = asyncio.Lock(), TimedEvent()
        self._closing = self._has_failed = False
        # What follows belongs to the thread that writes; only one runs at a time.
        self._descriptor, self._size = -1, 0
        self._last_time, self._has_warned = 0.0, False
        try:
            _rotate(path, max_files)
            self._open(0.0)
        except OSError as error:
            self._close_file()
            raise UserError(f"cannot record to {path}: {explain_file_error(path, error)}") from None
        self._write_task = asyncio.get_running_loop().create_task(self._write())

    # --- on the event loop --------------------------------------------------------------------------------------------

    async def _write(self) -> None:
        while not (self._closing or self._has_failed):
            await self._flush_event.wait_within(WRITE_DELAY)
            await self.flush()

    async def flush(self) -> None:
        """Write all queued entries, and wait until they are in the file; after a failure, do nothing."""
        async with self._lock:
            if self._entry_queue and not self._has_failed:
                await self._write_entries([self._entry_queue.popleft() for _ in range(len(self._entry_queue))])

    async def _write_entries(self, entries: list[Entry]) -> None:
        ahead, until = self._clock() - self._loop_time(), self._loop_time() - self._start_time
        work = asyncio.ensure_future(run_in_thread(self._write_file, entries, ahead + self._start_time, until))
        while not (await asyncio.wait((work,), timeout=DISK_CHECK_PERIOD))[0]:
            if len(self._entry_queue) == MAX_UNWRITTEN_LINES:
                work.add_done_callback(mark_exception_retrieved)
                self._give_up("the disk does not answer")
                return
        try:
            if work.result():
                self._warn(
                    f"the recording {self._path} has filled {self._max_files} files (record-keep): each new file now "
                    f"replaces the oldest"
                )
        except Exception as error:  # neither a full disk nor a defect may end the night
            self._give_up(explain_os_error(error) if isinstance(error, OSError) else str(error))

    def _give_up(self, reason: str) -> None:
        """End a recording that cannot be written any more."""
        self._has_failed = True
        self._warn(
            f"the recording {self._path} ends here: {reason}. The gateway "
            "continues without it; free space on the disk and restart the gateway to record again"
        )

    async def close(self) -> None:
        """Write the remaining entries and the last line, and close the file."""
        self.put(Entry(self._clock(), RECORDER_SIDE, "!", b"", "ends here"))
        self._closing = True
        self._flush_event.set()
        await asyncio.wait((self._write_task,))
        await self.flush()
        await run_in_thread(self._close_file)

    # --- on a thread --------------------------------------------------------------------------------------------------

    def _write_file(self, entries: list[Entry], start_time: float, end_time: float) -> bool:
        """Write entries; return whether the oldest file was deleted for the first time.

        ``start_time`` is the Unix time at which the recording began, ``end_time`` the seconds since then. If the clock
        was set meanwhile, an entry's time is forced between the last entry's and ``end_time``. Closes the file and
        raises OSError if it cannot be written any more.
        """
        full = False
        for start in range(0, len(entries) if self._descriptor >= 0 else 0, LINES_PER_WRITE):
            lines = []
            for entry in entries[start : start + LINES_PER_WRITE]:
                self._last_time = min(max(self._last_time, entry.time - start_time), end_time)
                lines.append(_line_of(self._last_time, entry))
            try:
                self._append("".join(lines))
                full |= self._size >= self._max_bytes and self._next_file()
            except OSError:
                self._close_file()
                raise
        return full

    def _open(self, elapsed: float) -> None:
        """Begin a file whose first event is ``elapsed`` seconds into the recording. Raises OSError."""
        self._descriptor, self._size = _open_private(self._path), 0
        self._append(f"{FILE_HEADER}{FORMAT_VERSION}\n# {json.dumps({**self._header, 'from': round(elapsed, 6)})}\n")

    def _append(self, text: str) -> None:
        """Write the whole text to the file. Raises OSError."""
        data = text.encode("latin-1", "replace")
        while data:
            written = os.write(self._descriptor, data)
            data = data[written:]
            self._size += written

    def _next_file(self) -> bool:
        """Begin the next file; return whether the oldest was deleted for the first time. Raises OSError."""
        self._close_file()
        first = _rotate(self._path, self._max_files) and not self._has_warned
        self._has_warned |= first
        self._open(self._last_time)
        return first

    def _close_file(self) -> None:
        file, self._descriptor = self._descriptor, -1
        if file >= 0:
            with contextlib.suppress(OSError):
                os.close(file)


def _line_of(time: float, entry: Entry) -> str:
    """Return an entry of the wire log as a line; empty if a recording holds no entries of its kind."""
    side, arrow = entry.side, entry.arrow
    if arrow == "raw":
        arrow, text = "<" if side == MOUNT_SIDE else ">", escape(entry.data)
    elif arrow in ("<", ">"):
        if arrow == ("<" if side == MOUNT_SIDE else ">"):
            return ""  # a part of a raw chunk
        text = escape(entry.data)
    elif arrow == "x":
        return ""  # dropped bytes are parts of raw chunks, too
    else:
        text = entry.note.replace("\n", " ")
    return f"{time:.6f} {'_'.join(side.split()) or '?'} {arrow} {text}".rstrip(" ") + "\n"


def record(path: Path, gateway: Gateway, max_bytes: int = MAX_FILE_BYTES) -> Recorder:
    """Record what a gateway does from now on, in files of about ``max_bytes``. Raises UserError if it cannot write."""
    settings = {
        "began": gateway.clock(),
        "config": {"mount": gateway.config, "surface": gateway.surfaces},
        "version": version(),
        "commit": short_commit(),
    }
    keep, clock = gateway.config.record_keep, gateway.wire_log.clock
    recorder = Recorder(path, msgspec.to_builtins(settings), max_bytes, keep, gateway.warn, clock)
    gateway.wire_log.sinks.append(recorder.put)
    return recorder


def _rotate(path: Path, max_files: int) -> bool:
    """Rename existing files to FILE.1 and so on; return whether the oldest had to be deleted.

    Raises OSError, and UserError for a file that is not a recording, which stays unchanged.
    """
    if not path.is_file():
        return False
    if path.stat().st_size and not is_recording(path):
        raise UserError(f"cannot record to {path}: this file is not a recording; choose another name")
    parts = [path]
    while part_path(path, len(parts)).exists():
        parts.append(part_path(path, len(parts)))
    full = len(parts) >= max_files
    for number in range(len(parts) - 1, -1, -1):
        part = parts[number]
        if number + 1 >= max_files:
            part.unlink()
            continue
        if not part.is_symlink() and stat.S_IMODE(part.stat().st_mode) & ~OWNER_ONLY_MODE:
            part.chmod(OWNER_ONLY_MODE)
        part.replace(part_path(path, number + 1))
    return full


def _open_private(path: Path) -> int:
    """Open a file for writing that only its owner can read, whatever the umask. Raises OSError."""
    file = open_regular_fd(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, OWNER_ONLY_MODE)
    with contextlib.suppress(OSError, AttributeError):  # Windows has no such modes
        os.fchmod(file, OWNER_ONLY_MODE)
    return file
