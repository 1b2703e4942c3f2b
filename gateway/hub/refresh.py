"""Keeping the snapshot fresh: what clients poll is renewed before it grows old, and so is what the hub must watch.

The position goes round by itself, so that nothing else makes it late: while anything moves it comes at least twice a
second as far as the mount's line can. With nobody asking there is one heartbeat every few seconds.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from gateway import operations as op
from gateway.errors import Fault, NoAnswer, NotAligned
from gateway.hub.snapshot import RENEW, Kind

if TYPE_CHECKING:
    from gateway.hub.core import Hub

HEARTBEAT = 5.0
CLOCK_AGE = 120.0
ASK_AGAIN = 1.0
#: How long it may take until something new is found to be wanted.
IDLE = 0.25
#: The shortest pause between two exchanges of the same kind: others need the line, too.
BREATH = 0.05


#: Everything else that is renewed while it is wanted.
OTHERS = tuple(kind for kind in RENEW if kind is not op.Position)


class Refresh:
    """Two tasks: one for the position, one for everything else, which sleeps until the first one calls it."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._took: dict[Kind, float] = {}
        self._called = asyncio.Event()

    def start(self) -> None:
        self._hub.spawn(self._for_ever(self._position))
        self._hub.spawn(self._for_ever(self._others))

    async def _for_ever(self, once: Callable[[], Awaitable[float]]) -> None:
        """Do it again and again, with the pauses it asks for, while the line is up."""
        hub = self._hub
        await hub.identified.wait()
        while True:
            try:
                await asyncio.sleep(0.2 if hub.line.state != "up" else max(0.005, await once()))
            except Exception as error:  # nothing may end this but the end of the gateway
                hub.transcript.note("mount", f"internal error, please report it: {error!r}")
                await asyncio.sleep(ASK_AGAIN)

    async def _position(self) -> float:
        now = self._hub.now()
        if self._pause(op.Position, now) <= 0:
            await self._renew(op.Position)
        await self._now_and_then(now)
        now = self._hub.now()
        if not self._called.is_set() and any(self._wanted(kind, now) for kind in OTHERS):
            self._called.set()
        return self._pause(op.Position, now)

    async def _others(self) -> float:
        await self._called.wait()
        now = self._hub.now()
        if not any(self._wanted(kind, now) for kind in OTHERS):
            self._called.clear()
            return 0.0
        due = [kind for kind in OTHERS if self._pause(kind, now) <= 0]
        if due:
            await asyncio.gather(*(self._renew(kind) for kind in due))
        now = self._hub.now()
        return min(self._pause(kind, now) for kind in OTHERS)

    async def _now_and_then(self, now: float) -> None:
        """The heartbeat; the mount's clock while somebody is there."""
        hub = self._hub
        if hub.snapshot.age(op.Position, now) >= HEARTBEAT:
            await self._renew(op.Position)
        clock = hub.observatory.mount_clock
        if clock is not None and now - clock[1] > CLOCK_AGE and self._wanted(op.Position, now):
            await hub.settings.renew_clock()

    def _wanted(self, kind: Kind, now: float) -> bool:
        """Whether somebody polls this, or the hub itself must watch it."""
        hub = self._hub
        watched = kind is op.Position and (hub.moving or hub.guard.restless)
        return watched or (kind is op.Slewing and hub.slewing) or hub.snapshot.polled(kind, now)

    def _pause(self, kind: Kind, now: float) -> float:
        """Seconds until this kind must be asked again, so that its answer comes when the last one grows old."""
        if not self._wanted(kind, now):
            return IDLE
        ahead = self._took.get(kind, self._hub.line.typical)
        return max(RENEW[kind] - ahead, BREATH) - self._hub.snapshot.age(kind, now)

    async def _renew(self, kind: Kind) -> None:
        hub = self._hub
        began = hub.now()
        try:
            await asyncio.shield(hub.shared(kind()))
        except Fault as fault:
            if not isinstance(fault, NoAnswer | NotAligned):
                hub.transcript.note_once("mount", f"{kind.__name__}: {fault}")
            if hub.snapshot.age(kind, hub.now()) > RENEW[kind]:
                await asyncio.sleep(RENEW[kind])
            return
        took = hub.now() - began
        self._took[kind] = took + 0.8 * (self._took.get(kind, took) - took)
