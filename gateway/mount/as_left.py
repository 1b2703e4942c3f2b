"""Checks whether the mount was switched off while the gateway or the line was down.

If a hand control has no sync command, the gateway stores the offset of the syncs. It also stores settings that a mount
does not report, such as a drive rate. All of this becomes wrong when the mount is switched off. So the gateway records
the mount's position, tracking and clock, and compares them when the line comes up. If anything differs or cannot be
read, it resets the stored values (a driver may send a setting again), and the log asks for a sync if one was lost.
"""

from __future__ import annotations

import contextlib

from msgspec import Struct

from gateway.astro.spherical import SIDEREAL_RATE, separation
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import READ
from gateway.mount.safety.sync_sum import NO_SYNC

#: A mount counts as unchanged up to these limits: seconds since the record, clock (seconds), position (degrees).
MAX_ABSENCE, MAX_SKEW, MAX_SHIFT = 3600.0, 30.0, 0.5
#: Seconds between two records of the mount's position that are written to disk.
RECORD_PERIOD = 60.0


class MountSnapshot(Struct, frozen=True):
    """A record of the mount: the time by this computer (``at``, Unix seconds), the position in degrees, whether it
    tracked, and by how many seconds its clock was ahead of the computer's (``ahead``).
    """

    at: float
    ra: float
    dec: float
    tracked: bool
    ahead: float


class SameMountCheck:
    """Compares the mount with its last record, ``snapshot``. ``save_due`` is emitted when the record must be saved."""

    def __init__(self, context: Context, runner: DriverRunner) -> None:
        self._context, self._runner = context, runner
        self.snapshot: MountSnapshot | None = None
        self._last_record_at, self._checked = 0.0, False
        context.link.came_up.connect(self._require_check)
        self.save_due: Signal[None] = Signal()

    def _require_check(self, _: None) -> None:
        self._checked = False

    @property
    def _stores_values(self) -> bool:
        driver, synced = self._context.driver, self._context.syncs.value
        return bool(driver.stale_note) or ((synced != NO_SYNC or any(driver.sync_offset)) and driver.emulates_sync)

    def record_position(self, _: op.Equatorial) -> None:
        """Record position, tracking and clock of a checked mount, if the gateway stores syncs or settings for it."""
        if not (self._checked and self._stores_values):
            return
        context = self._context
        place, status = context.driver.last_position, context.cache.last_value(op.GetStatus)
        clock = context.site_clock.present_time(context.site_clock.mount_clock)
        if place is None or status is None or clock is None:
            return
        host, tracked = context.site_clock.computer_time(), status.tracking is not op.Tracking.OFF
        self.snapshot = MountSnapshot(host, place.ra, place.dec, tracked, clock.unix - host)
        if abs(host - self._last_record_at) > RECORD_PERIOD:
            self._last_record_at = host
            self.save_due.emit(None)

    async def check(self) -> None:
        """Compare the mount with its last record; unless they agree, reset the stored syncs and driver settings."""
        keeps, context = not self._stores_values or await self._is_unchanged(), self._context
        self._checked = True
        if keeps:
            return
        stale_note, synced = context.driver.stale_note, context.driver.emulates_sync and context.syncs.value != NO_SYNC
        with contextlib.suppress(Fault):
            await self._runner.drive(context.driver.renew_settings(), READ)
        if context.driver.emulates_sync:
            context.syncs.reset("sync again: the mount may have been switched off, and earlier syncs no longer count")
        also = f"; {stale_note}" if stale_note else ""
        context.note(f"{context.syncs.resync_reason if synced else 'the mount may have been switched off'}{also}")

    async def _is_unchanged(self) -> bool:
        record, now = self.snapshot, self._context.site_clock.computer_time()
        if record is None or not 0.0 <= now - record.at < MAX_ABSENCE:
            return False
        try:
            if not (await self._runner.perform(op.GetStatus(), READ)).aligned:
                return False
            clock = (await self._runner.perform(op.GetClock(), READ)).unix - self._context.site_clock.computer_time()
            place = await self._runner.perform(op.Position(), READ)
        except Fault:
            return False
        turned = 0.0 if record.tracked else SIDEREAL_RATE * (now - record.at)
        return (
            abs(clock - record.ahead) < MAX_SKEW
            and separation(record.ra + turned, record.dec, place.ra, place.dec) < MAX_SHIFT
        )
