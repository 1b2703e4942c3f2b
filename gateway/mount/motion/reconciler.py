"""Makes the mount do what is wanted: the only part that sends motion commands, one operation after the other.

Orders change what is wanted (``apply``), ``next_operation`` returns the next order, the driver carries it out, and its
outcome changes what is wanted again. An operation that is no longer wanted is cancelled between two exchanges. A stop
waits only for the exchange on the wire, not for an operation that survives it: that continues.
"""

from __future__ import annotations

import asyncio
from functools import partial
from itertools import count
from typing import Any

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core import waiting
from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import ENDS, GOTOS, ends_focus, survives_abort
from gateway.core.signals import Signal
from gateway.core.waiting import Outcome, result_of
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.motion import outcomes
from gateway.mount.motion.apply import apply, equal_pending_halt, next_moment, next_operation, planned, stopped
from gateway.mount.motion.order_runner import OrderRunner
from gateway.mount.motion.outcomes import Done, Wait, can_be_postponed, client_disconnected, may_wait
from gateway.mount.motion.stopping import StopSender
from gateway.mount.motion.taps import TapDropped, dropped, serves_as_well
from gateway.mount.motion.wanted import RESUMED, NotOrdered, Order, Tap, Wanted
from gateway.protocols.base.driver import Schedule

#: Seconds between two attempts to halt a focuser whose mount does not reply.
FOCUS_AGAIN = 1.0


class Reconciler:
    """Owns what is wanted and alone replaces it; ``orders`` carries out one order.

    Signals: ``begins`` with an operation that the mount has acknowledged, before ``wanted`` shows it, and ``done``
    after that; ``stop_sent`` when the commands of a stop were sent, acknowledged or not, and ``at_rest`` when the stop
    was acknowledged; ``lasting`` when the state that is saved to disk may have changed.
    """

    def __init__(self, context: Context, runner: DriverRunner, orders: OrderRunner) -> None:
        self._context, self._driver, self._link, self._orders = context, context.driver, context.link, orders
        self._state, self._movement = context.wanted, context.movement
        self.begins: Signal[op.Operation] = Signal()
        self.done: Signal[Done] = Signal()
        self.lasting: Signal[None] = Signal()
        self._loop = asyncio.get_running_loop()
        #: The numbers of new orders.
        self.numbers = count(1)
        #: By order number, the future that the client of the order may wait for.
        self._outcomes: dict[int, Outcome] = {}
        self._work: asyncio.Task[tuple[op.Operation, Any]] | None = None
        #: The number of the order that is being carried out.
        self._active = 0
        self._stopping = StopSender(context, runner)
        self.stop_sent, self.at_rest = self._stopping.sent, self._stopping.at_rest
        self.at_rest.connect(lambda _: self._want(outcomes.at_rest(self.wanted)))
        self._stopping.ended.connect(lambda _: self._start_next())
        runner.scheduled.connect(self.plan)
        runner.broken.connect(self._on_broken)
        self._timer: asyncio.TimerHandle | None = None
        self.closed = False

    @property
    def wanted(self) -> Wanted:
        return self._state.value

    @property
    def busy(self) -> bool:
        """Whether there is a motion that was ordered, an order for one, an owed stop, or suspended tracking."""
        coming = any(not survives_abort(order.operation) for order in self.wanted.pending)
        return self.wanted.owed or coming or self._movement.ordered or self._driver.tracking_suspended

    # --- orders -----------------------------------------------------------------------------------------------------

    def order(self, order: Order) -> Outcome:
        """Take an order, and return its outcome, or that of an equal pending halt. Raises Fault if it is refused."""
        after = apply(self.wanted, order, self._loop.time(), self._movement.slewing)
        late = dropped(self.wanted, after, order) if isinstance(order.operation, op.StopAxis) else None
        if late is not None and (outcome := self._outcomes.pop(late.number, None)) is not None:
            outcome.set_exception(TapDropped())
        if after.stops != self.wanted.stops:
            return self.begin_stop()
        asked = any(one.number == order.number for one in after.pending)
        if asked:
            self._outcomes[order.number] = waiting.new_outcome()
        self._want(after)
        same = order if asked else equal_pending_halt(after, order.operation)
        outcome = self._outcomes.get(same.number) if same is not None else None
        self._start_next()
        return outcome if outcome is not None else waiting.finished()

    def outcomes_of(self, kind: type[op.Operation]) -> list[Outcome]:
        numbers = (order.number for order in self.wanted.pending if isinstance(order.operation, kind))
        return [outcome for number in numbers if (outcome := self._outcomes.get(number)) is not None]

    def want(self, wanted: Wanted) -> None:
        self._want(wanted)
        self._start_next()

    def plan(self, later: Schedule) -> None:
        """Carry out a follow-up after some seconds; it replaces an equal one that still waits."""
        self.want(planned(self.wanted, later, next(self.numbers), self._loop.time()))

    def arrived(self, _: None = None) -> None:
        """Note that the mount reports the end of the goto."""
        self._want(outcomes.arrived(self.wanted))

    # --- stops ------------------------------------------------------------------------------------------------------

    def refuse_earlier_orders(self) -> None:
        """Refuse operations that clients asked for before now and that were not ordered yet."""
        self._put(replace(self.wanted, stops=self.wanted.stops + 1))

    def owe_stop(self) -> None:
        """Owe a stop, for a motion that an earlier run of the gateway left behind."""
        self._put(replace(self.wanted, owed=True))

    def begin_stop(self, why: str | None = None) -> asyncio.Task[None]:
        """End every motion: cancel all orders that run or wait, and send the stop before everything else.

        It is owed until the mount has acknowledged it, also over a lost reply or line. ``why``: see ``stopped``.
        """
        work = self._work
        self._want(stopped(self.wanted, why))
        return self._stopping.send(work if work is not None and work.cancelling() else None)

    async def stop(self, why: str | None = None) -> None:
        """End every motion, and wait until the mount has acknowledged it. Raises Fault."""
        await result_of(self.begin_stop(why))

    def send_again(self, axes: frozenset[int]) -> None:
        """Send an end again, because the position shows that the mount still moves. Other orders continue."""
        if len(axes) > 1:
            self._stopping.send(None)
        else:
            self._context.tasks.spawn(self._stopping.halt_again(*axes))

    def _on_broken(self, _: None) -> None:
        """Stop the mount: after a defect in the driver it is unknown what moves."""
        if self.busy:
            self.begin_stop()

    # --- execution ---------------------------------------------------------------------------------------------------

    def _put(self, wanted: Wanted) -> None:
        self._state.value = wanted
        self._state.changed.emit(wanted)

    def _want(self, wanted: Wanted) -> None:
        """Replace what is wanted, settle the outcomes of orders that are no longer wanted, and cancel work on them."""
        before = self.wanted
        self._put(wanted)
        for tap in wanted.taps:
            if tap not in before.taps:
                self._loop.call_at(tap.until, self._end_tap, tap)
                self._link.queue.expect_urgent(tap.until)
        if before.pending is not wanted.pending:
            left = {order.number for order in wanted.pending}
            for order in before.pending:
                if order.number not in left and (outcome := self._outcomes.pop(order.number, None)) is not None:
                    outcome.set_result(None) if serves_as_well(order, wanted) else outcome.cancel()
            if self._work is not None and (wanted.active != self._active or self._active not in left):
                self._work.cancel()

    def _end_tap(self, tap: Tap) -> None:
        """End the motion of an arrow that was released a while ago, unless something else has ended it."""
        if tap in self.wanted.taps and not self.closed:
            self.order(Order(next(self.numbers), op.StopAxis(tap.axis), tap.by, since=tap.until, ends_tap=True))

    def _start_next(self) -> None:
        """Begin the order that is due, unless another is being carried out; if none is due, set a timer."""
        if self.closed or self._work is not None or self._stopping.task is not None:
            return
        order = next_operation(self.wanted, self._loop.time()) if self.wanted.pending else None
        while order is not None and (wait := self._why_wait(order)) is not None:
            self._postpone(order, wait)
            order = next_operation(self.wanted, self._loop.time())
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if order is not None:
            if (wanted := self.wanted).pulses:
                wanted, order = outcomes.without_excess(wanted, order, self._loop.time())
            self._put(replace(wanted, active=order.number))
            self._active, self._work = order.number, self._loop.create_task(self._orders.carry_out(order, self.stop))
            self._work.add_done_callback(partial(self._has_ended, order))
        elif self.wanted.pending and (moment := next_moment(self.wanted)) is not None:
            self._timer = self._loop.call_at(moment, self._start_next)

    def _why_wait(self, order: Order) -> Wait | None:
        return outcomes.why_wait(order, self._loop.time(), self._link.occupied, self._context.incoming)

    def _postpone(self, order: Order, wait: Wait) -> None:
        """Postpone an order that the mount cannot be given now; refuse it if it has waited too long."""
        now = self._loop.time()
        if may_wait(order, now, wait.longest) and not client_disconnected(order):
            self._want(outcomes.postponed(self.wanted, order, now))
            return
        if not client_disconnected(order) and (outcome := self._outcomes.pop(order.number, None)) is not None:
            outcome.set_exception(wait.refusal or Busy())
        self._want(outcomes.failed(self.wanted, order))

    def _has_ended(self, order: Order, work: asyncio.Task[tuple[op.Operation, Any]]) -> None:
        self._work, self._active = None, 0
        order = next((one for one in self.wanted.pending if one.number == order.number), replace(order, rank=-1))
        outcome = self._outcomes.pop(order.number, None)
        if work.cancelled():
            if order.rank == RESUMED and not self.closed:
                self._was_interrupted(order, outcome)
            elif outcome is not None:
                outcome.set_result(None) if serves_as_well(order, self.wanted) else outcome.cancel()
                self._want(outcomes.removed(self.wanted, order))
        elif (error := work.exception()) is not None:
            self._has_failed(order, error, outcome)
        elif order.rank >= 0:
            operation, value = work.result()
            if outcome is not None:
                outcome.set_result(value)
            self._has_succeeded(order, operation, value)
        self._start_next()

    def _was_interrupted(self, order: Order, outcome: Outcome | None) -> None:
        """Leave the order pending: it is begun again after the end. A motion by hand may have begun already."""
        if outcome is not None:
            self._outcomes[order.number] = outcome
        if isinstance(order.operation, op.Move | op.MoveAxis):
            self._takes_effect(order, order.operation)

    def _has_failed(self, order: Order, error: BaseException, outcome: Outcome | None) -> None:
        now = self._loop.time()
        if (
            isinstance(error, Busy)
            and order.rank >= 0
            and can_be_postponed(order)
            and may_wait(order, now)
            and self._link.worked_after(order.since)
        ):  # the mount began a long operation while this order was prepared
            if outcome is not None:
                self._outcomes[order.number] = outcome
            self._want(outcomes.postponed(self.wanted, order, now))
            return
        if outcome is not None:
            outcome.set_exception(error)
        if order.rank < 0:  # no longer wanted
            return
        self._want(outcomes.failed(self.wanted, order))
        half_begun = outcomes.may_have_begun(order, error) or self._may_have_interrupted(order)
        not_ended = isinstance(order.operation, ENDS) and not (self._driver.asleep and not order.follow_up)
        if ends_focus(order.operation) and isinstance(error, NoAnswer | Busy) and not self._driver.asleep:
            self._end_focus_again(order)
        elif order.follow_up:
            self._context.note(f"{order.operation.title()}: {error}")
        if (not_ended or half_begun) and isinstance(error, Fault):  # something may move that should not
            self.begin_stop()

    def _may_have_interrupted(self, order: Order) -> bool:
        """Whether a failed goto may have ended the motion before it, or left tracking suspended."""
        sent = isinstance(order.operation, GOTOS) and self._orders.admitted == order.number
        return sent and (bool(self.wanted.by_hand) or self._driver.tracking_suspended)

    def _end_focus_again(self, order: Order) -> None:
        """Retry a focuser halt that was not acknowledged: no position shows it, and no stop of the mount does it."""
        if not any(isinstance(one.operation, op.Focus) for one in self.wanted.pending):
            self.plan(Schedule(FOCUS_AGAIN, order.operation))

    def _has_succeeded(self, order: Order, operation: op.Operation, value: Any) -> None:
        now = self._loop.time()
        self._want(outcomes.carried_out(self.wanted, order, now, value))
        if isinstance(value, op.Pulsed):
            self._want(outcomes.pulsed(self.wanted, order, value, next(self.numbers), now))
            if not value.ends:
                self._link.queue.expect_urgent((now if value.since is None else value.since) + value.seconds)
        if order.follow_up and not ends_focus(operation):
            self.lasting.emit(None)
        else:
            self._takes_effect(order, operation)

    def _takes_effect(self, order: Order, operation: op.Operation) -> None:
        before = self.wanted
        self.begins.emit(operation)
        speed = self._driver.speed(operation.rate) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        self._want(outcomes.acknowledged(before, order, operation, self._loop.time(), speed, self._orders.sent))
        self.done.emit(Done(operation, before))
        if isinstance(operation, op.StopAxis) and self.wanted.by_hand:
            self._context.tasks.spawn(self._orders.check_other_axis(self.begin_stop))
        self.lasting.emit(None)

    def close(self) -> None:
        """Cancel all orders and timers, and begin nothing more."""
        self.closed = True
        self._stopping.close()
        if self._timer is not None:
            self._timer.cancel()
        self._want(replace(self.wanted, pending=(), active=0, motion=NotOrdered()))
