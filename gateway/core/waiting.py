"""Waiting, and work on the event loop, where asyncio alone does not do it as the gateway needs it.

An event is waited for with a time limit several times in every exchange, so that must be cheap. Work that others wait
for goes on when one of them gives up. Of a crowd that waits for the same thing a few go on in each turn of the loop, so
that a stop is heard among them. What runs in the background is held on to, and is over at the end.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from gateway.core.errors import NoAnswer

_T = TypeVar("_T")
Outcome = asyncio.Future[Any]

#: How many of a crowd go on in one turn of the event loop: together they take a quarter of a millisecond.
FEW = 2
#: Turns of the event loop in which a stop comes to the line from anywhere; more than that nobody is held up for it.
WAY = 20


class TimedEvent(asyncio.Event):
    """Whoever waits goes on when it is ``set``, and at once while it is, until ``clear``.

    With a time limit that costs a third of what ``asyncio.timeout`` does, which cancels its task and takes the
    cancellation back.
    """

    async def within(self, seconds: float) -> bool:
        """Until it is set, for so many seconds at most -> whether it was."""
        if self.is_set():
            return True
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[bool] = loop.create_future()
        limit = loop.call_later(max(0.0, seconds), _go_on, waiter)
        self._waiters.append(waiter)
        try:
            return await waiter
        finally:
            limit.cancel()
            self._waiters.remove(waiter)


def _go_on(waiter: asyncio.Future[bool]) -> None:
    if not waiter.done():
        waiter.set_result(False)


async def result_of(work: asyncio.Future[_T]) -> _T:
    """Wait for work -> its result; who gives up ends it for nobody. Raises what the work raises, or CancelledError.

    ``asyncio.shield`` does the same, but from Python 3.14 on it reports what such work raises later to the event loop,
    which writes it on the terminal of a user who can do nothing about it. Here only those are told who still wait.
    """
    if not work.done():
        try:
            await asyncio.wait((work,))
        except asyncio.CancelledError:
            work.add_done_callback(heed)
            raise
    return work.result()


def heed(outcome: asyncio.Future[_T]) -> None:
    """Mark the exception as retrieved, so that asyncio does not log one for which nobody waits."""
    if not outcome.cancelled():
        outcome.exception()


def outcome() -> Outcome:
    """What whoever asks for something waits for: one that is not wanted any more is cancelled."""
    work: Outcome = asyncio.get_running_loop().create_future()
    work.add_done_callback(heed)
    return work


def done() -> Outcome:
    """That of what needs nothing to be done."""
    work = outcome()
    work.set_result(None)
    return work


def refused(fault: Exception) -> Outcome:
    """That of what is not taken."""
    work = outcome()
    work.set_exception(fault)
    return work


def over_before() -> Outcome:
    """That of what was over before it came."""
    work = outcome()
    work.cancel()
    return work


class FairScheduler:
    """A turnstile: hundreds of programs that poll ask in step, and wait for the same position.

    Were they all to go on at once, a stop that comes meanwhile would be heard after them; so between a few and the next
    few the event loop looks at what has come in, and while a stop makes its way to the line nobody of a crowd goes on.
    ``open`` and ``enter`` are for whoever comes, ``outcome`` for who waits for an answer, and ``stopping`` says whether
    a motion is being ended.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, stopping: Callable[[], bool]) -> None:
        self._loop, self._stopping = loop, stopping
        self._left, self._held, self._turning = FEW, 0, False
        self._waiting: deque[Callable[[], object]] = deque()

    def open(self) -> bool:
        """Whether somebody may go on at once, who then counts as one of this turn."""
        if self._left <= 0:
            return False
        self._left -= 1
        self._turn_later()
        return True

    def enter(self, go_on: Callable[[], object]) -> None:
        """Have it called: at once, or in its turn."""
        if self.open():
            go_on()
        else:
            self._waiting.append(go_on)

    async def outcome(self, task: asyncio.Task[Any]) -> Any:
        """What the task returns. Raises what it raises, NoAnswer if it was cancelled; who gives up does not end it."""
        if not task.done():
            place = self._loop.create_future()
            task.add_done_callback(lambda _: self.enter(lambda: _go_on(place)))
            await place
        if task.cancelled():  # that must not look as if whoever waits had been
            raise NoAnswer
        return task.result()

    def _turn_later(self) -> None:
        if not self._turning:
            self._turning = True
            self._loop.call_soon(self._turn)

    def _turn(self) -> None:
        """The next turn of the event loop: those who wait go first."""
        self._turning = False
        crowd = len(self._waiting) > FEW
        self._held = self._held + 1 if crowd and self._stopping() else 0
        held = 0 < self._held <= WAY
        try:
            for _ in range(0 if held else min(FEW, len(self._waiting))):
                self._waiting.popleft()()
        finally:  # whatever one of them comes to grief about, the others go on
            self._left = 0 if self._waiting else FEW
            if self._waiting:
                self._turn_later()


class BackgroundTasks:
    """``spawn`` begins one, which the loop alone would not hold on to; ``cancel`` and ``close`` end them all."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def spawn(self, work: Coroutine[Any, Any, _T]) -> asyncio.Task[_T]:
        """Run something in the background and hold on to it."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def cancel(self) -> None:
        """End what still runs, and wait for none of it."""
        for task in self._tasks:
            task.cancel()

    async def close(self) -> None:
        """End what still runs, and wait until it is over."""
        self.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
