"""The stop: sent before everything else, a few times where its answer is lost, and owed until it was acknowledged.

It needs no admission and no turn. It waits for the operation that was given up for it to come to its end, between two
exchanges, and for nothing else. One that was not acknowledged on a line that stays up is sent again every few seconds,
a bounded number of times, unless something else was set moving since: nobody knows who else moves the mount by then.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.operations import Stop
from gateway.core.shared_work import heed
from gateway.mount.link.queue import STOP
from gateway.mount.motion.executor import Executor
from gateway.protocols.base.driver import Driver

#: How often a stop is sent again on a line that is up, when its answer was lost.
TRIES = 3
#: Seconds from one stop that was not acknowledged to the next; after the last of them somebody is told.
AGAIN = (1.5, 2.0, 3.0, 5.0, 10.0, 10.0)


class Stopping:
    """``rests`` is called when the mount has acknowledged a stop, ``over`` when one has come to its end.

    ``owed`` tells what the stop that is owed is to end; None where none is owed any more.
    """

    def __init__(
        self,
        driver: Driver,
        executor: Executor,
        rests: Callable[[], None],
        over: Callable[[], None],
        owed: Callable[[], object],
    ) -> None:
        self._driver, self._executor = driver, executor
        self._rests, self._over, self._owed = rests, over, owed
        self._loop = asyncio.get_running_loop()
        self._task: asyncio.Task[None] | None = None
        #: How often the stop was sent again, and when it will be.
        self._times = 0
        self._timer: asyncio.TimerHandle | None = None

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
        if task.cancelled() or not isinstance(task.exception(), NoAnswer | Busy):
            self._times = 0
        elif self._times < len(AGAIN):
            self.close()
            self._timer = self._loop.call_later(AGAIN[self._times], self._once_more, self._owed())
        else:
            self._times = 0
            self._executor.note(
                "WARNING: the mount has not acknowledged the stop, however often it was sent: it may "
                "go on moving; stop it at its hand control, or switch it off"
            )

    def _once_more(self, motion: object) -> None:
        """On a line that was lost meanwhile it goes first when that is back."""
        if self._owed() is motion is not None and not self.under_way and self._executor.served:
            self._times += 1
            self.send(None)
        elif not self.under_way:
            self._times = 0

    def close(self) -> None:
        """Nothing is sent again."""
        if self._timer is not None:
            self._timer.cancel()
