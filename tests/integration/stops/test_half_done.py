"""What was begun and not carried out to its end leaves nothing behind: no tracking that stays off, no false park.

Bytes as in the NexStar manual: ``b`` goto axes, ``r`` goto, ``M`` cancel, ``T`` tracking mode, ``L`` slewing, ``x`` and
``y`` hibernate and wake.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.protocols.mechanics.truth import truth_of
from tests.support import truth
from tests.support.cable import swallow
from tests.support.in_process_gateway import Bridge

GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
OPEN = {"lowest": -90.0, "sun": 0.0}


async def polled(bridge: Bridge, seconds: int) -> None:
    client = bridge.client("10.0.0.9")
    for _ in range(seconds):
        client.send(b":GR#:D#")
        await asyncio.sleep(1.0)


async def arrived(bridge: Bridge, most: int = 60) -> None:
    """A program polls until the mount has stood for 3 s, or only followed the sky."""
    rested = 0
    for _ in range(most):
        await polled(bridge, 1)
        rested = 0 if truth.moving(bridge.sim) else rested + 1
        if rested == 3:
            return
    raise AssertionError("it never arrives")


async def test_mount_keeps_tracking_after_a_park_that_it_never_heard() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await arrived(bridge)
        lost = swallow(bridge, lambda data: data[:1] == b"b")
        client.send(b":hP#")
        await polled(bridge, 30)
        assert lost
        assert bridge.sim.tracking
        assert not bridge.driver.parked


@pytest.mark.parametrize("order", ["park", "goto"])
async def test_motion_that_the_mount_heard_without_an_answer_counts_as_running(order: str) -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        if order == "park":
            await client.ask(GOTO, ending=b"0")
            await arrived(bridge)
        lost = swallow(bridge, lambda data: data[:1] in b"br", carried_out=True)
        client.send(b":hP#" if order == "park" else GOTO)
        await arrived(bridge, 90)
        assert lost
        if order == "park":
            assert not bridge.sim.tracking
            assert bridge.driver.parked
            assert truth_of(bridge.sim).axis2 == pytest.approx(90.0, abs=0.1)
        else:
            assert client.received == b"11", "after its time nothing is told"
            assert separation(*bridge.sim.true_position(), 120.0, 30.0) < 0.02


async def test_tracking_returns_after_a_failed_goto_that_ended_an_arrow() -> None:
    async with Bridge("6-8se", config=OPEN) as bridge:
        client = bridge.client()
        client.send(b":RC#:Me#")
        await asyncio.sleep(3.0)
        lost = swallow(bridge, lambda data: data == b"T\x01")
        assert (await client.ask(GOTO, ending=b"#")).startswith(b"11")
        await polled(bridge, 15)
        assert lost
        assert bridge.sim.tracking
        assert not bridge.controller.wanted.axes_moved_by_hand
        assert not bridge.driver.tracking_suspended


async def test_goto_refused_by_a_check_leaves_the_arrow_alone() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        client.send(b":RM#:Mw#")
        await asyncio.sleep(2.0)
        await client.ask(b":Sr08:00:00#:Sd-80*00:00#:MS#", ending=b"#")
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}
        assert abs(truth_of(bridge.sim).rate1) > 0.1


@pytest.mark.parametrize("instead", [op.Goto(120.0, 30.0), op.AbortSlew()])
async def test_cancelled_search_for_home_is_reported_as_cancelled(instead: op.Operation) -> None:
    async with Bridge("cge") as bridge:
        await bridge.controller.perform(op.SetHome())
        await bridge.client().ask(GOTO, ending=b"0")
        await arrived(bridge)
        await bridge.controller.perform(op.Home())
        await asyncio.sleep(1.0)
        assert await bridge.controller.answer(op.HomeState()) == 2
        await bridge.controller.perform(instead)
        await arrived(bridge)
        assert await bridge.controller.answer(op.HomeState()) == 0


async def test_drive_rate_returns_after_a_cancelled_goto() -> None:
    async with Bridge("cge", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        await client.ask(b"P\x03\x10\x06\xff\xfd\x00\x00", ending=b"#")  # lunar
        await asyncio.sleep(1.0)
        assert await client.ask(b"r55555555,15555555") == b"#"
        await asyncio.sleep(3.0)
        before = len(bridge.sent_requests())
        assert await client.ask(b"M") == b"#"
        await asyncio.sleep(3.0)
        assert bridge.sent_requests()[before:].count(b"P\x03\x10\x06\xff\xfd\x00\x00") == 1


@pytest.mark.parametrize("later", [0.3, 1.0, 1.9])
async def test_tracking_switched_off_after_waking_stays_off(later: float) -> None:
    async with Bridge("cpc", presented="nexstar", surface="cpc") as bridge:
        client = bridge.client()
        assert await client.ask(b"x") == b"#"
        await asyncio.sleep(3.0)
        assert await client.ask(b"y") == b"#"
        await asyncio.sleep(later)
        assert await client.ask(b"T\x00") == b"#"
        await asyncio.sleep(5.0)
        assert not bridge.sim.tracking
        assert await client.ask(b"t") == b"\x00#"


@pytest.mark.parametrize("times", [1, 3])
async def test_lost_tracking_off_of_a_park_is_sent_again(times: int) -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await arrived(bridge)
        lost = swallow(bridge, lambda data: data == b"T\x00", times)
        client.send(b":hP#")
        await arrived(bridge)
        await polled(bridge, 20 * times)
        assert len(lost) == times
        assert not bridge.sim.tracking
        assert truth_of(bridge.sim).axis2 == pytest.approx(90.0, abs=0.1)


async def test_park_does_not_end_tracking_after_a_later_goto() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await arrived(bridge)
        lost = swallow(bridge, lambda data: data == b"T\x00")
        client.send(b":hP#")
        while not lost:
            await polled(bridge, 1)
        await asyncio.sleep(4.0)
        assert (await client.ask(GOTO, ending=b"0")).endswith(b"0")
        await arrived(bridge)
        assert bridge.sim.tracking
        assert not bridge.driver.parked


async def test_mount_moved_off_its_park_position_by_axes_is_not_parked() -> None:
    async with Bridge("cge") as bridge:
        await bridge.controller.perform(op.Park())
        await polled(bridge, 10)
        assert await bridge.controller.answer(op.HomeState()) == 1
        await bridge.controller.perform(op.GotoAxes(100.0, 60.0))
        await arrived(bridge)
        assert await bridge.controller.answer(op.HomeState()) == 0


@pytest.mark.parametrize("times", [1, 2, 4])
async def test_meade_that_stores_its_home_answers_again_after_a_lost_answer(times: int) -> None:
    async with Bridge("lx200gps", driven="lx200") as bridge:
        client = bridge.client()
        lost = swallow(bridge, lambda data: data == b":h?#", times)
        client.send(b":hS#")
        await asyncio.sleep(60.0)
        assert len(lost) == times
        assert len(await client.ask(b":GR#", ending=b"#")) == len(b"06:21:31#")
