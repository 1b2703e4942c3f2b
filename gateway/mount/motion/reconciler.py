"""Brings a mount to do what is wanted: the only one that sends what moves it, one operation after the other.

Orders change what is wanted (``apply``), ``next_operation`` names what is to be done, the driver does it, and its
outcome changes what is wanted again. An operation that is not wanted any more is given up between two exchanges. A stop
waits for the exchange on the wire and for nothing else: not for a setting that survives it, which goes on meanwhile.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from itertools import count
from math import inf
from typing import Any

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import ENDS, GOTOS, MOVING, ends_focus, outlives_stop
from gateway.core.shared_work import result_of
from gateway.mount.link.queue import MOTION, SETTING, STOP
from gateway.mount.motion import outcomes
from gateway.mount.motion.apply import apply, does_for, interrupted, stopped, take_back
from gateway.mount.motion.awaited import Awaited, Outcome
from gateway.mount.motion.executor import Executor
from gateway.mount.motion.next_operation import next_moment, next_operation
from gateway.mount.motion.patience import forsaken, may_wait, patient, postponed
from gateway.mount.motion.stopping import Stopping
from gateway.mount.motion.wanted import FIRST, IN_ORDER, RESUMED, Order, Theirs, Wanted
from gateway.mount.safety.rules.dead_man import HostActivity
from gateway.protocols.base.driver import Driver, Schedule

#: What may have begun though its acknowledgement was lost, and would have no end then.
BY_HAND = (op.Move, op.MoveAxis, op.Pulse, op.PulseAxis)
#: Seconds until the focuser is told to stop once more, while its mount does not answer to that.
FOCUS_AGAIN = 1.0


class Reconciler:
    """``wanted`` is replaced here alone. ``follow_ups`` are the driver's own operations, by their type."""

    def __init__(
        self, driver: Driver, executor: Executor, follow_ups: dict[type[Any], Callable[[Any, Any], Any]]
    ) -> None:
        self.wanted = Wanted()
        self._driver, self._executor, self._follow_ups = driver, executor, follow_ups
        self._loop = asyncio.get_running_loop()
        self._numbers = count(1)
        self._awaited = Awaited()
        self._work: asyncio.Task[tuple[op.Operation, Any]] | None = None
        #: The order that is being carried out, and the last one that was admitted, by their numbers.
        self._active = self._admitted = 0
        self._stopping = Stopping(driver, executor, self._rests, self._go_on, self._to_be_ended)
        self._timer: asyncio.TimerHandle | None = None
        self._closed = False

    # --- what is known ----------------------------------------------------------------------------------------------

    @property
    def by_hand(self) -> dict[int, op.Move | op.MoveAxis]:
        """What moves by hand, axis by axis."""
        return self.wanted.by_hand

    @property
    def axes(self) -> set[int]:
        """The axes that move by hand."""
        return set(self.wanted.by_hand)

    @property
    def stops(self) -> int:
        """How many stops there were."""
        return self.wanted.stops

    @property
    def gotos(self) -> int:
        """Grows whenever a goto was asked for, and when it is under way."""
        return self.wanted.gotos + self.wanted.slews

    @property
    def owed(self) -> bool:
        """Whether the mount has a stop to come that it has not acknowledged."""
        return self.wanted.owed

    @property
    def ending(self) -> bool:
        """Whether a stop or a halt is not done yet."""
        return self.wanted.owed or any(isinstance(order.operation, ENDS) for order in self.wanted.pending)

    @property
    def goto_waits(self) -> bool:
        """Whether a goto was asked for that the mount has not acknowledged yet."""
        return bool(self.wanted.waiting_gotos)

    @property
    def waking(self) -> bool:
        """Whether the mount was asked to wake, and has not acknowledged it yet."""
        return any(isinstance(order.operation, op.Wake) for order in self.wanted.pending)

    @property
    def busy(self) -> bool:
        """Whether anything moves, is about to, or is to be ended later: all that a stop would end or put right."""
        coming = any(not outlives_stop(order.operation) for order in self.wanted.pending)
        return self.wanted.owed or coming or self._executor.moving or self._driver.tracking_suspended

    # --- orders -----------------------------------------------------------------------------------------------------

    def begin(
        self, operation: op.Operation, stops: int | None, by: HostActivity | None, patience: float = inf
    ) -> Outcome:
        """Take an order -> its outcome; from now on it counts as asked for. ``stops``: their count when it was.

        Whoever asked waits for the outcome for ``patience`` seconds: a goto is not begun after that.
        """
        if self._closed or self._too_late(operation, stops):
            return self._awaited.too_late()
        if self._only_a_stop_is_heard(operation):
            self._executor.note(
                "the mount is busy calculating and accepts nothing but a full stop: both axes are stopped"
            )
            return self.begin_stop()
        wakes = isinstance(operation, op.Wake) and self._driver.asleep  # what is before it would not be heard
        now = self._loop.time()
        order = Order(
            next(self._numbers),
            operation,
            by,
            rank=FIRST if wakes else IN_ORDER,
            since=now,
            until=now + patience if isinstance(operation, (*GOTOS, op.Sync)) else inf,
        )
        before = self.wanted
        try:
            after = apply(before, order, now, self._executor.slewing)
        except Fault as fault:
            return self._awaited.refused(fault)
        if after.stops != before.stops:
            return self.begin_stop()
        asked = any(one.number == order.number for one in after.pending)
        if asked:
            self._awaited.expect(order.number)
        self._want(after)
        same = order if asked else does_for(after, operation)
        outcome = self._awaited.of(same.number) if same is not None else None
        self._go_on()
        return outcome if outcome is not None else self._awaited.done()

    def impossible(self, operation: op.Operation) -> Fault | None:
        """Why the mount would refuse this, where that is known: nothing waits that may change how it stands."""
        same = all(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in self.wanted.pending)
        return self._driver.impossible(operation) if same and not self.wanted.owed else None

    def _only_a_stop_is_heard(self, operation: op.Operation) -> bool:
        """Whether an arrow is released that the mount would go on with for seconds."""
        ends = isinstance(operation, op.Halt) and operation.axis in self.wanted.by_hand
        return ends and self._executor.deaf and not self.wanted.waiting_gotos

    def _too_late(self, operation: op.Operation, stops: int | None) -> bool:
        """Whether a stop has come since it was asked for."""
        lasts = isinstance(operation, op.Halt) or outlives_stop(operation)
        return stops is not None and stops != self.wanted.stops and not lasts

    def again(self, operation: op.Operation) -> bool:
        """Take back what a halt ends -> whether an equal one that is not done does for this one, too."""
        if self._executor.slewing or self.wanted.waiting_gotos:
            return False
        self._want(take_back(self.wanted, operation))
        same = does_for(self.wanted, operation)
        if same is not None:
            self._want(interrupted(self.wanted, same))
        self._go_on()
        return same is not None

    def plan(self, later: Schedule) -> None:
        """Have a follow-up performed after some seconds; the same one planned again replaces the first."""
        order = Order(
            next(self._numbers),
            later.operation,
            rank=FIRST if later.urgent else IN_ORDER,
            at=self._loop.time() + later.seconds,
            follow_up=True,
            urgent=later.urgent,
            heard=later.heard,
        )
        others = tuple(
            one
            for one in self.wanted.pending
            if not (one.follow_up and one.operation == later.operation and one.number != self.wanted.active)
        )
        self._want(replace(self.wanted, pending=(*others, order)))
        self._go_on()

    async def woken(self) -> None:
        """Wait for what is to wake the mount, if anything is. Not for motions: it may wait behind them."""
        waking = [
            outcome
            for order in self.wanted.pending
            if isinstance(order.operation, op.Wake) and (outcome := self._awaited.of(order.number)) is not None
        ]
        if waking:
            await asyncio.wait(waking)

    async def settle(self) -> None:
        """Wait for what outlives a stop: hand controls may need to be told twice to track again."""
        while self._executor.served and self.wanted.pending:
            await asyncio.sleep(0.05)

    def arrived(self) -> None:
        """The goto under way is seen to be over."""
        self._want(outcomes.arrived(self.wanted))

    # --- stops ------------------------------------------------------------------------------------------------------

    def no_more(self) -> None:
        """What was asked for before now is not begun any more."""
        self.wanted = replace(self.wanted, stops=self.wanted.stops + 1)

    def owe_stop(self) -> None:
        """Something that an earlier run of the gateway set moving is to stand still."""
        self.wanted = replace(self.wanted, owed=True)

    def begin_stop(self) -> asyncio.Task[None]:
        """End every motion: what runs or waits dies now, and the stop goes to the line first.

        It is owed until the mount has acknowledged it: a lost answer or a lost line does not cancel it.
        """
        work = self._work
        self._want(stopped(self.wanted))
        return self._stopping.send(work if work is not None and work.cancelling() else None)

    def send_stop(self) -> asyncio.Task[None]:
        """Send a stop once more, to end what moves. It ends nothing that was asked for meanwhile."""
        return self._stopping.send(None)

    async def stop(self) -> None:
        """End every motion, and wait until the mount has acknowledged it. Raises Fault."""
        await result_of(self.begin_stop())

    def _to_be_ended(self) -> object:
        """The motion that a stop is owed for; None where none is, or something else is about to be set moving."""
        coming = any(isinstance(order.operation, MOVING) for order in self.wanted.pending)
        return None if self._closed or coming or not self.wanted.owed else self.wanted.motion

    def _rests(self) -> None:
        self._want(outcomes.at_rest(self.wanted))

    # --- carrying out -----------------------------------------------------------------------------------------------

    def _want(self, wanted: Wanted) -> None:
        """Replace what is wanted; whoever asked for what is not any more is told, and work on it is given up."""
        before, self.wanted = self.wanted, wanted
        if before.pending is not wanted.pending:
            left = {order.number for order in wanted.pending}
            self._awaited.not_wanted(order for order in before.pending if order.number not in left)
            if self._work is not None and (wanted.active != self._active or self._active not in left):
                self._work.cancel()
        self._executor.wanted_changed()

    def _go_on(self) -> None:
        """Begin what is due, unless something is being done; else look again when something is due."""
        if self._closed or self._work is not None or self._stopping.under_way:
            return
        order = next_operation(self.wanted, self._loop.time())
        while order is not None and self._executor.deaf and patient(order):
            self._postpone(order)
            order = next_operation(self.wanted, self._loop.time())
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if order is not None:
            self.wanted = replace(self.wanted, active=order.number)
            self._active = order.number
            self._work = self._loop.create_task(self._carry_out(order))
            self._work.add_done_callback(partial(self._has_ended, order))
        elif (moment := next_moment(self.wanted)) is not None:
            self._timer = self._loop.call_at(moment, self._go_on)

    def _postpone(self, order: Order) -> None:
        """The mount does not hear now: look again a little later, while somebody wants it and it is not too late."""
        now = self._loop.time()
        if may_wait(order, now) and not forsaken(order):
            self._want(postponed(self.wanted, order, now))
            return
        if not forsaken(order) and (outcome := self._awaited.take(order.number)) is not None:
            outcome.set_exception(Busy())
        self._want(outcomes.refused(self.wanted, order))

    async def _carry_out(self, order: Order) -> tuple[op.Operation, Any]:
        """-> the operation as it was admitted, and its answer."""
        executor, operation = self._executor, order.operation
        arrow = isinstance(operation, op.Move | op.MoveAxis) and order.rank == IN_ORDER
        since = order.since if arrow else None
        if order.follow_up:
            special = self._follow_ups.get(type(operation))
            steps = special(self._driver, operation) if special else self._driver.perform(operation)
            return operation, await executor.drive(steps, STOP if order.urgent else MOTION)
        operation = await self._admitted_in_time(order)
        self._admitted = order.number
        if isinstance(operation, MOVING):
            await executor.before_motion()
        elif isinstance(operation, op.Sleep) and (executor.moving or self._driver.tracking_suspended):
            await self.stop()
        rank = MOTION if not isinstance(operation, ENDS) else SETTING if order.hammered else STOP
        return operation, await executor.drive(self._driver.perform(operation), rank, since)

    async def _admitted_in_time(self, order: Order) -> op.Operation:
        """-> the operation as it was admitted. Raises Fault, while whoever asked for it can still be told."""
        try:
            async with asyncio.timeout_at(order.until if order.until < inf else None):
                return await self._executor.admit(order.operation)
        except TimeoutError:
            raise Busy from None

    def _has_ended(self, order: Order, work: asyncio.Task[tuple[op.Operation, Any]]) -> None:
        """An operation was carried out, failed, or was given up."""
        self._work, self._active = None, 0
        order = next((one for one in self.wanted.pending if one.number == order.number), replace(order, rank=-1))
        outcome = self._awaited.take(order.number)
        if work.cancelled():
            if order.rank == RESUMED and not self._closed:
                self._was_interrupted(order, outcome)
            elif outcome is not None:
                outcome.cancel()
                self._want(outcomes.over(self.wanted, order))
        elif (error := work.exception()) is not None:
            self._has_failed(order, error, outcome)
        elif order.rank >= 0:
            operation, value = work.result()
            if outcome is not None:
                outcome.set_result(value)
            self._has_been_taken(order, operation, value)
        self._go_on()

    def _was_interrupted(self, order: Order, outcome: Outcome | None) -> None:
        """It is begun anew behind what goes first; perhaps the mount has heard of it already."""
        self._awaited.keep(order.number, outcome)
        if isinstance(order.operation, op.Move | op.MoveAxis):
            self._moves(order, order.operation)

    def _has_failed(self, order: Order, error: BaseException, outcome: Outcome | None) -> None:
        now = self._loop.time()
        if (
            isinstance(error, Busy)
            and order.rank >= 0
            and patient(order)
            and may_wait(order, now)
            and self._executor.was_deaf(order.since)
        ):  # it began to calculate while this was prepared
            self._awaited.keep(order.number, outcome)
            self._want(postponed(self.wanted, order, now))
            return
        if outcome is not None:
            outcome.set_exception(error)
        if order.rank < 0:  # nobody wants it any more
            return
        self._want(outcomes.refused(self.wanted, order))
        unheard = isinstance(order.operation, BY_HAND) and isinstance(error, NoAnswer) and error.sent
        half_begun = unheard or (order.rank == RESUMED and isinstance(order.operation, MOVING))
        half_begun = half_begun or self._has_cut_in(order)
        not_ended = isinstance(order.operation, ENDS) and not (self._driver.asleep and not order.follow_up)
        if ends_focus(order.operation) and isinstance(error, NoAnswer | Busy) and not self._driver.asleep:
            self._end_focus_again(order)
        elif order.follow_up:
            self._executor.note(f"{type(order.operation).__name__}: {error}")
        if (not_ended or half_begun) and isinstance(error, Fault):  # whatever should have ended, or may move, must end
            self.begin_stop()

    def _has_cut_in(self, order: Order) -> bool:
        """Whether a goto that came to grief was to end a motion before: perhaps it has, and tracking is off still."""
        sent = isinstance(order.operation, GOTOS) and self._admitted == order.number
        return sent and (bool(self.wanted.by_hand) or self._driver.tracking_suspended)

    def _end_focus_again(self, order: Order) -> None:
        """The focuser was not heard to stop: no position shows it, and no stop of the mount does it."""
        if not any(isinstance(one.operation, op.Focus) for one in self.wanted.pending):
            self.plan(Schedule(FOCUS_AGAIN, order.operation))

    def _has_been_taken(self, order: Order, operation: op.Operation, value: Any) -> None:
        """The mount has acknowledged it."""
        now = self._loop.time()
        self._want(outcomes.done(self.wanted, order, now))
        if isinstance(value, op.Pulsed):
            self._want(outcomes.pulsed(self.wanted, order, value, next(self._numbers), now))
            if not value.ends:
                self._executor.expect_end(now + value.seconds)
        if order.follow_up and not ends_focus(operation):
            self._executor.followed_up()
        else:
            self._moves(order, operation)

    def _moves(self, order: Order, operation: op.Operation) -> None:
        before = self.wanted
        self._executor.begins(operation)
        speed = self._driver.speed(operation.rate) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        self._want(outcomes.taken(before, order, operation, self._loop.time(), speed))
        self._executor.taken(operation, before)

    async def go_on_alone(self) -> None:
        """One axis was ended: what still moves must be allowed without it."""
        try:
            await self._executor.still_allowed()
        except Fault as fault:
            self._executor.note(f"stopped: {fault}")
            self.begin_stop()

    def close(self) -> None:
        """Forget everything that was planned or waits."""
        self._closed = True
        self._stopping.close()
        if self._timer is not None:
            self._timer.cancel()
        self._want(replace(self.wanted, pending=(), active=0, motion=Theirs()))
