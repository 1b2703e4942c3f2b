"""What programs get over a lossy line, a slow one, and at the start."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.poor_line import LineFaults, insert_poor_line, poll
from tests.support.poor_line_replies import LINES, MOUNTS, first_answer, polled


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", ["3 % lost", "3 % of each"])
@pytest.mark.parametrize("model", MOUNTS)
def test_every_poll_is_answered_on_a_slightly_lossy_line(model: str, name: str, moving: bool) -> None:
    polls = run(polled(model, MOUNTS[model], LINES[name], 30.0, moving))
    assert polls.answered == polls.asked >= 40  # of a hundred
    assert polls.wrong == 0
    assert polls.longest < 3.5


@pytest.mark.parametrize("model", MOUNTS)
def test_line_with_a_round_trip_of_a_second_answers_all_polls(model: str) -> None:
    polls = run(polled(model, MOUNTS[model], LINES["round trip of 1 s"], 30.0, moving=False))
    assert polls.answered == polls.asked > 80
    assert polls.wrong == 0


@pytest.mark.parametrize("model", MOUNTS)
def test_answers_that_are_always_late_are_waited_for(model: str) -> None:
    polls = run(polled(model, MOUNTS[model], LINES["answers 3.6 s late"], 60.0, moving=False))
    assert polls.answered >= 15
    assert polls.wrong == 0


@pytest.mark.parametrize(("named", "seconds"), [(True, 4.0), (False, 9.0)])
@pytest.mark.parametrize("latency", [0.0, 0.15, 0.5])
@pytest.mark.parametrize("model", ["lx200", "lx200-16"])
def test_classic_nexstar_answers_soon_after_start(model: str, latency: float, named: bool, seconds: float) -> None:
    assert run(first_answer(model, named, latency)) <= seconds


async def test_use_of_an_old_position_is_logged_once() -> None:
    async with Bridge("cpc", config={"sun": 0.0}) as bridge:
        wire = insert_poor_line(bridge, LineFaults())
        bridge.controller.line.transaction.connection_lost("unplugged")
        await asyncio.sleep(5.0)
        wire._poor = LineFaults(lost=2.0)
        polls = await poll(bridge, 8.0)
        said = [entry.note for entry in bridge.entries if "has not replied in time" in entry.note]
        assert ["last position, up to 10 s old" in words for words in said] == [True]
        assert polls.answered >= 2
