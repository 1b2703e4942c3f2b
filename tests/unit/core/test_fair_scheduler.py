"""Many who wait for one answer: all get it, a few at a time, and none while a stop is on its way."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from gateway.core.errors import NoAnswer
from gateway.core.waiting import HELD_AT_MOST, PER_ITERATION, FairScheduler
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge, Visitor


async def _turns(stopping: Callable[[], bool], many: int) -> list[int]:
    """How many had gone on after each turn of the event loop, once the answer was there."""
    loop = asyncio.get_running_loop()
    scheduler = FairScheduler(loop, stopping)
    answer = loop.create_future()
    task = loop.create_task(_wait(answer))
    through: list[int] = []

    async def one() -> None:
        assert await scheduler.shared_result(task) == "answer"
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
    counts = run(_turns(lambda: False, 200))
    steps = [after - before for before, after in zip([0, *counts], counts, strict=False)]
    assert counts[-1] == 200
    assert max(steps) <= PER_ITERATION
    assert len(counts) <= 200 / PER_ITERATION + 10


def test_no_crowd_goes_on_while_a_stop_makes_its_way_and_everybody_after_it() -> None:
    counts = run(_turns(lambda: True, 20))
    assert counts[HELD_AT_MOST - 1] <= PER_ITERATION
    assert counts[-1] == 20


def test_a_failure_reaches_everybody_and_who_gives_up_harms_nobody() -> None:
    async def program() -> None:
        scheduler = FairScheduler(asyncio.get_running_loop(), lambda: False)

        async def fail() -> None:
            await asyncio.sleep(1)
            raise ValueError("no")

        task = asyncio.ensure_future(fail())
        waiting = [asyncio.ensure_future(scheduler.shared_result(task)) for _ in range(10)]
        await asyncio.sleep(0.5)
        waiting[0].cancel()
        found = await asyncio.gather(*waiting, return_exceptions=True)
        assert isinstance(found[0], asyncio.CancelledError)
        assert all(isinstance(one, ValueError) for one in found[1:])
        with pytest.raises(ValueError, match="no"):
            await scheduler.shared_result(task)  # it is over: nothing to wait for

    run(program())


# --- at the door ------------------------------------------------------------------------------------------------------


async def _crowd(bridge: Bridge, many: int = 100) -> list[Visitor]:
    """So many programs that poll, and have all just been answered once."""
    crowd = [bridge.client(f"10.0.0.{number}") for number in range(many)]
    _ask(crowd)
    await asyncio.sleep(1.0)
    for visitor in crowd:
        assert visitor.heard
        visitor.heard = b""
    return crowd


def _ask(crowd: list[Visitor]) -> None:
    """All at once."""
    for visitor in crowd:
        visitor.tell(b":GVP#")


@pytest.mark.parametrize("stop", [b":Q#", b"\x00:Q#:GVP#"])
def test_a_stop_that_comes_with_a_crowd_is_heard_before_it(stop: bytes) -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            crowd, hand = await _crowd(bridge), bridge.client()
            hand.tell(b":RS#:Mn#")
            await asyncio.sleep(1.0)
            before = bridge.controller.stops
            _ask(crowd)
            hand.tell(stop)
            assert bridge.controller.stops == before + 1
            assert sum(bool(visitor.heard) for visitor in crowd) <= PER_ITERATION
            await asyncio.sleep(1.0)
            assert all(visitor.heard == b"Autostar#" for visitor in crowd)
            assert not bridge.controller.moving

    run(program())


@pytest.mark.parametrize("moves", [b":Mn#", b":Sr02:00:00#:Sd+80*00:00#:MS#"])
def test_what_waits_at_the_door_when_a_stop_comes_was_asked_for_before_it(moves: bytes) -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            crowd, hand, other = await _crowd(bridge), bridge.client(), bridge.client()
            _ask(crowd)
            hand.tell(moves)
            other.tell(b":Q#")
            await asyncio.sleep(5.0)
            assert not bridge.controller.moving
            assert not any(sent.startswith((b"r", b"R")) for sent in bridge.sent())
            assert not any(sent[:1] == b"P" and sent[3:4] in (b"\x24", b"\x25") and sent[4] for sent in bridge.sent())

    run(program())


def test_everybody_s_own_words_stay_in_their_order() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            crowd, one = await _crowd(bridge), bridge.client()
            _ask(crowd)
            for part in (b":Sr01:0", b"0:00#:Gr#", b":Q#", b":Sr02:00:00#", b":Gr#"):
                one.tell(part)
            await asyncio.sleep(1.0)
            assert one.heard == b"101:00:00#102:00:00#"

    run(program())


def test_who_leaves_at_once_has_said_what_it_said() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            crowd, one = await _crowd(bridge), bridge.client("10.1.1.1")
            _ask(crowd)
            one.tell(b":Sr03:00:00#")
            one.close()
            assert await bridge.client("10.1.1.1").ask(b":Gr#") == b"03:00:00#"

    run(program())


def test_who_says_much_while_it_waits_is_let_in() -> None:
    """Nothing piles up at the door."""

    async def program() -> None:
        async with Bridge() as bridge:
            crowd, one = await _crowd(bridge), bridge.client()
            _ask(crowd)
            for _ in range(400):
                one.tell(b":GVP#")
            assert len(one.heard) > 200 * len(b"Autostar#")
            await asyncio.sleep(1.0)
            assert one.heard == b"Autostar#" * 400

    run(program())


def test_what_follows_a_stop_in_the_same_breath_was_asked_for_after_it() -> None:
    """Also when its program had been waiting at the door."""

    async def program() -> None:
        async with Bridge(config={"lowest": -90.0}) as bridge:
            crowd, one = await _crowd(bridge), bridge.client()
            _ask(crowd)
            one.tell(b":GVP#")
            one.tell(b":Q#:Sr02:00:00#:Sd+80*00:00#:MS#")
            await asyncio.sleep(5.0)
            assert any(sent.startswith((b"r", b"R")) for sent in bridge.sent())

    run(program())


def test_one_who_comes_to_grief_holds_up_nobody() -> None:
    async def program() -> None:
        loop = asyncio.get_running_loop()
        said: list[object] = []
        loop.set_exception_handler(lambda _, context: said.append(context["exception"]))
        scheduler = FairScheduler(loop, lambda: False)
        through: list[int] = []

        def grief() -> None:
            raise ValueError

        for number in range(3 * PER_ITERATION):
            scheduler.run(grief if number == PER_ITERATION else lambda number=number: through.append(number))
        await asyncio.sleep(0.1)
        assert through == [*range(PER_ITERATION), *range(PER_ITERATION + 1, 3 * PER_ITERATION)]
        assert len(said) == 1
        assert scheduler.try_acquire()

    run(program())


def test_an_answer_that_was_cancelled_is_none_and_who_waited_for_it_goes_on() -> None:
    async def program() -> None:
        loop = asyncio.get_running_loop()
        scheduler = FairScheduler(loop, lambda: False)
        task = loop.create_task(asyncio.sleep(100.0))
        waiting = [loop.create_task(scheduler.shared_result(task)) for _ in range(3)]
        await asyncio.sleep(0.1)
        task.cancel()
        outcomes = await asyncio.gather(*waiting, return_exceptions=True)
        assert [type(outcome) for outcome in outcomes] == [NoAnswer] * 3

    run(program())
