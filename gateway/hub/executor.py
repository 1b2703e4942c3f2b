"""How the hub serves the reconciler: line, limits, and what is known without asking once an operation is done."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gateway import operations as op
from gateway.driver import Ask, Steps
from gateway.driving import carry_out
from gateway.errors import Busy, Fault, Refused
from gateway.line import AT_ONCE, LATE, MOTION, STOP
from gateway.motion_kinds import GOTOS
from gateway.mount.motion.wanted import Wanted

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: Seconds that a goto waits, at most, for the site and the clock of a mount that was found just now: limits go by them.
TELLS_ITS_SITE = 4.0


class HubExecutor:
    """An ``Executor`` (``gateway/mount/motion/executor.py``)."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        #: How many exchanges the operation took that was carried out last, and when the questions were asked whose
        #: answers it ended with, as many as a place takes.
        self.exchanges, self.asked_at = 0, 0.0

    @property
    def moving(self) -> bool:
        return self._hub.moving

    @property
    def slewing(self) -> bool:
        return self._hub.slewing

    @property
    def down(self) -> bool:
        return self._hub.line.state == "down"

    @property
    def deaf(self) -> bool:
        return self._hub.line.occupied

    def was_deaf(self, since: float) -> bool:
        return self._hub.line.worked_after(since)

    @property
    def served(self) -> bool:
        return self._hub.line.state == "up" and self._hub.line.served

    async def drive(self, steps: Steps, rank: int, since: float | None = None) -> Any:
        """Carry out a driver's generator: exchanges, pauses, things to do later. What is late is not begun any more."""
        hub = self._hub
        self.exchanges = exchanges = 0
        asked: list[float] = []
        late = since is not None and hub.now() - since > AT_ONCE
        if rank == MOTION:
            hub.telling.stirs()

        async def exchange(ask: Ask) -> Mapping[str, Any]:
            nonlocal exchanges, late
            if late and (ask.prompt or not exchanges):
                raise Busy(LATE)
            began = hub.now()
            hub.slumber.admit(ask, rank)
            heard, times = await hub.belief.exchange(ask, rank)
            late = late or hub.now() - began > AT_ONCE
            hub.slumber.answered(ask)
            exchanges += times
            asked.append(heard.asked)
            return heard.values

        try:
            value = await carry_out(steps, exchange, hub.motions.plan, self._remark)
            self.exchanges, self.asked_at = exchanges, min(asked[-hub.driver.position_reads:], default=math.inf)
            return value
        except (Fault, asyncio.CancelledError):
            raise
        except Exception as error:  # a defect in a driver must cost one operation, never the gateway
            hub.transcript.note("mount", f"internal error, please report it: {error!r}")
            if rank != STOP and hub.motions.busy:
                hub.begin_stop()  # nobody knows what moves now; a stop that fails is tried again by itself
            raise Refused(f"Internal error: {error!r}") from error

    def _remark(self, text: str) -> None:
        self._hub.transcript.note_once("mount", text)

    async def admit(self, operation: op.Operation) -> op.Operation:
        if isinstance(operation, GOTOS):
            with contextlib.suppress(TimeoutError):  # where and when the mount is, it tells right after who it is
                async with asyncio.timeout(TELLS_ITS_SITE):
                    await self._hub.settled.wait()
        return await self._hub.checks.admit(operation)

    async def still_allowed(self) -> None:
        await self._hub.checks.still_allowed()

    async def before_motion(self) -> None:
        await self._hub.before_motion()

    def wanted_changed(self) -> None:
        self._hub.snapshot.version += 1  # a goto that was asked for changes what "slewing" answers
        self._hub.supervisor.look_after(self._hub.motions.wanted)

    def followed_up(self) -> None:
        self._hub.changed()

    def expect_end(self, when: float) -> None:
        self._hub.line.expect_urgent(when)

    def stop_sent(self) -> None:
        self._hub.ends.sent((1, 2), self._hub.guard.fastest)

    def at_rest(self) -> None:
        self._hub.telling.ordered(op.Stop())
        self._hub.guard.ended()
        self._hub.snapshot.put(op.Slewing, False, self._hub.now())

    def note(self, text: str) -> None:
        self._hub.transcript.note("mount", text)

    def begins(self, operation: op.Operation) -> None:
        self._hub.telling.ordered(operation)
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._hub.guard.began(operation)

    def taken(self, operation: op.Operation, before: Wanted) -> None:
        hub, snapshot = self._hub, self._hub.snapshot
        if isinstance(operation, GOTOS):
            hub.ends.moves((1, 2))
            snapshot.put(op.Slewing, True, hub.now())
            snapshot.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            hub.ends.moves((operation.axis,))
            snapshot.changed(op.Position)  # it must be watched from now on
        elif isinstance(operation, op.Halt):
            self._halted(operation.axis, before.by_hand.get(operation.axis))
        elif isinstance(operation, op.CancelGoto):
            snapshot.put(op.Slewing, False, hub.now())
        elif isinstance(operation, op.Sync):
            self._synced(operation)
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Sleep | op.Wake):
            snapshot.forget(op.GetStatus)
            if isinstance(operation, op.Sleep):
                self.at_rest()
                hub.slumber.begun()
        hub.changed()

    def _halted(self, axis: int, moved: op.Move | op.MoveAxis | None) -> None:
        """One axis was ended; what still moves must be allowed without it."""
        hub = self._hub
        if moved is not None:
            hub.ends.sent((axis,), hub.driver.speed(moved.rate))
        hub.guard.halted()
        if hub.motions.by_hand:
            hub.spawn(hub.motions.go_on_alone())
        else:
            hub.guard.ended()

    def _synced(self, operation: op.Sync) -> None:
        """Where the mount believes to point is another place now; all syncs add up."""
        hub = self._hub
        status, here = hub.snapshot.value(op.GetStatus), hub.snapshot.value(op.Position)
        if status is not None and status.aligned and here is not None:
            there = hub.derived.from_mount(op.Equatorial(operation.ra, operation.dec))
            hub.synced = hub.synced.added(here, there, status.equatorial)
        aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
        hub.snapshot.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
