"""Keeps readings fresh: reads what clients poll and what the limits need again before it becomes stale.

Each kind of read has its own task, so that none delays another. While the mount moves, its position is read at least
twice a second if the line is fast enough. Without clients the position is read every few seconds, and more often if a
person at the hand control could drive the mount to a limit within that time.
"""

from __future__ import annotations

import asyncio
import re
from math import inf

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, NotAligned
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import HibernationGate
from gateway.mount.motion.ends import EndWatch
from gateway.mount.readings.cache import POLL_PERIOD, Kind
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.settings import SiteClockOperations

#: The longest time in seconds between two position reads while no client polls the position.
POSITION_PERIOD = 5.0
#: The settings that a person may change at the hand control, and the seconds between two reads of each: while clients
#: poll, and while none does. The limits depend on them even without a client.
SETTING_READS: tuple[Kind, ...] = (op.GetSite, op.GetClock)
SETTING_PERIOD, SETTING_PERIOD_ALONE = 50.0, 200.0
#: Seconds between two reads of the site of a mount that accepts no site while aligned. The time is short, so that gotos
#: soon use a site that a person sets at the mount.
SITE_PERIOD = 5.0
#: Seconds to wait after an error, and until the next check if the site or clock cannot be read now.
RETRY_DELAY = 1.0
#: Seconds until the axes are read again after the mount failed to report them, unless a client polls them.
AXES_RETRY = 10.0
#: Seconds between two reads of the status while no client polls it, and from the end of a motion to the next read: by
#: then a parked mount no longer tracks.
STATUS_PERIOD_ALONE, STATUS_DELAY_AFTER_MOTION = 12.0, 5.0
#: Seconds for which a task sleeps if its reading is not needed; a new reading or a motion wakes it.
IDLE_SLEEP = 3600.0
#: The shortest time in seconds between two reads of the same kind: other exchanges need the line, too.
SHORTEST_PAUSE = 0.05
#: Seconds between the position that shows a motion by the hand control and the next one, which shows its speed.
MOVED_BY_OTHERS_PERIOD = 0.2
#: The average wait until the line is free, as a part of the duration of an exchange.
LINE_WAIT_FRACTION = 0.5
#: Seconds by which timers may fire too early, because event loops count in milliseconds.
TIMER_ERROR = 0.001


class Poller:
    """Runs a task for each kind of read; the cache wakes the task when its next read may be due earlier."""

    def __init__(
        self,
        context: Context,
        gate: HibernationGate,
        reader: Reader,
        settings: SiteClockOperations,
        watch: LimitWatch,
        end_watch: EndWatch,
    ) -> None:
        self._context, self._link, self._cache = context, context.link, context.cache
        self._gate, self._reader, self._settings, self._watch, self._ends = gate, reader, settings, watch, end_watch
        #: By kind of read, the loop time of the last failure.
        self._failed_at = dict.fromkeys(POLL_PERIOD, -1e9)
        #: The loop time at which the status is read, however fresh it is.
        self._status_due_at = inf
        #: The loop times of the last requests for site and clock.
        self._requested_at = dict.fromkeys(SETTING_READS, context.now())
        reader.goto_over.connect(self._on_goto_ended)

    def start(self) -> None:
        for kind in (*POLL_PERIOD, *SETTING_READS):
            self._context.tasks.spawn(self._run(kind))

    async def _run(self, kind: Kind) -> None:
        await self._context.identified.wait()
        while True:
            try:
                await self._keep_fresh(kind)
            except Exception as error:  # a defect must not end the task
                self._context.note(f"internal error, please report it: {error!r}")
                await asyncio.sleep(RETRY_DELAY)

    async def _keep_fresh(self, kind: Kind) -> None:
        while True:
            if self._link.state != "up" or self._gate.refuses_reads:
                await asyncio.sleep(0.2)
                continue
            pause = self._due_in(kind, self._context.now())
            if pause <= TIMER_ERROR:
                await self.renew(kind)
                pause = self._due_in(kind, self._context.now())
            self._cache.due_events[kind].clear()
            await self._cache.due_events[kind].wait_within(max(0.005, pause))

    def _is_needed(self, kind: Kind, now: float) -> bool:
        """Whether a client polls this kind of read, or the gateway itself needs it."""
        if kind is op.Position and self._is_moving:
            return True
        if kind is op.AxisPosition and now - self._failed_at[kind] > AXES_RETRY and self._watch.hour_angle.read_period:
            return True
        if kind is op.Slewing and (self._context.movement.slewing or self._context.driver.moved_by_others):
            return True
        return self._cache.is_polled(kind, now)

    @property
    def _is_moving(self) -> bool:
        """Whether the mount moves for any reason; then other reads leave the line to positions."""
        runs_on = self._context.run_on.current is not None
        return self._context.movement.any_motion or self._watch.moved_by_others or self._ends.is_watching or runs_on

    def _on_goto_ended(self, _: None) -> None:
        self._status_due_at = self._context.now() + STATUS_DELAY_AFTER_MOTION
        self._cache.due_events[op.GetStatus].set()

    def _due_in(self, kind: Kind, now: float) -> float:
        """Return the seconds until the next request. Its reply should arrive when the last reading becomes stale."""
        if kind in SETTING_READS:
            return self._setting_pause(kind, now)
        if kind is op.Position and not self._is_needed(kind, now):
            heartbeat = max(POLL_PERIOD[kind], min(POSITION_PERIOD, self._watch.position_needed_within))
            return heartbeat - self._cache.age(kind, now)
        if not self._is_needed(kind, now):
            return self._status_pause(now) if kind is op.GetStatus else IDLE_SLEEP
        ahead = (self._reader.exchange_counts.get(kind, 1) + LINE_WAIT_FRACTION) * self._link.times.typical_rtt
        every = POLL_PERIOD[kind]
        if kind is op.Position and self._watch.others_just_began:
            every = MOVED_BY_OTHERS_PERIOD
        if kind is op.AxisPosition and not self._cache.is_polled(kind, now):
            every = self._watch.hour_angle.read_period or every
        return max(every - ahead, SHORTEST_PAUSE) - self._cache.age(kind, now)

    def _status_pause(self, now: float) -> float:
        """Return the seconds until the next status read while no client polls it; in motion, positions go first."""
        if self._is_moving:
            return STATUS_PERIOD_ALONE
        old = min(self._cache.age(op.GetStatus, now), now - self._failed_at[op.GetStatus])
        rests = now - self._watch.at_rest_since
        return max(min(STATUS_PERIOD_ALONE - old, self._status_due_at - now), STATUS_DELAY_AFTER_MOTION - rests)

    def _setting_pause(self, kind: Kind, now: float) -> float:
        """Return the seconds until the mount's own site or clock is read; in motion, positions go first."""
        known = self._context.site_clock
        busy = self._is_moving or self._context.wanted.value.pending
        if busy or (known.mount_site if kind is op.GetSite else known.mount_clock) is None:
            return RETRY_DELAY
        every = SETTING_PERIOD if self._is_needed(op.Position, now) else SETTING_PERIOD_ALONE
        if kind is op.GetSite and not self._context.driver.can_set_site_aligned:
            every = SITE_PERIOD
        return every - (now - self._requested_at[kind])

    async def renew(self, kind: Kind) -> None:
        """Ask the mount for this reading. A fault is not raised, but logged unless it is NoAnswer or NotAligned."""
        if kind is op.GetStatus:
            self._status_due_at = inf
        if kind is op.GetSite or kind is op.GetClock:
            self._requested_at[kind] = self._context.now()
            await self._settings.renew(kind)
            return
        try:
            await self._reader.read_now(kind())
        except Fault as fault:
            if not isinstance(fault, NoAnswer | NotAligned):
                reading = re.sub("(?<=[a-z])(?=[A-Z])", " ", kind.__name__.removeprefix("Get")).lower()
                self._context.note_once(f"the mount was asked for its {reading}: {fault}")
            self._failed_at[kind] = self._context.now()
            if self._cache.age(kind, self._context.now()) > POLL_PERIOD[kind]:
                await asyncio.sleep(POLL_PERIOD[kind])
