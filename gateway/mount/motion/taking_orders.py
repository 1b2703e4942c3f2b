"""Takes orders: what each makes of what is wanted, and what is over, or refused, before it is begun."""

from __future__ import annotations

import asyncio
from math import inf

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.core.motion_kinds import GOTOS
from gateway.mount.context import Context
from gateway.mount.link.line import MountLink
from gateway.mount.motion.apply import apply, does_for, interrupted, take_back, too_late
from gateway.mount.motion.awaited import Outcome, over_before, refused
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.motion.wanted import FIRST, IN_ORDER, Movement, Order, WantedState
from gateway.mount.safety.rules.dead_man import HostActivity


class TakingOrders:
    """``begin`` takes an order; the reconciler brings about what is wanted then."""

    def __init__(
        self, context: Context, link: MountLink, wanted: WantedState, movement: Movement, reconciler: Reconciler
    ) -> None:
        self._context, self._driver = context, context.driver
        self._link, self._wanted, self._movement, self._reconciler = link, wanted, movement, reconciler

    def begin(
        self, operation: op.Operation, stops: int | None, by: HostActivity | None, patience: float = inf
    ) -> Outcome:
        """Take an order -> its outcome; from now on it counts as asked for. ``stops``: their count when it was.

        Whoever asked waits for the outcome for ``patience`` seconds: a goto is not begun after that.
        """
        reconciler = self._reconciler
        before, now = self._wanted.value, self._context.now()
        if reconciler.closed or too_late(before, operation, stops):
            return over_before()
        if isinstance(operation, op.StopAxis) and self._only_a_stop_is_heard(operation.axis):
            self._context.note(
                "the mount is busy calculating and accepts nothing but a full stop: both axes are stopped"
            )
            return reconciler.begin_stop()
        wakes = isinstance(operation, op.Wake) and self._driver.asleep  # what is before it would not be heard
        order = Order(
            next(reconciler.numbers),
            operation,
            by,
            rank=FIRST if wakes else IN_ORDER,
            since=now,
            until=now + patience if isinstance(operation, (*GOTOS, op.Sync)) else inf,
        )
        try:
            after = apply(before, order, now, self._movement.slewing)
        except Fault as fault:
            return refused(fault)
        return reconciler.begin_stop() if after.stops != before.stops else reconciler.take(order, after)

    def impossible(self, operation: op.Operation) -> Fault | None:
        """Why the mount would refuse this, where that is known: nothing waits that may change how it stands."""
        wanted = self._wanted.value
        same = all(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending)
        return self._driver.impossible(operation) if same and not wanted.owed else None

    def again(self, operation: op.Operation) -> bool:
        """Take back what a halt ends -> whether an equal one that is not done does for this one, too."""
        reconciler = self._reconciler
        if self._movement.slewing or self._wanted.value.waiting_gotos:
            return False
        wanted = take_back(self._wanted.value, operation)
        same = does_for(wanted, operation)
        reconciler.want(wanted if same is None else interrupted(wanted, same))
        return same is not None

    async def woken(self) -> None:
        """Wait for what is to wake the mount, if anything is. Not for motions: it may wait behind them."""
        if waking := self._reconciler.outcomes_of(op.Wake):
            await asyncio.wait(waking)

    def _only_a_stop_is_heard(self, axis: int) -> bool:
        """Whether an arrow is released that the mount would go on with for seconds."""
        wanted = self._wanted.value
        return axis in wanted.by_hand and self._link.occupied and not wanted.waiting_gotos
