"""The motion marker: a file that exists while the mount moves by order of the gateway.

A process that was killed cannot stop its mount. If the marker exists, the next gateway or ``mount-gateway stop`` does.
It is written before the motion is sent, without flushing to the disk: it must survive the process, not a power failure,
and it never delays a motion by more than ``WRITE_TIMEOUT`` seconds.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import msgspec

from gateway.app.state.file import MarkerContent
from gateway.core.errors import explain_os_error
from gateway.core.waiting import run_in_thread
from gateway.system.files import replace_file

#: Seconds. A write takes a fraction of a millisecond; a disk that is busy must not delay an arrow noticeably.
WRITE_TIMEOUT = 0.02
#: Seconds between two checks for motion, and seconds at rest after which the marker is deleted.
CHECK_PERIOD, REST_DELAY = 1.0, 5.0

#: Calls a function with arguments on a thread, and returns its result.
InThread = Callable[..., Awaitable[Any]]


class MotionMarker:
    """Keeps the marker file: ``content`` returns what to write, ``busy`` whether the mount may be moving."""

    def __init__(
        self,
        path: Path,
        content: Callable[[], MarkerContent],
        busy: Callable[[], bool],
        warn: Callable[[str], None],
        in_thread: InThread = run_in_thread,
        *,
        exists: bool = False,
    ) -> None:
        self.path, self._get_content, self._busy, self._warn, self._run_in_thread = path, content, busy, warn, in_thread
        self._wanted_content: bytes | None = b"" if exists else None
        self._written_content = self._wanted_content
        self._quiet_time = 0.0
        self._write_task: asyncio.Task[None] | None = None
        self._watch_task: asyncio.Task[None] | None = None
        if exists:
            self._start_watch()

    async def before_motion(self) -> None:
        """Write the marker; return once a marker is on the disk, or after ``WRITE_TIMEOUT`` seconds on a busy disk."""
        marked = self._written_content is not None and self._wanted_content is not None
        self._request_write(msgspec.json.encode(self._get_content()))
        self._quiet_time = 0.0
        self._start_watch()
        if not marked and self._write_task is not None:
            await asyncio.wait({self._write_task}, timeout=WRITE_TIMEOUT)

    def renew(self) -> None:
        """Update the marker after a change that matters for stopping, for example suspended tracking."""
        if self._wanted_content is not None:
            self._request_write(msgspec.json.encode(self._get_content()))

    def _request_write(self, content: bytes | None) -> None:
        """Write this content, or delete the file (None); writes run one after another, and the last write wins."""
        self._wanted_content = content
        if self._write_task is None and self._written_content != content:
            self._write_task = asyncio.get_running_loop().create_task(self._write())

    async def _write(self) -> None:
        try:
            while self._written_content != self._wanted_content:
                content = self._wanted_content
                try:
                    await self._run_in_thread(self._write_or_delete, content)
                except OSError as error:
                    self._warn(
                        f"cannot write the motion marker {self.path} "
                        f"({explain_os_error(error)}): after a crash the mount would not be stopped automatically"
                    )
                self._written_content = content
        finally:
            self._write_task = None

    def _write_or_delete(self, content: bytes | None) -> None:
        if content is None:
            self.path.unlink(missing_ok=True)
        else:
            replace_file(self.path, content, flush=False)

    def _start_watch(self) -> None:
        if self._watch_task is None or self._watch_task.done():
            self._watch_task = asyncio.get_running_loop().create_task(self._delete_at_rest())

    async def _delete_at_rest(self) -> None:
        """Delete the marker after ``REST_DELAY`` seconds of rest, so that it lasts from one guide pulse to the next."""
        self._quiet_time = 0.0
        while self._quiet_time < REST_DELAY:
            await asyncio.sleep(CHECK_PERIOD)
            self._quiet_time = 0.0 if self._busy() else self._quiet_time + CHECK_PERIOD
        self._request_write(None)

    async def close(self) -> None:
        """Delete the marker, unless the mount could not be stopped: then the next gateway needs it."""
        if self._watch_task is not None:
            self._watch_task.cancel()
        if not self._busy():
            self._request_write(None)
        if self._write_task is not None:
            await asyncio.wait({self._write_task})
