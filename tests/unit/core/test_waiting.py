"""A timed event wakes whoever waits for it; work goes on when whoever waits for it gives up, on every Python alike."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from gateway.core.errors import NoAnswer
from gateway.core.waiting import TimedEvent, result_of, shared_result
from gateway.diagnostics.virtual_time import run


async def test_timed_event_wakes_waiters_when_set_and_does_not_block_while_set() -> None:
    event, loop = TimedEvent(), asyncio.get_running_loop()
    began = loop.time()
    loop.call_later(2.0, event.set)
    answers = await asyncio.gather(event.wait(), event.wait_within(5.0), event.wait_within(1.0))
    assert (answers, loop.time() - began) == ([True, True, False], 2.0)
    assert await event.wait_within(0.0)
    await event.wait()
    event.clear()
    assert not await event.wait_within(0.0)
    assert not await event.wait_within(-1.0)
    assert loop.time() - began == 2.0


async def test_waiter_that_gives_up_gets_no_event() -> None:
    event = TimedEvent()
    waiting = [asyncio.create_task(event.wait_within(9.0)), asyncio.create_task(event.wait())]
    await asyncio.sleep(1.0)
    for task in waiting:
        task.cancel()
    event.set()
    for task in waiting:
        with pytest.raises(asyncio.CancelledError):
            await task
    assert not event._waiters


def played(play: Callable[[asyncio.Future[str]], Coroutine[Any, Any, None]]) -> list[object]:
    """What the event loop was told of while somebody waited for some work."""

    async def main() -> list[object]:
        told: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: told.append(context))
        await play(asyncio.get_running_loop().create_future())
        return told

    return list(run(main()))


def test_waiter_that_gives_up_does_not_cancel_shared_work() -> None:
    async def play(work: asyncio.Future[str]) -> None:
        gives_up = asyncio.create_task(result_of(work))
        waits = asyncio.create_task(result_of(work))
        await asyncio.sleep(1)
        gives_up.cancel()
        await asyncio.sleep(1)
        assert gives_up.cancelled() and not work.done()
        work.set_exception(ValueError("no"))
        with pytest.raises(ValueError, match="no"):
            await waits

    assert played(play) == []


def test_failure_that_nobody_awaits_is_silent() -> None:
    async def play(work: asyncio.Future[str]) -> None:
        waits = asyncio.create_task(result_of(work))
        await asyncio.sleep(1)
        waits.cancel()
        await asyncio.sleep(1)
        work.set_exception(ValueError("no"))
        await asyncio.sleep(1)

    assert played(play) == []  # Python 3.14: "ValueError exception in shielded future"


def test_result_or_cancellation_of_shared_work_is_passed_on() -> None:
    async def play(work: asyncio.Future[str]) -> None:
        waits = asyncio.create_task(result_of(work))
        await asyncio.sleep(1)
        work.set_result("yes")
        assert (await waits, await result_of(work)) == ("yes", "yes")
        over: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        waits = asyncio.create_task(result_of(over))
        await asyncio.sleep(1)
        over.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waits

    assert played(play) == []


async def test_failure_of_shared_work_reaches_all_remaining_waiters() -> None:
    async def fail() -> None:
        await asyncio.sleep(1)
        raise ValueError("no")

    task = asyncio.ensure_future(fail())
    waiting = [asyncio.ensure_future(shared_result(task)) for _ in range(10)]
    await asyncio.sleep(0.5)
    waiting[0].cancel()
    outcomes = await asyncio.gather(*waiting, return_exceptions=True)
    assert isinstance(outcomes[0], asyncio.CancelledError)
    assert all(isinstance(outcome, ValueError) for outcome in outcomes[1:])
    with pytest.raises(ValueError, match="no"):
        await shared_result(task)  # it is over: nothing to wait for


async def test_waiters_of_cancelled_shared_work_continue() -> None:
    task = asyncio.get_running_loop().create_task(asyncio.sleep(100.0))
    waiting = [asyncio.ensure_future(shared_result(task)) for _ in range(3)]
    await asyncio.sleep(0.1)
    task.cancel()
    outcomes = await asyncio.gather(*waiting, return_exceptions=True)
    assert [type(outcome) for outcome in outcomes] == [NoAnswer] * 3
