"""A bell wakes whoever waits for it, in time or not at all."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.bell import Bell
from tests.support.virtual import run


def test_who_waits_goes_on_when_it_rings_and_at_once_while_it_does() -> None:
    async def program() -> None:
        bell, loop = Bell(), asyncio.get_running_loop()
        began = loop.time()
        loop.call_later(2.0, bell.set)
        answers = await asyncio.gather(bell.wait(), bell.within(5.0), bell.within(1.0))
        assert (answers, loop.time() - began) == ([None, True, False], 2.0)
        assert await bell.within(0.0)
        await bell.wait()
        bell.clear()
        assert not await bell.within(0.0)
        assert not await bell.within(-1.0)
        assert loop.time() - began == 2.0

    run(program())


def test_who_gives_up_is_told_nothing() -> None:
    async def program() -> None:
        bell = Bell()
        waiting = [asyncio.create_task(bell.within(9.0)), asyncio.create_task(bell.wait())]
        await asyncio.sleep(1.0)
        for task in waiting:
            task.cancel()
        bell.set()
        for task in waiting:
            with pytest.raises(asyncio.CancelledError):
                await task
        assert not bell._waiting

    run(program())
