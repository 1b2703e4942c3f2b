"""Keeps readings fresh: what clients poll is renewed before it grows old, and so is what the limits need.

Every kind of read goes round by itself, so that none makes another late: while anything moves the position comes at
least twice a second as far as the mount's line can. With nobody asking there is one heartbeat every few seconds.
"""

from __future__ import annotations

import asyncio

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, NotAligned
from gateway.core.waiting import TimedEvent
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import HibernationGate
from gateway.mount.motion.ends import EndWatch
from gateway.mount.readings.cache import RENEW, Kind
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.settings import SiteAndClock

HEARTBEAT = 5.0
#: How old the mount's own clock and site may grow, each in its turn: a person may change them at its keys.
#: With nobody there it is seen later, but it is seen: who comes then, and the limits, go by it.
OWN_AGE, OWN_AGE_ALONE = 25.0, 100.0
ASK_AGAIN = 1.0
#: How long the axes are left alone that nobody has asked for and the mount did not tell.
NOT_TOLD = 10.0
#: What nobody wants waits until an answer or a motion wakes it.
IDLE = 3600.0
#: The shortest pause between two exchanges of the same kind: others need the line, too.
BREATH = 0.05
#: How much of an exchange goes by, on average, until the line is free for the next.
WAITING = 0.5
#: Timers come up to so much too early: event loops count in milliseconds.
SOON = 0.001


class Poller:
    """One task for every kind of read; an answer or a motion wakes those whom it concerns."""

    def __init__(
        self,
        context: Context,
        gate: HibernationGate,
        reader: Reader,
        settings: SiteAndClock,
        watch: LimitWatch,
        ends: EndWatch,
    ) -> None:
        self._context, self._link, self._cache = context, context.link, context.cache
        self._gate, self._reader, self._settings, self._watch, self._ends = gate, reader, settings, watch, ends
        self._axes_refused = -1e9
        self._news = {kind: TimedEvent() for kind in RENEW}
        self._cache.changed.connect(self._changed)
        self._reading_own: asyncio.Task[None] | None = None
        #: The mount's own site and clock are read in turn.
        self._own: tuple[Kind, Kind] = (op.GetSite, op.GetClock)
        self._asked_own = context.now()

    def start(self) -> None:
        for kind in RENEW:
            self._context.tasks.spawn(self._for_ever(kind))

    def _changed(self, kind: Kind) -> None:
        """An answer has come or was forgotten, or a motion began: whoever waits must count anew."""
        if kind in self._news:
            self._news[kind].set()
            if kind is op.Slewing:
                self._news[op.Position].set()
            elif kind is op.Position:
                self._news[op.AxisPosition].set()

    async def _for_ever(self, kind: Kind) -> None:
        await self._context.known.wait()
        while True:
            try:
                await self._keep_fresh(kind)
            except Exception as error:  # nothing may end this but the end of the gateway
                self._context.note(f"internal error, please report it: {error!r}")
                await asyncio.sleep(ASK_AGAIN)

    async def _keep_fresh(self, kind: Kind) -> None:
        while True:
            if self._link.state != "up" or self._gate.closed:
                await asyncio.sleep(0.2)
                continue
            pause = self._pause(kind, self._context.now())
            if pause <= SOON:
                await self.renew(kind)
                pause = self._pause(kind, self._context.now())
            if kind is op.Position:
                await self._now_and_then(self._context.now())
                pause = min(
                    self._pause(kind, self._context.now()), HEARTBEAT - self._cache.age(kind, self._context.now())
                )
            self._news[kind].clear()
            await self._news[kind].within(max(0.005, pause))

    async def _now_and_then(self, now: float) -> None:
        """The heartbeat; the mount's own clock and site while nothing moves, whoever asks: limits go by them, too."""
        if self._cache.age(op.Position, now) >= HEARTBEAT:
            await self.renew(op.Position)
        clock = self._context.site_clock.mount_clock
        asked = self._asked_own if clock is None else max(self._asked_own, clock[1])
        if now - asked <= (OWN_AGE if self._wanted(op.Position, now) else OWN_AGE_ALONE) or self._watched:
            return
        if self._reading_own is None or self._reading_own.done():  # not here: the position must not wait for it
            self._asked_own, self._own = now, self._own[::-1]
            told = self._context.site_clock
            known = told.mount_clock if self._own[0] is op.GetClock else told.mount_site
            if known is not None:
                self._reading_own = self._context.tasks.spawn(self.renew(self._own[0]))

    def _wanted(self, kind: Kind, now: float) -> bool:
        """Whether somebody polls this, or the gateway itself must watch it."""
        if kind is op.Position and self._watched:
            return True
        if kind is op.AxisPosition and now - self._axes_refused > NOT_TOLD and self._watch.axes_every is not None:
            return True
        return (kind is op.Slewing and self._context.movement.slewing) or self._cache.polled(kind, now)

    @property
    def _watched(self) -> bool:
        """Whether the mount moves, by whomever: the line has better to do than to tell the time."""
        return self._context.movement.anything or self._watch.restless or self._ends.pending

    def _pause(self, kind: Kind, now: float) -> float:
        """Seconds until this kind must be asked again, so that its answer comes when the last one grows old."""
        if not self._wanted(kind, now):
            return IDLE
        ahead = (self._reader.exchanges(kind) + WAITING) * self._link.typical
        every = RENEW[kind]
        if kind is op.AxisPosition and not self._cache.polled(kind, now):
            every = self._watch.axes_every or every
        return max(every - ahead, BREATH) - self._cache.age(kind, now)

    async def renew(self, kind: Kind) -> None:
        """Ask the mount again. That it was decided to is recorded: a replay asks when this run did."""
        self._context.log.put("hub", "r", note=kind.__name__)
        if kind is op.GetSite or kind is op.GetClock:
            await self._settings.renew(kind)
            return
        try:
            await self._reader.anew(kind())
        except Fault as fault:
            if not isinstance(fault, NoAnswer | NotAligned):
                self._context.note_once(f"{kind.__name__}: {fault}")
            if kind is op.AxisPosition:
                self._axes_refused = self._context.now()
            if self._cache.age(kind, self._context.now()) > RENEW[kind]:
                await asyncio.sleep(RENEW[kind])
