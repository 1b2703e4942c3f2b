"""Carries out one order: admission, the announcement to the watchdog, the driver, and the consequences.

The consequences are what is known without a request once the mount has acknowledged an order, and what has to be
watched from then on.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from math import inf
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import ENDS, GOTOS, MOVING
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate
from gateway.mount.link.queue import MAX_START_DELAY, MOTION, SETTING, STOP
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.outcomes import Done, PulseEnded
from gateway.mount.motion.taps import LONGEST_WAIT, TapDropped
from gateway.mount.motion.wanted import IN_ORDER, Order, Slew
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.motions import Admission
from gateway.mount.safety.watch import LimitWatch
from gateway.protocols.base.driver import FollowUps

#: Is awaited before a motion begins.
Announce = Callable[[], Awaitable[None]]
#: By which part a guide pulse must have been too long to be worth a line in the log.
TOLD_FROM = 0.1


class OrderRunner:
    """``admitted`` is the number of the last order that was admitted, ``sent`` the loop time of the last command of
    the last one that was carried out.

    ``announcers`` are awaited in their order before anything is sent that sets the mount moving, so that the watchdog
    and the marker on disk know of the motion should this process be killed.
    """

    def __init__(
        self,
        context: Context,
        follow_ups: FollowUps,
        runner: DriverRunner,
        admission: Admission,
        announcers: Sequence[Announce],
    ) -> None:
        self._context, self._driver, self._movement = context, context.driver, context.movement
        self._follow_ups, self._runner, self._admission = follow_ups, runner, admission
        self._announcers = announcers
        self.admitted, self.sent = 0, 0.0

    async def carry_out(self, order: Order, stop: Callable[[], Awaitable[None]]) -> tuple[op.Operation, Any]:
        """Carry out an order; return the operation as admitted, and its answer. ``stop`` ends motion. Raises Fault."""
        operation = order.operation
        if order.follow_up:
            began, special = self._context.now(), self._follow_ups.get(type(operation))
            steps = special(self._driver, operation) if special else self._driver.perform(operation)
            answer = await self._runner.drive(steps, STOP if order.urgent else MOTION)
            if isinstance(operation, op.StopAxis):
                answer = self._pulse_ended(operation.axis, began)
            return operation, answer
        arrow = isinstance(operation, op.Move | op.MoveAxis) and order.rank == IN_ORDER
        since = order.since if arrow else None
        self._check_tap(order.number, LONGEST_WAIT)
        operation = await self._in_time(order)
        self.admitted = order.number
        if isinstance(operation, MOVING):
            for announce in self._announcers:
                await announce()
        elif isinstance(operation, op.Hibernate) and (self._movement.anything or self._driver.tracking_suspended):
            await stop()
        priority = MOTION if not isinstance(operation, ENDS) else SETTING if order.keeps_repeating else STOP
        check = partial(self._check_tap, order.number, MAX_START_DELAY)
        answer = await self._runner.drive(self._driver.perform(operation), priority, since, check)
        self.sent = self._driver.sent_at
        if any(one.number == order.number and one.then_stop for one in self._context.wanted.value.pending):
            await self._runner.perform(op.AbortMotion(), STOP)
            return op.AbortMotion(), None
        if isinstance(operation, op.Move) and isinstance(answer, op.Pulsed):  # a tap at guide rate
            return op.Pulse(operation.direction, operation.ms or 0), answer
        return operation, answer

    def _check_tap(self, number: int, longest: float) -> None:
        """Raises TapDropped if the order is an arrow that was released already, and was pressed too long ago."""
        for order in self._context.wanted.value.pending:
            if order.number == number and order.held is not None and self._context.now() - order.since > longest:
                raise TapDropped

    def _pulse_ended(self, axis: int, began: float) -> PulseEnded:
        """Return how late a guide pulse was ended, and log it if that matters. The end ``began`` at this loop time."""
        pulse = next((one for one in self._context.wanted.value.pulses if one.axis == axis), None)
        late = 0.0 if pulse is None else self._runner.began_at - pulse.until
        if pulse is not None and pulse.operation is not None and late > TOLD_FROM * pulse.operation.ms / 1000.0:
            asleep = max(0.0, began - pulse.until)
            why = (
                f"this computer did not run the gateway for {asleep:.2f} s"
                if asleep > late / 2
                else "the line was busy"
            )
            self._context.note(
                f"a guide pulse of {pulse.operation.ms / 1000.0:g} s was {late:.2f} s too long: {why}. The next pulse "
                "in this direction is shortened by that"
            )
        return PulseEnded(axis, late)

    async def check_other_axis(self, stop: Callable[[], object]) -> None:
        """After the end of one axis, check that the other may move on alone; if not, call ``stop``."""
        try:
            await self._admission.still_allowed()
        except Fault as fault:
            self._context.note(f"stopped: {fault}")
            stop()

    async def _in_time(self, order: Order) -> op.Operation:
        """Return the operation as it was admitted. Raises Fault, Busy at the latest when the client stops waiting."""
        try:
            async with asyncio.timeout_at(order.until if order.until < inf else None):
                return await self._admission.admit(order.operation, order.by)
        except TimeoutError:
            raise Busy from None


class Consequences:
    """Updates the cache and the watches once the mount has acknowledged an order. Listens to the reconciler."""

    def __init__(
        self, context: Context, gate: HibernationGate, reader: Reader, watch: LimitWatch, ends: EndWatch
    ) -> None:
        self._context, self._now, self._cache = context, context.now, context.cache
        self._gate, self._reader, self._watch, self._ends = gate, reader, watch, ends

    def stop_sent(self, _: None) -> None:
        self._ends.sent((1, 2), self._watch.fastest)

    def at_rest(self, _: None) -> None:
        """Handle a stop that the mount has acknowledged: it may run on."""
        slewing, by_others = self._context.movement.slewing, self._watch.moved_by_others
        self._context.run_on.ended(goto=slewing, by_others=by_others)
        self._reader.ordered(op.AbortMotion(), self._watch.moved_by_others)
        self._watch.motion_ended()
        self._cache.put(op.Slewing, False, self._now())

    def begins(self, operation: op.Operation) -> None:
        """Handle an operation that the mount has acknowledged, before ``Wanted`` shows it."""
        self._reader.ordered(operation, isinstance(operation, ENDS) and self._watch.moved_by_others)
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._watch.began(operation)

    def done(self, done: Done) -> None:
        """Handle an operation that the mount has acknowledged, after ``Wanted`` shows it."""
        operation, cache = done.operation, self._cache
        run_on = self._context.run_on
        if run_on.value is not None and isinstance(operation, (*GOTOS, op.Move, op.MoveAxis)):
            run_on.forget()
        if isinstance(operation, GOTOS):
            self._ends.superseded((1, 2))
            self._note_replaced(done.before.motion, self._context.wanted.value.motion)
            cache.put(op.Slewing, True, self._now())
            cache.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            self._ends.superseded((operation.axis,))
            cache.look_again(op.Position)  # no new position, but it must be polled more often from now on
        elif isinstance(operation, op.StopAxis):
            self._halted(operation.axis, done.before.by_hand.get(operation.axis))
        elif isinstance(operation, op.AbortMotion):  # of an arrow that was stopped at once
            self.stop_sent(None)
            self.at_rest(None)
        elif isinstance(operation, op.AbortSlew):
            if self._context.movement.slewing:
                self._context.run_on.ended(goto=True)
            cache.put(op.Slewing, False, self._now())
        elif isinstance(operation, op.Sync):
            self._has_synced()
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Hibernate | op.Wake):
            cache.forget(op.GetStatus)
            if isinstance(operation, op.Hibernate):
                self.at_rest(None)
                self._context.run_on.forget()
                self._gate.hibernation_began()

    def _note_replaced(self, before: object, after: object) -> None:
        """Log that a goto replaces another program's: the last one wins, and the other program is not told."""
        old, new = (motion.by if isinstance(motion, Slew) else None for motion in (before, after))
        if old is not None and new is not None and old.program != new.program:
            self._context.note(f"the goto of {new.who} replaces that of another program, {old.who}")

    def _halted(self, axis: int, moved: op.Move | op.MoveAxis | None) -> None:
        if moved is not None:
            self._ends.sent((axis,), self._context.speed(moved))
            self._context.run_on.ended(goto=False)
        self._watch.axis_stopped()
        if not self._context.wanted.by_hand:
            self._watch.motion_ended()

    def _has_synced(self) -> None:
        """Count the sync in the sum of all, and forget the positions: the mount reports others from now on."""
        self._context.synced.carried_out()
        status = self._cache.value(op.GetStatus)
        aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
        self._cache.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
