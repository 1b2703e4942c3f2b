"""Makes the mount do what is wanted: the only part that sends motion commands, one order after the other.

An order changes ``Wanted`` when it arrives (``accept``). The loop then carries out one due order after the other:
it has the rules admit the order, announces a motion before its first byte, has the driver carry it out, and adds the
outcome to ``Wanted``. An order that is no longer wanted is cancelled between two exchanges; an order that a
halt has interrupted begins again after it. A stop is no order (``stopping.py``): it does not queue, cancels the motions
that run or wait, and waits only for the exchange on the wire. Only this part replaces ``Wanted``.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from itertools import count
from math import inf
from typing import Any

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core import waiting
from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import END_ORDERS, GOTOS, MOVERS, stops_focuser, survives_abort
from gateway.core.signals import Signal
from gateway.core.waiting import Outcome, result_of
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import MAX_START_DELAY, MOTION, SETTING, STOP
from gateway.mount.motion import changes, taps
from gateway.mount.motion.consequences import Consequences
from gateway.mount.motion.stopping import StopSender
from gateway.mount.motion.wanted import FIRST_RANK, USUAL_RANK, Arrow, Halt, NoOrderedMove, Order, Tap, Wanted
from gateway.mount.presence import HostActivity
from gateway.mount.safety.admission.motions import MotionAdmission
from gateway.protocols.base.driver import FollowUps, Schedule

#: An asynchronous callback before a motion begins.
Announce = Callable[[], Awaitable[None]]
#: Seconds between two attempts to halt a focuser whose mount does not reply.
FOCUS_RETRY = 1.0


class Reconciler:
    """Carries out motion orders. Before a command that sets the mount moving, it awaits the ``announcers`` in turn, so
    that the watchdog and the marker on disk know of the motion if this process is killed.

    Signals: ``acknowledged`` with an operation that the mount has acknowledged; ``client_motion_began`` if its motion
    needs an active client; ``stop_acknowledged``; ``saved_state_changed`` if the state file may be outdated.
    """

    def __init__(
        self,
        context: Context,
        follow_up_handlers: FollowUps,
        runner: DriverRunner,
        admission: MotionAdmission,
        consequences: Consequences,
        announcers: Sequence[Announce],
    ) -> None:
        self._context, self._driver, self._link = context, context.driver, context.link
        self._wanted_state, self._movement = context.wanted, context.movement
        self._follow_up_handlers, self._runner, self._announcers = follow_up_handlers, runner, announcers
        self._admission, self._consequences = admission, consequences
        self._loop = asyncio.get_running_loop()
        self.acknowledged: Signal[op.Operation] = Signal()
        self.client_motion_began: Signal[None] = Signal()
        self.saved_state_changed: Signal[None] = Signal()
        self._order_ids = count(1)
        #: By order number, the future that the client of the order may wait for.
        self._outcomes: dict[int, Outcome] = {}
        #: The task of the loop while it runs, and whether it has begun: before that it could not catch a cancellation.
        self._loop_task: asyncio.Task[None] | None = None
        self._loop_has_begun = False
        #: The number of the order that is being carried out, and whether it was cancelled.
        self._active_number, self._active_cancelled = 0, False
        #: The number of the last order that was admitted, and when the last command of an order was sent.
        self._last_admitted, self._last_sent_at = 0, 0.0
        self._stopping = StopSender(context, runner)
        self.stop_acknowledged = self._stopping.acknowledged
        self._stopping.commands_sent.connect(consequences.on_stop_sent)
        self.stop_acknowledged.connect(self._on_stop_acknowledged)
        self._stopping.attempt_ended.connect(lambda _: self._start_next())
        runner.scheduled.connect(self.plan)
        runner.driver_failed.connect(self.stop_after_defect)
        self._timer: asyncio.TimerHandle | None = None
        self.closed = False

    @property
    def wanted(self) -> Wanted:
        return self._wanted_state.value

    @property
    def busy(self) -> bool:
        """Whether an ordered motion is under way or pending, a stop is not acknowledged, or tracking is suspended."""
        coming = any(not survives_abort(order.operation) for order in self.wanted.pending)
        return self.wanted.stop_owed or coming or self._movement.ordered_by_client or self._driver.tracking_suspended

    # --- orders -----------------------------------------------------------------------------------------------------

    def accept(
        self,
        operation: op.Operation,
        stop_count: int | None,
        activity: HostActivity | None,
        max_delay: float = inf,
        arrived_at: float | None = None,
    ) -> Outcome:
        """Take a motion order and return the future of its outcome. ``arrived_at`` is the loop time of its arrival,
        ``stop_count`` the number of stops before it. After ``max_delay`` seconds no goto or sync is begun.
        """
        now, wanted = self._loop.time(), self.wanted
        if self.closed or changes.was_stopped_since(wanted, operation, stop_count):
            return waiting.cancelled_outcome()
        releases = isinstance(operation, op.StopAxis) and operation.axis in wanted.hand_moves
        if releases and self._link.occupied and not wanted.waiting_gotos:  # the mount would ignore it for seconds
            self._context.note(
                "the mount is busy calculating and accepts nothing but a full stop: both axes are stopped"
            )
            return self.begin_stop()
        guides = isinstance(operation, op.Move) and taps.is_at_guide_rate(operation)
        exchange = self._link.times.typical_rtt if guides else 0.0
        wakes = isinstance(operation, op.Wake) and self._driver.asleep  # earlier orders would get no reply
        kind = Halt if isinstance(operation, END_ORDERS) else Order
        order = kind(
            next(self._order_ids),
            operation,
            activity,
            rank=FIRST_RANK if wakes else USUAL_RANK,
            due_from=now + exchange if guides else 0.0,
            arrow=Arrow(min_time=exchange / taps.MAX_TAP_FACTOR if guides and not self._driver.times_pulses else 0.0),
            came_at=now if arrived_at is None else arrived_at,
            deadline=now + max_delay if isinstance(operation, (*GOTOS, op.Sync)) else inf,
        )
        try:
            return self._accept(order)
        except Fault as fault:
            return waiting.failed_outcome(fault)

    def _accept(self, order: Order) -> Outcome:
        """Return the outcome of an order, or that of an equal pending halt. Raises Fault if it is refused."""
        after = changes.apply_order(self.wanted, order, self._loop.time(), self._movement.slewing)
        dropped = taps.dropped_press(self.wanted, after, order) if isinstance(order.operation, op.StopAxis) else None
        if dropped is not None and (outcome := self._outcomes.pop(dropped.number, None)) is not None:
            outcome.set_exception(taps.TapDropped())
        if after.stop_count != self.wanted.stop_count:
            return self.begin_stop()
        queued = any(other.number == order.number for other in after.pending)
        if queued:
            self._outcomes[order.number] = waiting.new_outcome()
        self._update(after)
        same = order if queued else changes.equal_pending_halt(after, order.operation)
        outcome = self._outcomes.get(same.number) if same is not None else None
        self._start_next()
        return outcome if outcome is not None else waiting.finished_outcome()

    def merge_halt(self, operation: op.Operation) -> bool:
        """Remove the pending guide pulses that a halt ends; return whether an equal pending halt suffices. While the
        mount slews, or a goto or a motion by hand is pending, remove nothing and return False.
        """
        begins = any(isinstance(order.operation, (*GOTOS, op.Move, op.MoveAxis)) for order in self.wanted.pending)
        if begins or self._movement.slewing:
            return False
        wanted = changes.without_superseded_orders(self.wanted, operation)
        same = changes.equal_pending_halt(wanted, operation)
        self.update(wanted if same is None else changes.interrupt_order(wanted, same))
        return same is not None

    def treat_as_release(self, activity: HostActivity) -> bool:
        """Treat a full stop that only releases an arrow as the end of a tap; False if the stop must be sent now."""
        after = None if self._movement.slewing else taps.after_stop_as_release(self.wanted, activity, self._loop.time())
        if after is not None:
            self.update(after)
        return after is not None

    def outcomes_of_kind(self, kind: type[op.Operation]) -> list[Outcome]:
        numbers = (order.number for order in self.wanted.pending if isinstance(order.operation, kind))
        return [outcome for number in numbers if (outcome := self._outcomes.get(number)) is not None]

    def update(self, wanted: Wanted) -> None:
        """Replace the ``Wanted`` without an order, because of an observation by another part."""
        self._update(wanted)
        self._start_next()

    def plan(self, schedule: Schedule) -> None:
        """Order a follow-up of the driver for later; it replaces an equal pending follow-up."""
        self.update(changes.add_follow_up(self.wanted, schedule, next(self._order_ids), self._loop.time()))

    # --- stops ------------------------------------------------------------------------------------------------------

    def begin_stop(self, reason: str | None = None) -> asyncio.Task[None]:
        """End every motion: cancel all motions that run or wait, and send the stop before everything else. The stop is
        repeated until the mount has acknowledged it, even after a lost line. ``reason``: see ``after_stop``.
        """
        self._update(changes.after_stop(self.wanted, reason))
        return self._stopping.send(self._loop_task if self._active_cancelled else None)

    async def stop(self, reason: str | None = None) -> None:
        """End every motion, and wait until the mount has acknowledged it. Raises Fault."""
        await result_of(self.begin_stop(reason))

    def stop_again(self, axes: frozenset[int]) -> None:
        """Stop these axes once more, because positions show that they still move. Other orders continue."""
        if len(axes) > 1:
            self._stopping.send(None)
        else:
            self._context.tasks.spawn(self._stopping.resend_halt(*axes))

    def stop_after_defect(self, _: None = None) -> None:
        """Stop the mount: it is unknown what moves now, and what failed may have been the end of a motion."""
        if self.busy:
            self.begin_stop()

    def _on_stop_acknowledged(self, _: None) -> None:
        """Note that the mount has acknowledged a stop: the ordered motion is over, and its run-on begins."""
        self._update(changes.after_acknowledged_stop(self.wanted))
        self._consequences.on_stop_acknowledged()

    # --- what is wanted ---------------------------------------------------------------------------------------------

    def _store_wanted(self, wanted: Wanted) -> None:
        self._wanted_state.value = wanted
        self._wanted_state.changed.emit(wanted)

    def _update(self, wanted: Wanted) -> None:
        """Replace the ``Wanted``, settle the outcomes of orders that have left it, and cancel the work on them."""
        before = self.wanted
        self._store_wanted(wanted)
        for tap in wanted.taps:
            if tap not in before.taps:
                self._loop.call_at(tap.ends_at, self._end_tap, tap)
                self._link.queue.expect_urgent(tap.ends_at)
        if before.pending is not wanted.pending:
            left = {order.number for order in wanted.pending}
            for order in before.pending:
                if order.number not in left and (outcome := self._outcomes.pop(order.number, None)) is not None:
                    outcome.set_result(None) if taps.was_fulfilled_otherwise(order, wanted) else outcome.cancel()
            over = wanted.active != self._active_number or self._active_number not in left
            if self._active_number and over and not self._active_cancelled:
                self._active_cancelled = True
                if self._loop_task is not None and self._loop_has_begun:
                    self._loop_task.cancel()

    def _end_tap(self, tap: Tap) -> None:
        """End the motion of an arrow that was released a while ago, unless something else has ended it."""
        if tap in self.wanted.taps and not self.closed:
            self._accept(
                Halt(next(self._order_ids), op.StopAxis(tap.axis), tap.client, came_at=tap.ends_at, ends_tap=True)
            )

    # --- the loop ---------------------------------------------------------------------------------------------------

    def _start_next(self) -> None:
        """Start the loop if it does not run and an order is due."""
        if self._loop_task is None and (order := self._take_next()) is not None:
            self._loop_has_begun, self._loop_task = False, self._loop.create_task(self._carry_out_all(order))

    def _take_next(self) -> Order | None:
        """Take the order that is due, unless a stop is being sent; if none is due, set a timer."""
        if self.closed or self._stopping.task is not None:
            return None
        order = self.wanted.next_order(self._loop.time()) if self.wanted.pending else None
        while order is not None and self._postpone_if_needed(order):
            order = self.wanted.next_order(self._loop.time())
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if order is not None:
            self._store_wanted(replace(self.wanted, active=order.number))
            self._active_number, self._active_cancelled = order.number, False
        elif self.wanted.pending and (moment := self.wanted.next_due_time()) is not None:
            self._timer = self._loop.call_at(moment, self._start_next)
        return order

    async def _carry_out_all(self, first: Order) -> None:
        """Carry out one order after the other until none is due."""
        order: Order | None = first
        task = asyncio.current_task()
        assert task is not None
        self._loop_has_begun = True
        try:
            while order is not None:
                operation, value, error = order.operation, None, None
                try:
                    if not self._active_cancelled:
                        operation, value = await self._carry_out(order)
                except asyncio.CancelledError:
                    if not self._active_cancelled:
                        raise
                    task.uncancel()  # the order was cancelled, not the loop
                except Exception as fault:
                    error = fault
                if task.cancelling():  # cancelled in its last step: do not cancel the next order, too
                    with contextlib.suppress(asyncio.CancelledError):
                        await asyncio.sleep(0)
                    task.uncancel()
                given_up, self._active_number, self._active_cancelled = self._active_cancelled, 0, False
                pending = next((other for other in self.wanted.pending if other.number == order.number), None)
                order = pending or order
                if error is None and not given_up:
                    self._on_success(order, operation, value)
                elif error is not None and not given_up:
                    self._on_failure(order, error)
                elif pending is not None and not self.closed and isinstance(order.operation, op.Move | op.MoveAxis):
                    self._on_acknowledged(order, order.operation)  # it was interrupted, and may have begun already
                order = self._take_next()
        finally:
            self._loop_task = None

    def _postpone_if_needed(self, order: Order) -> bool:
        """Postpone an order that cannot be sent now, or refuse it if it waited too long. False: it can be sent now."""
        now = self._loop.time()
        wait = order.needed_wait(now, self._link.occupied, self._context.incoming_settings)
        if wait is not None and order.may_wait(now, wait.max_wait) and not order.client_disconnected:
            self._update(self.wanted.postpone(order, now))
        elif wait is not None:
            if not order.client_disconnected and (outcome := self._outcomes.pop(order.number, None)) is not None:
                outcome.set_exception(wait.refusal or Busy())
            self._update(changes.after_failure(self.wanted, order))
        return wait is not None

    async def _carry_out(self, order: Order) -> tuple[op.Operation, Any]:
        """Admit, announce and drive an order; return the operation as admitted, and its answer. Raises Fault."""
        if order.follow_up:
            return order.operation, await self._carry_out_follow_up(order)
        arrow = isinstance(order.operation, op.Move | op.MoveAxis) and order.rank == USUAL_RANK
        self._check_tap(order.number, taps.MAX_TAP_WAIT)
        try:
            async with asyncio.timeout_at(order.deadline if order.deadline < inf else None):
                operation = await self._admission.admit(order.operation, order.client)
        except TimeoutError:  # the client has stopped waiting
            raise Busy from None
        self._last_admitted = order.number
        if isinstance(operation, MOVERS):
            for announce in self._announcers:
                await announce()
        elif isinstance(operation, op.Hibernate) and (self._movement.any_motion or self._driver.tracking_suspended):
            await self.stop()
        priority = MOTION if not isinstance(order, Halt) else SETTING if order.keeps_repeating else STOP
        check = partial(self._check_tap, order.number, MAX_START_DELAY)
        steps = self._driver.perform(operation)
        answer = await self._runner.drive(steps, priority, order.came_at if arrow else None, check)
        self._last_sent_at = self._driver.sent_at
        if any(other.number == order.number and other.arrow.then_stop for other in self.wanted.pending):
            await self._runner.perform(op.AbortMotion(), STOP)
            return op.AbortMotion(), None
        if isinstance(operation, op.Move) and isinstance(answer, op.Pulsed):  # a tap at guide rate
            return op.Pulse(operation.direction, operation.ms or 0), answer
        return operation, answer

    def _check_tap(self, order_number: int, max_age: float) -> None:
        """Raises TapDropped if the order is an arrow that was pressed over ``max_age`` seconds ago and is released."""
        for order in self.wanted.pending:
            late = order.held_for is not None and self._loop.time() - order.came_at > max_age
            if late and order.number == order_number:
                raise taps.TapDropped

    async def _carry_out_follow_up(self, order: Order) -> Any:
        """Carry out an order of the gateway itself, which needs no admission. Raises Fault."""
        operation, began = order.operation, self._loop.time()
        special = self._follow_up_handlers.get(type(operation))
        steps = special(self._driver, operation) if special else self._driver.perform(operation)
        answer = await self._runner.drive(steps, STOP if order.urgent else MOTION)
        if isinstance(operation, op.StopAxis):
            self._consequences.log_pulse_excess(operation.axis, began, self._runner.first_sent_at)
        return answer

    # --- outcomes ---------------------------------------------------------------------------------------------------

    def _on_failure(self, order: Order, error: Exception) -> None:
        now, busy = self._loop.time(), isinstance(error, Busy) and order.can_be_postponed
        if busy and order.may_wait(now) and self._link.was_busy_after(order.came_at):
            self._update(self.wanted.postpone(order, now))  # the mount began a long operation during the preparation
            return
        if (outcome := self._outcomes.pop(order.number, None)) is not None:
            outcome.set_exception(error)
        self._update(changes.after_failure(self.wanted, order))
        sent = isinstance(order.operation, GOTOS) and self._last_admitted == order.number
        # The goto may have ended the motion before it, or left tracking suspended.
        interrupts = sent and (bool(self.wanted.hand_moves) or self._driver.tracking_suspended)
        half_begun = changes.may_have_begun(order, error) or interrupts
        not_ended = isinstance(order.operation, END_ORDERS) and not (self._driver.asleep and not order.follow_up)
        if stops_focuser(order.operation) and isinstance(error, NoAnswer | Busy) and not self._driver.asleep:
            if not any(isinstance(other.operation, op.Focus) for other in self.wanted.pending):
                self.plan(Schedule(FOCUS_RETRY, order.operation))  # positions do not show it, a stop does not end it
        elif order.follow_up:
            self._context.note(f"{order.operation.title()}: {error}")
        if (not_ended or half_begun) and isinstance(error, Fault):  # something may move that should not
            self.begin_stop()

    def _on_success(self, order: Order, operation: op.Operation, value: Any) -> None:
        now = self._loop.time()
        if (outcome := self._outcomes.pop(order.number, None)) is not None:
            outcome.set_result(value)
        self._update(changes.after_success(self.wanted, order, now))
        if isinstance(value, op.Pulsed):
            self._update(changes.after_pulse_start(self.wanted, order, value, next(self._order_ids), now))
            if not value.ends:
                self._link.queue.expect_urgent((now if value.since is None else value.since) + value.seconds)
        if order.follow_up and not stops_focuser(operation):
            self._consequences.on_follow_up_done(operation)
            self.saved_state_changed.emit(None)
        else:
            self._on_acknowledged(order, operation)

    def _on_acknowledged(self, order: Order, operation: op.Operation) -> None:
        """Add the acknowledged operation to ``Wanted``, and handle its consequences."""
        before, by_hand = self.wanted, isinstance(operation, op.Move | op.MoveAxis)
        self._consequences.on_ack_received(operation)
        speed = self._driver.speed(operation.rate) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        self._update(changes.after_ack(before, order, operation, self._loop.time(), speed, self._last_sent_at))
        self.acknowledged.emit(operation)
        self._consequences.on_ack_stored(operation, before)
        if by_hand or isinstance(operation, op.Focus):
            self.client_motion_began.emit(None)
        elif isinstance(operation, op.StopAxis) and self.wanted.hand_moves:
            self._context.tasks.spawn(self._check_other_axis())
        self.saved_state_changed.emit(None)

    async def _check_other_axis(self) -> None:
        """After one axis was halted, check that the other axis may continue alone; if not, stop the mount."""
        try:
            await self._admission.check_motion_under_way()
        except Fault as fault:
            self._context.note(f"stopped: {fault}")
            self.begin_stop()

    def close(self) -> None:
        """Cancel all orders and timers, and begin nothing more."""
        self.closed = True
        self._stopping.close()
        if self._timer is not None:
            self._timer.cancel()
        self._update(replace(self.wanted, pending=(), active=0, motion=NoOrderedMove()))
