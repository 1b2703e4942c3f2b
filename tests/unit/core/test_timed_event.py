"""A timed event wakes whoever waits for it, in time or not at all."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.timed_event import TimedEvent
from tests.support.virtual import run


def test_who_waits_goes_on_when_it_is_set_and_at_once_while_it_is() -> None:
    async def program() -> None:
        event, loop = TimedEvent(), asyncio.get_running_loop()
        began = loop.time()
        loop.call_later(2.0, event.set)
        answers = await asyncio.gather(event.wait(), event.within(5.0), event.within(1.0))
        assert (answers, loop.time() - began) == ([True, True, False], 2.0)
        assert await event.within(0.0)
        await event.wait()
        event.clear()
        assert not await event.within(0.0)
        assert not await event.within(-1.0)
        assert loop.time() - began == 2.0

    run(program())


def test_who_gives_up_is_told_nothing() -> None:
    async def program() -> None:
        event = TimedEvent()
        waiting = [asyncio.create_task(event.within(9.0)), asyncio.create_task(event.wait())]
        await asyncio.sleep(1.0)
        for task in waiting:
            task.cancel()
        event.set()
        for task in waiting:
            with pytest.raises(asyncio.CancelledError):
                await task
        assert not event._waiters

    run(program())
