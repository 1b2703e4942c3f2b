"""Site and clock: told from what is known, taken from clients at once, handed on to the mount where the policy allows.

Telling an aligned hand control its site or time may cost the alignment, so by default only an unaligned one is told;
what is not sent is kept here and said once in the log.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from gateway import operations as op
from gateway.errors import Fault, NoAnswer, NoDevice
from gateway.line import READ, SETTING

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: How long a half of a site waits for the other one, and a client for the mount's first word.
HALF_SITE = 2.0
FIRST_ANSWER = 2.0
#: How long one look at the mount's GPS unit serves everybody, with a fix and without.
GPS_FIX, GPS_SEARCH = 300.0, 30.0


class SiteAndClock:
    """Performs the operations that read and set site and clock."""

    def __init__(self, hub: Hub) -> None:
        self._hub, self._observatory = hub, hub.observatory
        self.handlers: dict[type[op.Operation], Callable[[Any], Any]] = {
            op.GetSite: self._get_site,
            op.GetClock: self._get_clock,
            op.SiderealTime: self._sidereal_time,
            op.SetSite: self._set_site,
            op.SetClock: self._set_clock,
            op.GetGps: self._get_gps,
            op.ClockFromGps: self._clock_from_gps,
        }
        self._gps: tuple[op.Gps, float] | None = None
        self._looking = asyncio.Lock()

    def peek(self, kind: type[op.Operation]) -> op.Place | op.Moment | op.Gps | None:
        """The answer when it is known without asking."""
        if kind is op.GetSite:
            return self._observatory.site()
        if kind is op.GetGps:
            return self._seen_gps()
        return self._observatory.clock() if kind is op.GetClock else None

    async def _first_answers(self) -> None:
        try:
            async with asyncio.timeout(FIRST_ANSWER):
                await self._hub.settled.wait()
        except TimeoutError:
            raise NoAnswer from None

    async def _get_site(self, _: op.GetSite) -> op.Place:
        if self._observatory.site() is None:
            await self._first_answers()
        return self._hub.told.place()

    async def _get_clock(self, _: op.GetClock) -> op.Moment:
        if self._observatory.clock() is None:
            await self._first_answers()
        moment = self._observatory.clock()
        if moment is None:
            self._hub.transcript.note_once("mount", "the mount tells no time: this computer's clock stands in")
            moment = op.Moment(self._observatory.unix(), 0.0)
        return moment

    async def _sidereal_time(self, _: op.SiderealTime) -> float:
        await self._get_site(op.GetSite())
        await self._get_clock(op.GetClock())
        return self._hub.told.sidereal_time()

    def _seen_gps(self) -> op.Gps | None:
        """What the GPS unit told lately, its time running on."""
        if self._gps is None:
            return None
        seen, at = self._gps
        age = self._hub.now() - at
        return replace(seen, unix=seen.unix + age) if age < (GPS_FIX if seen.linked else GPS_SEARCH) else None

    async def _get_gps(self, operation: op.GetGps) -> op.Gps:
        await self._first_answers()
        async with self._looking:
            seen = self._seen_gps()
            if seen is None:
                told: op.Gps = await self._hub.drive(self._hub.driver.perform(operation), READ)
                seen, _ = self._gps = told, self._hub.now()
                self._observatory.gps_says(told)
        return seen

    # --- setting ----------------------------------------------------------------------------------------------------

    async def _set_site(self, operation: op.SetSite) -> None:
        """Take a half or the whole; the mount is told once both halves are there, or after a moment."""
        whole = self._observatory.set_site_half(operation)
        self._hub.snapshot.version += 1
        if whole is not None:
            self._hub.spawn(self._hand_on_site())
        else:
            self._hub.loop.call_later(HALF_SITE, lambda: self._hub.spawn(self._hand_on_site()))

    async def _hand_on_site(self) -> None:
        whole = self._observatory.take_site()
        if whole is None:
            return
        same = self._observatory.same_site(whole)
        if not same:
            self._observatory.keep_site(whole)
        if await self._to_be_told(same, "site"):
            try:
                await self._hub.drive(self._hub.driver.perform(whole), SETTING)
            except Fault as fault:
                self._hub.transcript.note("mount", f"site kept in the gateway: {fault}")
            else:
                assert whole.latitude is not None
                assert whole.longitude is not None
                self._observatory.mount_says_site(op.Place(whole.latitude, whole.longitude))
                same = True
        if same:
            self._observatory.kept_site = None
        self._hub.snapshot.version += 1

    async def _set_clock(self, operation: op.SetClock) -> None:
        """The client is believed at once."""
        at = self._hub.now()
        same = self._observatory.same_clock(operation)
        if same:
            self._observatory.kept_clock = None
        else:
            self._observatory.keep_clock(operation)
        self._hub.snapshot.version += 1
        self._hub.spawn(self._hand_on_clock(operation, at, same))

    async def _clock_from_gps(self, operation: op.ClockFromGps) -> None:
        """Where the mount's clock must not be set, the gateway's is. Raises NoDevice."""
        if await self._to_be_told(False, "clock"):
            await self._hub.drive(self._hub.driver.perform(operation), SETTING)
            await self.renew(op.GetClock)
            return
        seen = await self._get_gps(op.GetGps())
        if not seen.linked or seen.unix is None:
            raise NoDevice("The GPS is not linked.")
        present = self._observatory.clock()
        self._observatory.keep_clock(op.SetClock(seen.unix, present.offset if present else 0.0))
        self._hub.snapshot.version += 1

    async def _hand_on_clock(self, operation: op.SetClock, at: float, same: bool) -> None:
        if not await self._to_be_told(same, "clock"):
            return
        hub = self._hub
        moment = op.SetClock(operation.unix + hub.now() - at, operation.offset)
        try:
            await hub.drive(hub.driver.perform(moment), SETTING)
            value = await hub.drive(hub.driver.perform(op.GetClock()), READ)
        except Fault as fault:
            hub.transcript.note("mount", f"clock kept in the gateway: {fault}")
            return
        self._observatory.mount_says_clock(value)
        self._observatory.kept_clock = None
        hub.snapshot.version += 1

    async def _to_be_told(self, same: bool, what: str) -> bool:
        """Whether the mount is to be told a site or a clock that a client has set."""
        hub = self._hub
        if hub.policy.site_time == "never":
            hub.transcript.note_once("mount", f"the {what} that was set is kept in the gateway (site-time = never)")
            return False
        try:
            status = await hub.read(op.GetStatus())
        except Fault:
            return False
        if not status.aligned or hub.driver.takes_site_aligned:
            return True
        if same:
            return False
        if hub.policy.site_time == "always" and not hub.driver.loses_alignment:
            return True
        hub.transcript.note_once("mount", f"the mount is aligned: the {what} that was set is kept in the gateway")
        return False

    async def renew(self, kind: type[op.GetSite | op.GetClock]) -> None:
        """Read the mount's site or clock again; what somebody has set there is in force here as well."""
        hub = self._hub
        try:
            value = await hub.drive(hub.driver.perform(kind()), READ)
        except Fault:
            return
        of_clock = kind is op.GetClock
        told = self._observatory.mount_says_clock if of_clock else self._observatory.mount_says_site
        if told(value):
            what = "clock" if of_clock else "site"
            hub.transcript.note("mount", f"the {what} was changed at the mount; it is in force here, too")
            hub.snapshot.version += 1
