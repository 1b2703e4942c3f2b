"""Carries out one order: is it allowed, who must know before, and what the driver does about it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from math import inf
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import ENDS, MOVING
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import MOTION, SETTING, STOP
from gateway.mount.motion.wanted import IN_ORDER, Movement, Order
from gateway.mount.safety.admission.motions import Admission
from gateway.protocols.base.driver import FollowUps


async def _nobody() -> None:
    """Nobody needs to know."""


class BeforeMotion:
    """``announce`` is awaited before the mount is sent anything that sets it moving: should this process be killed, a
    mark on disk or a watchdog must know. The application may set it.
    """

    def __init__(self) -> None:
        self.announce: Callable[[], Awaitable[None]] = _nobody


class OrderRunner:
    """``admitted`` is the number of the last order that was admitted."""

    def __init__(
        self,
        context: Context,
        follow_ups: FollowUps,
        runner: DriverRunner,
        movement: Movement,
        admission: Admission,
        before_motion: BeforeMotion,
    ) -> None:
        self._context, self._driver, self._follow_ups, self._runner = context, context.driver, follow_ups, runner
        self._movement, self._admission, self._before_motion = movement, admission, before_motion
        self.admitted = 0

    async def carry_out(self, order: Order, stop: Callable[[], Awaitable[None]]) -> tuple[op.Operation, Any]:
        """-> the operation as it was admitted, and its answer. ``stop`` ends what moves before it. Raises Fault."""
        operation = order.operation
        if order.follow_up:
            special = self._follow_ups.get(type(operation))
            steps = special(self._driver, operation) if special else self._driver.perform(operation)
            return operation, await self._runner.drive(steps, STOP if order.urgent else MOTION)
        arrow = isinstance(operation, op.Move | op.MoveAxis) and order.rank == IN_ORDER
        since = order.since if arrow else None
        operation = await self._in_time(order)
        self.admitted = order.number
        if isinstance(operation, MOVING):
            await self._before_motion.announce()
        elif isinstance(operation, op.Hibernate) and (self._movement.anything or self._driver.tracking_suspended):
            await stop()
        rank = MOTION if not isinstance(operation, ENDS) else SETTING if order.hammered else STOP
        return operation, await self._runner.drive(self._driver.perform(operation), rank, since)

    async def go_on_alone(self, stop: Callable[[], object]) -> None:
        """One axis was ended: what still moves must be allowed without it, else ``stop`` ends it."""
        try:
            await self._admission.still_allowed()
        except Fault as fault:
            self._context.note(f"stopped: {fault}")
            stop()

    async def _in_time(self, order: Order) -> op.Operation:
        """-> the operation as it was admitted. Raises Fault, while whoever asked for it can still be told."""
        try:
            async with asyncio.timeout_at(order.until if order.until < inf else None):
                return await self._admission.admit(order.operation)
        except TimeoutError:
            raise Busy from None
