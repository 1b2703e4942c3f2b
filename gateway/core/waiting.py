"""Waiting and background work on the event loop, for needs that asyncio alone does not meet.

`TimedEvent` has a cheap timeout, because every exchange waits with one several times. With `result_of` several callers
wait for the same work, which continues if a caller is cancelled; `shared_result` reports that the work was cancelled.
`BackgroundTasks` keeps references to tasks and ends them at shutdown. `run_in_thread` also works when Python ends.
"""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from gateway.core.errors import NoAnswer

_T = TypeVar("_T")
Outcome = asyncio.Future[Any]  # the result of an order


class TimedEvent(asyncio.Event):
    """An `asyncio.Event` with a cheap timeout.

    `wait_within` costs a third of ``asyncio.timeout``, which cancels its task and takes the cancellation back.
    """

    async def wait_within(self, seconds: float) -> bool:
        """Wait until the event is set, at most ``seconds``; return whether it was set."""
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
    """Wait for shared work and return its result, or raise what it raises. Cancelling a caller leaves the work alone.

    ``asyncio.shield`` does the same, but from Python 3.14 on it reports a later exception of such work to the event
    loop, which prints it to a user who can do nothing about it. Here only the callers that still wait get it.
    """
    await _wait_until_done(work)
    return work.result()


async def shared_result(work: asyncio.Future[_T]) -> _T:
    """Like `result_of`, but raises NoAnswer if the work was cancelled, and CancelledError only if the caller was."""
    await _wait_until_done(work)
    if work.cancelled():
        raise NoAnswer
    return work.result()


async def _wait_until_done(work: asyncio.Future[_T]) -> None:
    if not work.done():
        try:
            await asyncio.wait((work,))
        except asyncio.CancelledError:
            work.add_done_callback(mark_exception_retrieved)
            raise


async def run_in_thread(function: Callable[..., Any], *arguments: object) -> Any:
    """Return a function's result, run on another thread; on this one while Python shuts down and starts no thread."""
    working = functools.partial(function, *arguments)
    try:
        future = asyncio.get_running_loop().run_in_executor(None, working)
    except RuntimeError:
        return working()
    return await future


def mark_exception_retrieved(future: asyncio.Future[_T]) -> None:
    """Mark the exception as retrieved, so that asyncio does not log it if no caller waits."""
    if not future.cancelled():
        future.exception()


def new_outcome() -> Outcome:
    """Return a new future for the result of an order; it is cancelled if the order is superseded."""
    work: Outcome = asyncio.get_running_loop().create_future()
    work.add_done_callback(mark_exception_retrieved)
    return work


def finished_outcome() -> Outcome:
    """Return the outcome of an order that needs no action."""
    work = new_outcome()
    work.set_result(None)
    return work


def failed_outcome(fault: Exception) -> Outcome:
    """Return the outcome of an order that is refused."""
    work = new_outcome()
    work.set_exception(fault)
    return work


def cancelled_outcome() -> Outcome:
    """Return the outcome of an order that was superseded before it arrived."""
    work = new_outcome()
    work.cancel()
    return work


class BackgroundTasks:
    """Background tasks: ``spawn`` starts a task and keeps a reference to it, ``cancel`` and ``close`` end all."""

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
