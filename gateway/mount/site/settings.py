"""The operations that read and set site and clock. A read returns a known value; a setting is sent later.

Setting site or time of an aligned hand control may cost the alignment, so by default only an unaligned hand control
gets them. The gateway stores a value that it does not send, and the log says so once. ``settings_sync.py`` sends the
settings.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NoAnswer, NoDevice, Refused, Unsupported
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import READ, SETTING
from gateway.mount.presence import ProgramId
from gateway.mount.readings.reader import FIRST_REPLY_WAIT
from gateway.mount.site.pending_settings import Setting, kind_of
from gateway.mount.site.readers import SiteView
from gateway.mount.site.settings_sync import SettingsSender
from gateway.mount.site.site_clock import CONFIG_SOURCE, GPS_RETRY_TIME, GPS_SOURCE, MOUNT_SOURCE

#: Seconds for which a latitude waits for a longitude from the same program, or the reverse.
HALF_SITE_WAIT = 2.0
#: The longest time in seconds that a client waits to learn whether the mount refuses its setting.
REFUSAL_WAIT = 2.5


class SiteClockOperations:
    """Carries out the operations that read and set site and clock, and some settings of the motors."""

    def __init__(self, context: Context, runner: DriverRunner, settings_sender: SettingsSender) -> None:
        self._context, self._runner, self.sender = context, runner, settings_sender
        self._site_clock = context.site_clock
        #: From the type of an operation to the method that carries it out for a program.
        self.handlers: dict[type[op.Operation], Callable[[Any, ProgramId], Any]] = {
            op.GetSite: self._get_site,
            op.GetClock: self._get_clock,
            op.SiderealTime: self._get_sidereal_time,
            op.SetSite: self._set_site,
            op.SetClock: self._set_clock,
            op.SetZone: self._set_zone,
            op.GetGps: self._get_gps,
            op.ClockFromGps: self._set_clock_from_gps,
            op.SetGuideRate: self._set_motor_parameter,
            op.Backlash: self._set_motor_parameter,
            op.PeriodicError: self._set_pec,
        }
        self._gps_lock = asyncio.Lock()
        self._site_requested_at = -GPS_RETRY_TIME

    def _site_view(self, program: ProgramId) -> SiteView:
        return SiteView(self._site_clock, program)

    async def _wait_for_first_reads(self) -> None:
        try:
            async with asyncio.timeout(FIRST_REPLY_WAIT):
                await self._context.site_read.wait()
        except TimeoutError:
            raise NoAnswer from None

    async def _get_site(self, _: op.GetSite, program: ProgramId) -> op.Place:
        if self._site_view(program).site() is None:
            await self._wait_for_first_reads()
        if self._site_view(program).site() is None:
            await self._ask_for_site()
        return self._context.astrometry_for(program).site()

    async def _ask_for_site(self) -> None:
        """Ask the mount for its site again, at most every 30 s: since the start its GPS may have got a fix."""
        now = self._context.now()
        if now - self._site_requested_at < GPS_RETRY_TIME:
            return
        self._site_requested_at = now
        await self.renew(op.GetSite)

    async def _get_clock(self, _: op.GetClock, program: ProgramId) -> op.Moment:
        if self._site_view(program).clock() is None:
            await self._wait_for_first_reads()
        moment = self._site_view(program).clock()
        if moment is None:
            self._context.note_once("the mount does not report the time: this computer's clock is used")
            moment = op.Moment(self._site_view(program).unix(), self._site_view(program).settings.zone or 0.0)
        return moment

    async def _get_sidereal_time(self, _: op.SiderealTime, program: ProgramId) -> float:
        await self._get_site(op.GetSite(), program)
        await self._get_clock(op.GetClock(), program)
        return self._context.astrometry_for(program).sidereal_time()

    async def _get_gps(self, operation: op.GetGps, _: ProgramId) -> op.Gps:
        await self._wait_for_first_reads()
        async with self._gps_lock:
            gps = self._site_clock.gps_reading()
            if gps is None:
                reported: op.Gps = await self._runner.perform(operation, READ)
                self._site_clock.take_gps(reported)
                return reported
        return gps

    # --- setting ----------------------------------------------------------------------------------------------------

    async def _set_site(self, operation: op.SetSite, program: ProgramId) -> None:
        """Store latitude, longitude or both. Queue the site when both are set, or ``HALF_SITE_WAIT`` seconds later."""
        if operation.others is not None and await self._mount_has_site(operation, operation.others):
            self._site_view(program).forget_site()
            return
        if self._site_view(program).set_site_half(operation):
            self.send_site(program)
            return
        if self._site_view(program).site() is not None:  # otherwise it may never become a site: nothing waits for it
            self._context.incoming_settings.expect_rest(program, self._context.now() + HALF_SITE_WAIT)
        asyncio.get_running_loop().call_later(HALF_SITE_WAIT, self.send_site, program)

    def site_users(self) -> str:
        """Return, as text for the page, who will use a site that a person sets there now; empty if unknown."""
        context, sites = self._context, self._context.sources.sites()
        status: op.Status | None = context.cache.last_value(op.GetStatus)
        if status is None or not context.identified.is_set():
            return ""
        never = context.policy.site_time == "never" or context.driver.certain_fault(op.SetSite(0.0, 0.0)) is not None
        if not never and self.sender.accepts_site_or_clock(status):
            return "everyone: this mount takes it"
        if sites and sites[0].source in (MOUNT_SOURCE, GPS_SOURCE, CONFIG_SOURCE):
            why = "takes no site" if never else "is aligned and takes no site"
            return f"nobody: this mount {why}, and the site from {sites[0].source} counts"
        return "everyone, as long as neither the mount nor the configuration has one"

    async def _mount_has_site(self, site: op.SetSite, other_sites: Sequence[op.SetSite]) -> bool:
        """Whether the mount is known to have ``site``, or at least none of ``other_sites``, which clients have set."""
        if site.latitude is None or site.longitude is None:
            return True
        if self._context.link.state == "up" and not self._context.driver.asleep:
            await self.renew(op.GetSite)
        if self._site_clock.mount_site is None or kind_of(site) in self.sender.pending:
            return False
        return self._site_clock.is_mount_site(site) or not self._site_clock.matches_any_site(other_sites)

    def send_site(self, program: ProgramId) -> None:
        """Queue the site that a program has set. A missing latitude or longitude is that of the site it read before."""
        whole = self._site_view(program).take_completed_site()
        if whole is not None and not self._context.closed:
            self._context.incoming_settings.note_complete(program)
            self._site_view(program).store_site(whole)
            self.sender.queue(whole, by=program)

    async def _set_clock(self, operation: op.SetClock, program: ProgramId) -> None:
        """Store and queue a clock. Raises Invalid for an invalid year; with ``heard``, Refused if it is refused."""
        years = self._context.driver.clock_years
        try:
            year = datetime.fromtimestamp(operation.unix + operation.offset * 3600.0, UTC).year
        except (OSError, OverflowError, ValueError):  # before the year 1, or after 9999
            year = 0
        if year not in years:
            raise Invalid(
                f"The clock of this mount takes the years {years[0]} to {years[-1]}{f', not {year}' * bool(year)}."
            )
        self._context.incoming_settings.note_complete(program)
        self._site_view(program).store_clock(operation)
        self.sender.queue(operation, by=program)
        if operation.heard:
            await self._wait_for_refusal(operation)

    async def _set_zone(self, operation: op.SetZone, program: ProgramId) -> None:
        self._context.incoming_settings.note_complete(program)
        self._site_view(program).store_zone(operation.offset)

    async def _wait_for_refusal(self, operation: op.SetClock) -> None:
        """Wait at most ``REFUSAL_WAIT`` seconds while a setting is pending. Raises Refused if it failed meanwhile."""
        ours, why = self.sender.pending.get(kind_of(operation)), ""

        def refused(refusal: tuple[Setting, str]) -> None:
            nonlocal why
            why = refusal[1] if refusal[0] is ours else why

        self.sender.refused.connect(refused)
        try:
            until = self._context.now() + REFUSAL_WAIT
            while self.sender.pending.get(kind_of(operation)) is ours is not None and self._context.now() < until:
                await asyncio.sleep(0.1)
        finally:
            self.sender.refused.disconnect(refused)
        if why:
            raise Refused(f"The mount refused it: {why}")

    async def _set_clock_from_gps(self, operation: op.ClockFromGps, program: ProgramId) -> None:
        """Set the mount's clock from its GPS; if not possible, this program's. Raises NoDevice without a fix."""
        try:
            mount_too = await self.sender.may_set_site_or_clock()
        except Fault:
            mount_too = False
        if mount_too:
            with contextlib.suppress(Unsupported):  # a hand control that accepts no time
                await self._runner.perform(operation, SETTING)
                await self.renew(op.GetClock)
                return
        gps = await self._get_gps(op.GetGps(), program)
        if not gps.linked or gps.unix is None:
            raise NoDevice("The GPS is not linked.")
        present = self._site_view(program).clock()
        self._site_view(program).store_clock(
            op.SetClock(gps.unix, present.offset, present.dst) if present else op.SetClock(gps.unix, 0.0)
        )
        self._context.note_once("the clock that was set by the GPS is stored in the gateway")

    async def _set_motor_parameter(self, operation: op.SetGuideRate | op.Backlash, _: ProgramId) -> None:
        await self.sender.send_now_or_later(operation)

    async def _set_pec(self, operation: op.PeriodicError, _: ProgramId) -> None:
        """Switch PEC on or off; repeat this if the mount does not reply. Send a toggle only once. Raises Fault."""
        if operation.on is None:
            await self._runner.perform(operation, SETTING)
        else:
            await self.sender.send_now_or_later(operation)

    async def renew(self, kind: type[op.GetSite | op.GetClock]) -> None:
        """Read the mount's site or clock again. If it was changed at the mount, the gateway uses the new value. The
        reading is ignored if an order or setting was sent meanwhile, because it may be half old and half new.
        """
        sent = self._context.cache.order_count
        with contextlib.suppress(Fault):
            value: op.Place | op.Moment = await self._runner.perform(kind(), READ)
            if sent == self._context.cache.order_count:
                self.sender.take_reported_value(value)
