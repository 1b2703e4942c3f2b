"""Keeps a mount's state file and motion marker up to date while its gateway runs.

Changes are written soon, on a thread; a burst of changes causes few writes. If the folder cannot be written to, one
warning says so and everything else works. Two gateways never share a file: the second keeps its state in memory.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from msgspec import Struct
from msgspec.structs import replace

from gateway.app.state import file
from gateway.app.state.file import MarkerContent, SavedState
from gateway.app.state.motion_marker import InThread, MotionMarker
from gateway.core.errors import explain_file_error, explain_os_error
from gateway.core.operations import Values
from gateway.core.waiting import run_in_thread
from gateway.mount.as_left import MountSnapshot
from gateway.mount.controller import MountController
from gateway.mount.motion.left_moving import MAX_MARK_AGE, Leftover
from gateway.mount.safety.sync_sum import SyncSum
from gateway.mount.site.program_settings import SiteOfProgram
from gateway.protocols.base.session import SharedSettings
from gateway.system.files import replace_file, state_folder
from gateway.system.locks import LockHeld, PidLock

#: Seconds between two writes of the file while changes go on.
WRITE_PERIOD = 1.0


class PreviousRun(Struct, frozen=True):
    """The state that the previous run saved, and the motion marker if it ended while the mount moved."""

    saved_state: SavedState
    marker: MarkerContent | None = None


def restore(controller: MountController, previous_run: PreviousRun) -> None:
    """Restore the saved state. Stop a mount left moving; after ``MAX_MARK_AGE`` seconds only if it still moves."""
    controller.driver.restore_state(previous_run.saved_state.mount, moving=False)
    controller.syncs.value = previous_run.saved_state.synced
    controller.same_mount_check.snapshot = previous_run.saved_state.left
    controller.site_clock.stored_site = previous_run.saved_state.site_of_program
    if previous_run.marker is not None:
        controller.driver.restore_state(previous_run.marker.memory, moving=True)
        controller.context.run_on.note_may_move()
        left = previous_run.marker
        if left.motion is not None and controller.site_clock.computer_time() - left.at >= MAX_MARK_AGE:
            controller.identification.set_leftover_motion(left.motion)
        else:
            controller.reconciler.update(replace(controller.reconciler.wanted, stop_owed=True))


class StateStore:
    """Keeps a mount's files; without the lock on them it saves nothing. ``shared`` are the settings of all clients."""

    def __init__(
        self,
        protocol: str,
        where: str,
        marker_defaults: MarkerContent,
        configured_folder: str | None,
        warn: Callable[[str], None],
        in_thread: InThread = run_in_thread,
    ) -> None:
        self.folder, self.stem = state_folder(configured_folder), file.file_name(protocol, where)
        self.path, self._marker_path = (self.folder / f"{self.stem}.{ending}" for ending in ("json", "moving"))
        #: Holds the number of the process that owns these files; another number in it means another gateway.
        self.lock_path = self.folder / f"{self.stem}.lock"
        self.has_lock = False
        #: A simulated mount ends with this process: it needs no marker, and a second gateway is no conflict.
        self._simulated = where == "sim"
        self._marker_defaults, self.in_thread = marker_defaults, in_thread
        self._warn, self._has_warned = warn, False
        #: A warning that another gateway has these files, to be shown once this gateway has started; else empty.
        self.conflict_text = ""
        #: The process that has the lock instead, as text; empty if none is known to have it.
        self.holder = ""
        self._lock = PidLock(self.lock_path)
        self._take_lock()
        saved = self._read()
        self.shared = SharedSettings(file.to_settings(saved), self.save_soon)
        self._uses_marker = self.has_lock and not self._simulated
        self.previous_run = PreviousRun(saved, file.read_marker(self._marker_path) if self._uses_marker else None)
        self._written_bytes = file.encode_state(saved)
        self._get_driver_memory: Callable[[bool], Values] = lambda moving: saved.mount
        self._get_sync_sum: Callable[[], SyncSum] = lambda: saved.synced
        self._get_snapshot: Callable[[], MountSnapshot | None] = lambda: saved.left
        self._get_site: Callable[[], SiteOfProgram | None] = lambda: saved.site_of_program
        self._get_motion: Callable[[], Leftover | None] = lambda: None
        self._get_time: Callable[[], float] = lambda: 0.0
        self._marker: MotionMarker | None = None
        self._has_changes = False
        self._closing = asyncio.Event()
        self._writer: asyncio.Task[None] | None = None

    def _warn_once(self, text: str) -> None:
        """Warn the user of the first failure, not of later ones: a disk that is full stays full for a while."""
        if not self._has_warned:
            self._has_warned = True
            self._warn(text)

    # --- beginning --------------------------------------------------------------------------------------------------

    def _take_lock(self) -> None:
        """Create the folder and take the lock of the files."""
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock.acquire()
            self.has_lock = True
        except LockHeld as by:
            self.holder = str(by)
            if not self._simulated:
                self.conflict_text = (
                    f"another mount-gateway ({by}) runs for this mount and saves its state, in {self.path}"
                )
        except OSError as error:
            why = explain_file_error(self.folder, error)
            self._warn_once(
                f"{self.folder} cannot be written to ({why}): site, clock zone and parking are lost when the "
                f"gateway ends; --state PATH names another folder"
            )

    def _read(self) -> SavedState:
        try:
            return file.read_state(self.path)
        except OSError as error:
            if self.has_lock:
                why = explain_file_error(self.path, error, reading=True)
                self._warn_once(
                    f"cannot read the state file {self.path} ({why}): the gateway starts without the saved settings"
                )
        except ValueError as error:
            if self.has_lock:
                where = "left in place"
                with contextlib.suppress(OSError):
                    where = f"moved to {file.move_aside(self.path).name}"
                self._warn(
                    f"{self.path} is not a state file of this version ({error}): it was "
                    f"{where}, and the gateway starts without it"
                )
        return SavedState(file.FORMAT_VERSION)

    def attach(self, controller: MountController) -> None:
        """Restore the previous state in the controller, and follow its motions and changes from now on."""
        self._get_driver_memory = controller.driver.saved_state
        self._get_sync_sum = lambda: controller.syncs.value
        restore(controller, self.previous_run)
        self._get_motion = controller.identification.leftover_motion
        self._get_time = controller.site_clock.computer_time
        self._get_site = controller.site_clock.site_to_store
        self._get_snapshot = lambda: controller.same_mount_check.snapshot
        for lasting in (controller.save_due, controller.site_clock.save_due, controller.same_mount_check.save_due):
            lasting.connect(lambda _: self.save_soon())
        controller.hold.is_on = file.has_hold_file(self.folder)
        if controller.hold.is_on:
            self._warn(
                f"{self._marker_defaults.mount}: the mount is held: no program moves it until mount-gateway stop "
                "--release"
            )
        if self._uses_marker:
            if (left := self.previous_run.marker) is not None:
                why = "the last run ended while the mount was moving"
                if not left.mount:
                    unreadable = f"the motion marker {self._marker_path} cannot be read"
                    why = f"{unreadable}, as if the last run had ended during a motion"
                what = "the mount is" if controller.reconciler.wanted.stop_owed else "what still moves so is"
                self._warn(f"{self._marker_defaults.mount}: {why}: {what} stopped first")
            self._marker = MotionMarker(
                self._marker_path,
                self._get_marker,
                lambda: controller.reconciler.busy,
                self._warn_once,
                self.in_thread,
                exists=self.previous_run.marker is not None,
            )

    async def before_motion(self) -> None:
        """Write the marker of the motion that is about to begin, if this mount has a marker."""
        if self._marker is not None:
            await self._marker.before_motion()

    def _get_marker(self) -> MarkerContent:
        base, motion = self._marker_defaults, self._get_motion()
        at = 0.0 if motion is None else self._get_time()  # guide pulses must not write the marker again and again
        return MarkerContent(base.mount, base.baud, self._get_driver_memory(True), at, motion)

    # --- saving -----------------------------------------------------------------------------------------------------

    def save_soon(self) -> None:
        """Write the state soon, because it may have changed."""
        if self._marker is not None:
            self._marker.renew()
        self._has_changes = True
        if self.has_lock and self._writer is None and not self._closing.is_set():
            self._writer = asyncio.get_running_loop().create_task(self._save())

    async def _save(self) -> None:
        """Write the first change at once, and those that follow together."""
        try:
            while self._has_changes:
                self._has_changes = False
                if await self._write():
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(self._closing.wait(), WRITE_PERIOD)
        finally:
            self._writer = None

    async def _write(self) -> bool:
        """Write the state if it differs from the file; return whether it differed."""
        values = self._get_driver_memory(False), self._get_sync_sum(), self._get_site(), self._get_snapshot()
        data = file.encode_state(file.to_saved_state(self.shared.settings, *values))
        if data == self._written_bytes:
            return False
        self._written_bytes = data
        try:
            await self.in_thread(replace_file, self.path, data)
        except OSError as error:
            self._written_bytes = b""
            self._warn_once(
                f"cannot write the state file {self.path} ({explain_os_error(error)}): what is "
                "set now is lost when the gateway ends"
            )
        return True

    async def close(self) -> None:
        """Finish writing and release the lock. Call it after the mount was stopped."""
        self._closing.set()
        if self._writer is not None:
            await asyncio.wait({self._writer})
        if self.has_lock:
            await self._write()  # where the mount is now
        if self._marker is not None:
            await self._marker.close()
        self._lock.release()
