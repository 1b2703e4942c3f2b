"""Many who wait for one answer: all get it, a few at a time, and none while a stop is on its way."""

from __future__ import annotations

import asyncio

import pytest

from gateway.hub.turnstile import FEW, WAY, Turnstile
from tests.virtual import run


async def _turns(turnstile: Turnstile, many: int) -> list[int]:
    """How many had gone on after each turn of the event loop, once the answer was there."""
    loop = asyncio.get_running_loop()
    answer = loop.create_future()
    task = loop.create_task(_wait(answer))
    through: list[int] = []

    async def one() -> None:
        assert await turnstile.outcome(task) == "answer"
        through.append(1)

    waiting = [loop.create_task(one()) for _ in range(many)]
    await asyncio.sleep(0.1)
    answer.set_result("answer")
    counts = []
    while not all(one.done() for one in waiting):
        await asyncio.sleep(0)
        counts.append(len(through))
        assert len(counts) < 10 * many
    return counts


async def _wait(answer: asyncio.Future[str]) -> str:
    return await answer


def test_a_few_go_on_in_each_turn() -> None:
    counts = run(_turns(Turnstile(lambda: False), 200))
    steps = [after - before for before, after in zip([0, *counts], counts, strict=False)]
    assert counts[-1] == 200
    assert max(steps) <= FEW
    assert len(counts) <= 200 / FEW + 10


def test_nobody_goes_on_while_a_stop_makes_its_way_and_everybody_after_it() -> None:
    counts = run(_turns(Turnstile(lambda: True), 20))
    assert counts[WAY - 1] == 0
    assert counts[-1] == 20


def test_a_failure_reaches_everybody_and_who_gives_up_harms_nobody() -> None:
    async def program() -> None:
        turnstile = Turnstile(lambda: False)

        async def fail() -> None:
            await asyncio.sleep(1)
            raise ValueError("no")

        task = asyncio.ensure_future(fail())
        waiting = [asyncio.ensure_future(turnstile.outcome(task)) for _ in range(10)]
        await asyncio.sleep(0.5)
        waiting[0].cancel()
        found = await asyncio.gather(*waiting, return_exceptions=True)
        assert isinstance(found[0], asyncio.CancelledError)
        assert all(isinstance(one, ValueError) for one in found[1:])
        with pytest.raises(ValueError, match="no"):
            await turnstile.outcome(task)  # it is over: nothing to wait for

    run(program())
