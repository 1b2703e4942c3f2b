"""Waiting and background work on the event loop, for needs that asyncio alone does not meet.

`TimedEvent` waits with a timeout cheaply, because every exchange does so several times. `result_of` shares work between
several callers: it continues if one of them is cancelled. `FairScheduler` resumes only a few clients per event loop
iteration, so that a stop is not delayed. `BackgroundTasks` keeps references to tasks and ends them at shutdown.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from gateway.core.errors import NoAnswer

_T = TypeVar("_T")
Outcome = asyncio.Future[Any]

#: How many of many waiting clients continue in one event loop iteration: together they take a quarter of a millisecond.
PER_ITERATION = 2
#: Event loop iterations within which any stop reaches the line; waiting clients are held back for it no longer.
HELD_AT_MOST = 20


class TimedEvent(asyncio.Event):
    """An `asyncio.Event` with a cheap timeout.

    `within` costs a third of ``asyncio.timeout``, which cancels its task and takes the cancellation back.
    """

    async def within(self, seconds: float) -> bool:
        """Wait until the event is set, for so many seconds at most; return whether it was."""
        if self.is_set():
            return True
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[bool] = loop.create_future()
        limit = loop.call_later(max(0.0, seconds), _resume, waiter)
        self._waiters.append(waiter)
        try:
            return await waiter
        finally:
            limit.cancel()
            self._waiters.remove(waiter)


def _resume(waiter: asyncio.Future[bool]) -> None:
    if not waiter.done():
        waiter.set_result(False)


async def result_of(work: asyncio.Future[_T]) -> _T:
    """Wait for shared work and return its result. Cancelling one caller does not cancel the work. Raises what the work
    raises, or CancelledError.

    ``asyncio.shield`` does the same, but from Python 3.14 on it reports a later exception of such work to the event
    loop, which prints it to a user who can do nothing about it. Here only the callers that still wait get it.
    """
    if not work.done():
        try:
            await asyncio.wait((work,))
        except asyncio.CancelledError:
            work.add_done_callback(mark_retrieved)
            raise
    return work.result()


def mark_retrieved(outcome: asyncio.Future[_T]) -> None:
    """Mark the exception as retrieved, so that asyncio does not log it if no caller waits."""
    if not outcome.cancelled():
        outcome.exception()


def new_outcome() -> Outcome:
    """Return a new future for the result of an order; it is cancelled if the order is superseded."""
    work: Outcome = asyncio.get_running_loop().create_future()
    work.add_done_callback(mark_retrieved)
    return work


def finished() -> Outcome:
    """Return the outcome of an order that needs no action."""
    work = new_outcome()
    work.set_result(None)
    return work


def failed(fault: Exception) -> Outcome:
    """Return the outcome of an order that is refused."""
    work = new_outcome()
    work.set_exception(fault)
    return work


def cancelled() -> Outcome:
    """Return the outcome of an order that was superseded before it arrived."""
    work = new_outcome()
    work.cancel()
    return work


class FairScheduler:
    """Lets only a few clients continue in each event loop iteration.

    Hundreds of polling clients may wait for the same position. If they all continued at once, a stop that arrives
    meanwhile would be handled after them. So the event loop reads its sockets between a few and the next few, and while
    a stop is on its way to the line none of them continues. ``try_acquire`` and ``run`` are for clients with a command,
    ``shared_result`` for those that wait for a reply; ``stopping`` returns whether a motion is being ended.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, stopping: Callable[[], bool]) -> None:
        self._loop, self._stopping = loop, stopping
        self._left, self._held, self._scheduled = PER_ITERATION, 0, False
        self._waiting: deque[Callable[[], object]] = deque()

    def try_acquire(self) -> bool:
        """Whether a client may continue in this event loop iteration; if so, it is counted."""
        if self._left <= 0:
            return False
        self._left -= 1
        self._schedule()
        return True

    def run(self, resume: Callable[[], object]) -> None:
        """Call the function now if possible, else in a later iteration, in order of arrival."""
        if self.try_acquire():
            resume()
        else:
            self._waiting.append(resume)

    async def shared_result(self, task: asyncio.Task[Any]) -> Any:
        """Like `result_of`, but in turn, and raises NoAnswer if the task was cancelled."""
        if not task.done():
            place = self._loop.create_future()
            task.add_done_callback(lambda _: self.run(lambda: _resume(place)))
            await place
        if task.cancelled():  # CancelledError would look as if the caller had been cancelled
            raise NoAnswer
        return task.result()

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            self._loop.call_soon(self._iterate)

    def _iterate(self) -> None:
        """Let the next few waiting clients continue; they go before new ones."""
        self._scheduled = False
        crowd = len(self._waiting) > PER_ITERATION
        self._held = self._held + 1 if crowd and self._stopping() else 0
        held = 0 < self._held <= HELD_AT_MOST
        try:
            for _ in range(0 if held else min(PER_ITERATION, len(self._waiting))):
                self._waiting.popleft()()
        finally:  # an exception of one client must not hold up the others
            self._left = 0 if self._waiting else PER_ITERATION
            if self._waiting:
                self._schedule()


class BackgroundTasks:
    """Background tasks: ``spawn`` starts one and keeps a reference to it, ``cancel`` and ``close`` end all of them."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def spawn(self, work: Coroutine[Any, Any, _T]) -> asyncio.Task[_T]:
        """Start a background task and keep a reference to it."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def cancel(self) -> None:
        """Cancel all tasks without waiting for them to end."""
        for task in self._tasks:
            task.cancel()

    async def close(self) -> None:
        """Cancel all tasks and wait until they have ended."""
        self.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
