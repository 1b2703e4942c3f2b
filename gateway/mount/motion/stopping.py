"""The stop: sent before everything else, a few times where its answer is lost, and owed until it was acknowledged.

It needs no admission and no turn. It waits for the operation that was given up for it to come to its end, between two
exchanges, and for nothing else.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from gateway.driver import Driver
from gateway.errors import Fault
from gateway.line import STOP
from gateway.mount.motion.executor import Executor
from gateway.operations import Stop

#: How often a stop is sent again on a line that is up, when its answer was lost.
TRIES = 3


class Stopping:
    """``rests`` is called when the mount has acknowledged a stop, ``over`` when one has come to its end."""

    def __init__(self, driver: Driver, executor: Executor, rests: Callable[[], None], over: Callable[[], None]) -> None:
        self._driver, self._executor = driver, executor
        self._rests, self._over = rests, over
        self._loop = asyncio.get_running_loop()
        self._task: asyncio.Task[None] | None = None

    @property
    def under_way(self) -> bool:
        """Whether a stop is being sent: nothing is begun meanwhile."""
        return self._task is not None and not self._task.done()

    def send(self, given_up: asyncio.Task[Any] | None) -> asyncio.Task[None]:
        """Send a stop when this task has ended; one that is being sent does for it: nothing can have begun since."""
        if self._task is None or self._task.done():
            self._task = self._loop.create_task(self._send(given_up))
            self._task.add_done_callback(self._ended)
        return self._task

    async def _send(self, given_up: asyncio.Task[Any] | None) -> None:
        if given_up is not None:
            await asyncio.wait({given_up})
        executor = self._executor
        for attempt in range(TRIES):
            try:
                await executor.drive(self._driver.perform(Stop()), STOP)
                break
            except Fault as fault:
                executor.note(f"stop: {fault}")
                if self._driver.asleep and not executor.down:  # it stands still, and hears of nothing
                    break
                if attempt == TRIES - 1 or executor.down:
                    executor.stop_sent()  # it stays owed, while it is seen to move
                    raise
        executor.stop_sent()
        self._rests()
        executor.at_rest()

    def _ended(self, task: asyncio.Task[None]) -> None:
        heed(task)
        self._over()


def heed(outcome: asyncio.Future[Any]) -> None:
    """Mark the exception as retrieved, so that asyncio does not log one for which nobody waits."""
    if not outcome.cancelled():
        outcome.exception()
