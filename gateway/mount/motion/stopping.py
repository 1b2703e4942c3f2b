"""The stop: sent before everything else, several times if its reply is lost, and owed until it is acknowledged.

It needs no admission and does not queue behind other orders: it only waits until the operation that it cancels has
ended its exchange. If a stop is not acknowledged although the line is up, it is sent again every few seconds, a bounded
number of times, unless another motion was ordered since.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import MOVERS
from gateway.core.operations import AbortMotion, StopAxis
from gateway.core.signals import Signal
from gateway.core.waiting import mark_exception_retrieved
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import STOP

#: How often a stop is sent at once on a line that is up, if its reply is lost.
IMMEDIATE_TRIES = 3
#: Seconds between further attempts while the stop is not acknowledged; after the last attempt the log warns the user.
RETRY_DELAYS = (1.5, 2.0, 3.0, 5.0, 10.0, 10.0)


class StopSender:
    """Sends stops. ``commands_sent`` is emitted when the commands of a stop were sent, ``acknowledged`` when the mount
    has acknowledged them, and ``attempt_ended`` when an attempt has ended, with or without success.
    """

    def __init__(self, context: Context, runner: DriverRunner) -> None:
        self._context, self._driver, self._link, self._runner = context, context.driver, context.link, runner
        self.commands_sent: Signal[None] = Signal()
        self.acknowledged: Signal[None] = Signal()
        self.attempt_ended: Signal[None] = Signal()
        self._closed = False
        self._loop = asyncio.get_running_loop()
        #: The stop that is being sent; no order is begun during it.
        self.task: asyncio.Task[None] | None = None
        #: How many further attempts were made, and the timer of the next.
        self._retry_count = 0
        self._timer: asyncio.TimerHandle | None = None

    def send(self, cancelled_task: asyncio.Task[Any] | None) -> asyncio.Task[None]:
        """Send a stop when the cancelled task has ended, unless one is being sent; return the task that sends it."""
        if self.task is None or self.task.done():
            self.task = self._loop.create_task(self._send(cancelled_task))
            self.task.add_done_callback(self._on_attempt_ended)
        return self.task

    async def _send(self, cancelled_task: asyncio.Task[Any] | None) -> None:
        if cancelled_task is not None:
            await asyncio.wait({cancelled_task})
        for attempt in range(IMMEDIATE_TRIES):
            try:
                await self._runner.perform(AbortMotion(), STOP)
                break
            except Fault as fault:
                self._context.note(f"stop: {fault}")
                if self._driver.asleep and self._link.state != "down":  # a hibernating mount stands still
                    break
                if attempt == IMMEDIATE_TRIES - 1 or self._link.state == "down":
                    self.commands_sent.emit(None)  # the stop stays owed
                    raise
        self.commands_sent.emit(None)
        self.acknowledged.emit(None)

    async def resend_halt(self, axis: int) -> None:
        with contextlib.suppress(Fault):  # it is retried if the next position shows that the axis still moves
            await self._runner.perform(StopAxis(axis), STOP)

    def _on_attempt_ended(self, task: asyncio.Task[None]) -> None:
        mark_exception_retrieved(task)
        if self.task is task:
            self.task = None
        self.attempt_ended.emit(None)
        if task.cancelled() or not isinstance(task.exception(), NoAnswer | Busy):
            self._retry_count = 0
        elif self._retry_count < len(RETRY_DELAYS):
            self._cancel_retry()
            self._timer = self._loop.call_later(RETRY_DELAYS[self._retry_count], self._retry, self._motion_to_stop())
        else:
            self._retry_count = 0
            self._context.note(
                "WARNING: the mount has not acknowledged the stop, although it was sent again and again: it may "
                "still be moving; stop it at its hand control, or switch it off"
            )

    def _motion_to_stop(self) -> object:
        """Return the motion whose stop is not acknowledged; None if there is none, or another motion is pending."""
        wanted = self._context.wanted.value
        coming = any(isinstance(order.operation, MOVERS) for order in wanted.pending)
        return None if self._closed or coming or not wanted.stop_owed else wanted.motion

    def _retry(self, motion: object) -> None:
        """Send the stop again if it is still owed for the same motion. If the line is lost, it is sent at reopening."""
        if self._motion_to_stop() is motion is not None and self.task is None and self._link.usable:
            self._retry_count += 1
            self.send(None)
        elif self.task is None:
            self._retry_count = 0

    def close(self) -> None:
        self._closed = True
        self._cancel_retry()

    def _cancel_retry(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
