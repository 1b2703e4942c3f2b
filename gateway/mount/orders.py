"""Passes the operations of clients to the part that answers them: readings, motions, site and clock, astronomy.

Motion orders are taken here: each changes what is wanted, or is refused or superseded before it is begun.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf
from typing import Any, TypeVar, cast

from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, Held, NoAnswer, Stopped, Unsupported
from gateway.core.motion_kinds import GOTOS, MOTIONS, begins_motion
from gateway.core.waiting import Outcome, cancelled, failed, result_of
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import SETTING
from gateway.mount.motion.apply import equal_pending_halt, interrupted, too_late, without_superseded
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.motion.run_on import SILENT
from gateway.mount.motion.taps import LENGTHENED, at_guide_rate, stopped_at_once
from gateway.mount.motion.wanted import FIRST, IN_ORDER, ByHand, Order, Slew
from gateway.mount.presence import NOBODY, HostActivity
from gateway.mount.readings.cache import MAX_AGE
from gateway.mount.readings.reader import Reader
from gateway.mount.site.places import PLACES
from gateway.mount.site.settings import SiteAndClock

_T = TypeVar("_T")


class Orders:
    """``perform`` carries out an operation, ``begin`` does not wait, ``impossible`` refuses without a request."""

    def __init__(
        self, context: Context, runner: DriverRunner, reader: Reader, settings: SiteAndClock, reconciler: Reconciler
    ) -> None:
        self._context, self._link, self._wanted, self._movement = (
            context, context.link, context.wanted, context.movement)  # fmt: skip
        self._runner, self._reader, self._reconciler = runner, reader, reconciler
        self._settings = settings
        self._handlers: dict[type[op.Operation], Callable[[Any], Any]] = {
            op.GetActivity: self._activity,
            op.GetAbilities: self._abilities,
            op.TubeSide: self._tube_side,
        }

    def impossible(self, operation: op.Operation) -> Fault | None:
        """Return why an operation cannot succeed, as far as that is known without a request; None if it may."""
        driver, link = self._context.driver, self._link
        if link.state == "down" or (link.overdue and not driver.asleep):
            return NoAnswer()
        if (driver.asleep or driver.powerless) and not self._wanted.waking and begins_motion(operation):
            return Asleep()
        calculates = link.occupied or (self._context.incoming.sending is op.SetClock and self._context.incoming.waits)
        if calculates and begins_motion(operation) and not isinstance(operation, GOTOS):  # gotos may wait
            return Busy()
        try:
            if isinstance(operation, MOTIONS):
                self._context.hold.admit(operation)
        except Held as fault:
            return fault
        if not self._context.known.is_set():
            return None
        wanted = self._wanted.value
        nothing_waits = all(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending)
        return driver.impossible(operation) if nothing_waits and not wanted.owed else None

    def halt_is_pending(self, operation: op.Operation) -> bool:
        """Remove the pending orders that a halt ends; return whether an equal pending halt serves for this one."""
        reconciler = self._reconciler
        if self._movement.slewing or self._wanted.value.waiting_gotos or self._wanted.value.arrows_wait:
            return False
        wanted = without_superseded(self._wanted.value, operation)
        same = equal_pending_halt(wanted, operation)
        reconciler.want(wanted if same is None else interrupted(wanted, same))
        return same is not None

    def releases_arrow(self, activity: HostActivity) -> bool:
        """Let a full stop that only releases an arrow follow the shortest motion; False if the stop is to go first."""
        after = None if self._movement.slewing else stopped_at_once(self._wanted.value, activity, self._context.now())
        if after is not None:
            self._reconciler.want(after)
        return after is not None

    async def perform(
        self,
        operation: op.Operation[_T],
        stops: int | None = None,
        activity: HostActivity | None = None,
        patience: float = inf,
        asked: float | None = None,
    ) -> _T:
        """Carry out an operation for the connection ``activity``, and return its answer. Raises Fault.

        The client ``asked`` at this loop time (by default now), when there had been so many ``stops``; it stops waiting
        after ``patience`` seconds.
        """
        if type(operation) in MAX_AGE:
            if self._context.driver.asleep and (waking := self._reconciler.outcomes_of(op.Wake)):
                await asyncio.wait(waking)  # reads wait for the wake-up; motions do not, it may wait behind them
            return cast(_T, await self._reader.answer(operation))
        if isinstance(operation, op.Own):
            program = activity.program if activity is not None else NOBODY
            return cast(_T, await self._reader.answer_own(operation, program))
        return cast(_T, await self._order(operation, stops, activity, patience, asked))

    async def _order(
        self,
        operation: op.Operation,
        stops: int | None,
        activity: HostActivity | None,
        patience: float,
        asked: float | None,
    ) -> Any:
        """Carry out an operation whose answer is not shared between clients."""
        if isinstance(operation, op.AbortMotion):
            self._wanted.stopped_by = activity.who if activity is not None else ""
            return await self._reconciler.stop("")
        if isinstance(operation, MOTIONS):
            value = await _ended(self._take(operation, stops, activity, patience, asked))
            if isinstance(value, op.Chosen) and value.place is not None:
                value = op.Chosen(self._context.astrometry.from_mount(value.place), value.text, value.reply)
            return value
        program = activity.program if activity is not None else NOBODY
        if type(operation) in PLACES:
            return PLACES[type(operation)](self._context.astrometry_for(program), operation)
        if (setting := self._settings.handlers.get(type(operation))) is not None:
            return await setting(operation, program)
        handler = self._handlers.get(type(operation))
        if handler is not None:
            return await handler(operation)
        return await self._runner.perform(operation, SETTING)

    def begin(
        self,
        operation: op.Operation,
        stops: int,
        failed: Callable[[Fault], None],
        activity: HostActivity,
        asked: float | None = None,
    ) -> asyncio.Future[None]:
        """Carry out an operation without waiting for it; ``failed`` is called with the Fault if it fails."""
        motion = self._take(operation, stops, activity, asked=asked) if isinstance(operation, MOTIONS) else None

        async def finish() -> None:
            try:
                await (_ended(motion) if motion is not None else self.perform(operation, stops))
            except Fault as fault:
                failed(fault)
            except Exception as error:  # no caller waits for this task, so a defect must be logged here
                self._context.note(f"internal error, please report it: {error!r}")
                if self._reconciler.busy:
                    self._reconciler.begin_stop()  # the failed operation may have been the end of a motion

        return self._context.tasks.spawn(finish())

    # --- motions ------------------------------------------------------------------------------------------------------

    def _take(
        self,
        operation: op.Operation,
        stops: int | None,
        by: HostActivity | None,
        patience: float = inf,
        asked: float | None = None,
    ) -> Outcome:
        """Take a motion order and return its outcome. The client ``asked`` at this loop time, after so many ``stops``.

        It waits for the outcome for ``patience`` seconds: a goto is not begun after that.
        """
        reconciler = self._reconciler
        now = self._context.now()
        if reconciler.closed or too_late(self._wanted.value, operation, stops):
            return cancelled()
        if isinstance(operation, op.StopAxis) and self._accepts_only_a_stop(operation.axis):
            self._context.note(
                "the mount is busy calculating and accepts nothing but a full stop: both axes are stopped"
            )
            return reconciler.begin_stop()
        guides = isinstance(operation, op.Move) and at_guide_rate(operation)
        exchange = self._link.typical_rtt if guides else 0.0
        wakes = isinstance(operation, op.Wake) and self._context.driver.asleep  # earlier orders would get no reply
        if isinstance(operation, GOTOS) and by is not None and self._context.site_clock.programs.half:
            self._settings.complete(by.program)
        order = Order(
            next(reconciler.numbers),
            operation,
            by,
            rank=FIRST if wakes else IN_ORDER,
            at=now + exchange if guides else 0.0,
            shortest=exchange / LENGTHENED if guides and not self._context.driver.times_pulses else 0.0,
            since=now if asked is None else asked,
            until=now + patience if isinstance(operation, (*GOTOS, op.Sync)) else inf,
        )
        try:
            return reconciler.order(order)
        except Fault as fault:
            return failed(fault)

    def _accepts_only_a_stop(self, axis: int) -> bool:
        """Whether the mount would ignore the release of an arrow for seconds, in a long operation."""
        wanted = self._wanted.value
        return axis in wanted.by_hand and self._link.occupied and not wanted.waiting_gotos

    # --- reads that the gateway answers itself ------------------------------------------------------------------------

    async def _activity(self, _: op.GetActivity) -> op.Activity:
        """Return what moves by orders of this gateway, the run-on included."""
        wanted, now, parked = self._wanted.value, self._context.now(), self._context.driver.parked
        slews = isinstance(wanted.motion, Slew)
        waiting = [order.operation for order in wanted.pending if not order.follow_up]
        # The last step of a park: the tube has arrived, and tracking is not off yet.
        parks = any(getattr(order.operation, "then", "") == "park" for order in wanted.pending if order.follow_up)
        run_on = self._context.run_on
        silent = wanted.owed and self._context.cache.age(op.Position, now) > SILENT
        return op.Activity(
            goto=slews or bool(wanted.waiting_gotos) or (parks and not parked) or run_on.of_goto,
            by_hand=isinstance(wanted.motion, ByHand) or any(isinstance(one, op.Move | op.MoveAxis) for one in waiting),
            ends=wanted.owed or run_on.value is not None,
            unknown=run_on.unknown or silent,
            pulse=any(pulse.until > now for pulse in wanted.pulses)
            or any(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending),
            parked=parked,
            homed=wanted.homed and not slews,
            short=wanted.short,
        )

    async def _abilities(self, _: op.GetAbilities) -> op.Abilities:
        """Return what the mount can do, by the tables and by its model and version."""
        equatorial = (await self._reader.read(op.GetStatus())).equatorial
        return self._context.driver.can_do(equatorial)

    async def _tube_side(self, _: op.TubeSide) -> str:
        driver = self._context.driver
        reported: str = await self._reader.read(op.PierSide())
        if not driver.german:
            raise Unsupported("Only a German mount has two sides of the pier.")
        if (side := driver.tube_side(reported)) is not None:
            return side
        return reported if self._context.astrometry.place().latitude >= 0.0 else {"E": "W", "W": "E"}[reported]


async def _ended(outcome: Outcome) -> Any:
    """Wait for an outcome without cancelling the order. Raises Fault; Stopped if the order was superseded."""
    try:
        return await result_of(outcome)
    except asyncio.CancelledError:
        if outcome.cancelled():
            raise Stopped from None
        raise
