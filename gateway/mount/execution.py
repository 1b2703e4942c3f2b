"""How the controller serves the reconciler: the line, the limits, and what is known once an operation is done."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, Refused
from gateway.core.motion_kinds import GOTOS
from gateway.mount.link.queue import AT_ONCE, LATE, MOTION, STOP
from gateway.mount.motion.wanted import Wanted
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.base.run_driver import carry_out

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: Seconds that a goto waits, at most, for the site and the clock of a mount that was found just now: limits go by them.
TELLS_ITS_SITE = 4.0


class HubExecutor:
    """An ``Executor`` (``gateway/mount/motion/executor.py``)."""

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        #: How many exchanges the operation took that was carried out last, and when the questions were asked whose
        #: answers it ended with, as many as a place takes.
        self.exchanges, self.asked_at = 0, 0.0

    @property
    def moving(self) -> bool:
        return self._controller.moving

    @property
    def slewing(self) -> bool:
        return self._controller.slewing

    @property
    def down(self) -> bool:
        return self._controller.line.state == "down"

    @property
    def deaf(self) -> bool:
        return self._controller.line.occupied

    def was_deaf(self, since: float) -> bool:
        return self._controller.line.worked_after(since)

    @property
    def served(self) -> bool:
        return self._controller.line.state == "up" and self._controller.line.served

    async def drive(self, steps: Steps, rank: int, since: float | None = None) -> Any:
        """Carry out a driver's generator: exchanges, pauses, things to do later. What is late is not begun any more."""
        controller = self._controller
        self.exchanges = exchanges = 0
        asked: list[float] = []
        late = since is not None and controller.now() - since > AT_ONCE
        if rank == MOTION:
            controller.telling.stirs()

        async def exchange(ask: Send) -> Mapping[str, Any]:
            nonlocal exchanges, late
            if late and (ask.prompt or not exchanges):
                raise Busy(LATE)
            began = controller.now()
            controller.slumber.admit(ask, rank)
            heard, times = await controller.belief.exchange(ask, rank)
            late = late or controller.now() - began > AT_ONCE
            controller.slumber.answered(ask)
            exchanges += times
            asked.append(heard.asked)
            return heard.values

        try:
            value = await carry_out(steps, exchange, controller.motions.plan, self._remark)
            self.exchanges, self.asked_at = exchanges, min(asked[-controller.driver.position_reads :], default=math.inf)
            return value
        except (Fault, asyncio.CancelledError):
            raise
        except Exception as error:  # a defect in a driver must cost one operation, never the gateway
            controller.transcript.note("mount", f"internal error, please report it: {error!r}")
            if rank != STOP and controller.motions.busy:
                controller.begin_stop()  # nobody knows what moves now; a stop that fails is tried again by itself
            raise Refused(f"Internal error: {error!r}") from error

    def _remark(self, text: str) -> None:
        self._controller.transcript.note_once("mount", text)

    async def admit(self, operation: op.Operation) -> op.Operation:
        if isinstance(operation, GOTOS):
            with contextlib.suppress(TimeoutError):  # where and when the mount is, it tells right after who it is
                async with asyncio.timeout(TELLS_ITS_SITE):
                    await self._controller.settled.wait()
        return await self._controller.checks.admit(operation)

    async def still_allowed(self) -> None:
        await self._controller.checks.still_allowed()

    async def before_motion(self) -> None:
        await self._controller.before_motion()

    def wanted_changed(self) -> None:
        self._controller.snapshot.version += 1  # a goto that was asked for changes what "slewing" answers
        self._controller.supervisor.look_after(self._controller.motions.wanted)

    def followed_up(self) -> None:
        self._controller.changed()

    def expect_end(self, when: float) -> None:
        self._controller.line.expect_urgent(when)

    def stop_sent(self) -> None:
        self._controller.ends.sent((1, 2), self._controller.guard.fastest)

    def at_rest(self) -> None:
        self._controller.telling.ordered(op.Stop())
        self._controller.guard.ended()
        self._controller.snapshot.put(op.Slewing, False, self._controller.now())

    def note(self, text: str) -> None:
        self._controller.transcript.note("mount", text)

    def begins(self, operation: op.Operation) -> None:
        self._controller.telling.ordered(operation)
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._controller.guard.began(operation)

    def taken(self, operation: op.Operation, before: Wanted) -> None:
        controller, snapshot = self._controller, self._controller.snapshot
        if isinstance(operation, GOTOS):
            controller.ends.moves((1, 2))
            snapshot.put(op.Slewing, True, controller.now())
            snapshot.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            controller.ends.moves((operation.axis,))
            snapshot.changed(op.Position)  # it must be watched from now on
        elif isinstance(operation, op.Halt):
            self._halted(operation.axis, before.by_hand.get(operation.axis))
        elif isinstance(operation, op.CancelGoto):
            snapshot.put(op.Slewing, False, controller.now())
        elif isinstance(operation, op.Sync):
            self._synced(operation)
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Sleep | op.Wake):
            snapshot.forget(op.GetStatus)
            if isinstance(operation, op.Sleep):
                self.at_rest()
                controller.slumber.begun()
        controller.changed()

    def _halted(self, axis: int, moved: op.Move | op.MoveAxis | None) -> None:
        """One axis was ended; what still moves must be allowed without it."""
        controller = self._controller
        if moved is not None:
            controller.ends.sent((axis,), controller.driver.speed(moved.rate))
        controller.guard.halted()
        if controller.motions.by_hand:
            controller.spawn(controller.motions.go_on_alone())
        else:
            controller.guard.ended()

    def _synced(self, operation: op.Sync) -> None:
        """Where the mount believes to point is another place now; all syncs add up."""
        controller = self._controller
        status, here = controller.snapshot.value(op.GetStatus), controller.snapshot.value(op.Position)
        if status is not None and status.aligned and here is not None:
            there = controller.derived.from_mount(op.Equatorial(operation.ra, operation.dec))
            controller.synced = controller.synced.added(here, there, status.equatorial)
        aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
        controller.snapshot.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
