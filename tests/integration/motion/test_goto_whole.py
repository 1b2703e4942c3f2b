"""A goto is both axes or none: nothing that comes meanwhile breaks one of them off and leaves the other going."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import separation
from tests.support.in_process_gateway import Bridge

GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
GOAL = (120.0, 30.0)
MOUNTS = [("cge", "nexstar"), ("cpc", "nexstar"), ("6-8se", "nexstar"), ("lx200gps", "lx200"), ("lx200", "lx200")]


async def arrives(bridge: Any, seconds: float = 90.0) -> bool:
    """Whether the mount gets to the goal and stays there; a program polls meanwhile."""
    client = bridge.client("10.0.0.9")
    for _ in range(round(seconds)):
        client.send(b":GR#")
        await asyncio.sleep(1.0)
        if separation(*bridge.sim.true_position(), *GOAL) < 0.02:
            await asyncio.sleep(2.0)
            return separation(*bridge.sim.true_position(), *GOAL) < 0.02
    return False


async def rests(bridge: Any) -> bool:
    """Whether the tube stays where it points on the sky."""
    await asyncio.sleep(4.0)
    before = bridge.sim.true_position()
    await asyncio.sleep(1.0)
    return separation(*before, *bridge.sim.true_position()) < 0.006


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("early", [0.0, 0.3, 3.0])
async def test_release_of_an_ended_arrow_leaves_the_goto_alone(mount: str, driven: str, early: float) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#:Mn#")
        await asyncio.sleep(2.0)
        client.send(GOTO)
        await asyncio.sleep(early)
        client.send(b":Qe#:Qn#")
        assert await arrives(bridge)
        assert client.received.endswith(b"0")


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("ends", [b":Qe#", b":Qn#", b":Qe#:Qw#:Qn#:Qs#"])
async def test_halt_without_an_arrow_ends_the_whole_goto(mount: str, driven: str, ends: bytes) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await asyncio.sleep(2.0)
        assert bridge.sim.slewing
        client.send(ends)
        assert await rests(bridge)
        assert not bridge.sim.slewing
        assert separation(*bridge.sim.true_position(), *GOAL) > 1.0
        assert bridge.sim.tracking
        assert await client.ask(b":D#", ending=b"#") == b"#"


async def test_nexstar_halt_of_one_axis_ends_the_whole_goto() -> None:
    async with Bridge("cge", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        assert await client.ask(b"r55555555,15555555") == b"#"
        await asyncio.sleep(3.0)
        assert bridge.sim.slewing
        assert await client.ask(b"P\x02\x11\x24\x00\x00\x00\x00") == b"#"
        assert await rests(bridge)
        assert not bridge.sim.slewing
        assert bridge.sim.tracking


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_arrow_is_released_though_its_release_came_with_a_refused_goto(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client = bridge.client()
        client.send(b":RM#:Mw#")
        await asyncio.sleep(2.0)
        client.send(b":Sr08:00:00#:Sd-80*00:00#:MS#:Qw#")
        assert await rests(bridge)
        assert not bridge.controller.wanted.axes_moved_by_hand


async def test_arrow_pressed_and_released_right_after_a_goto_ends() -> None:
    """That the goto is over may not be known yet when the arrow is pressed."""
    async with Bridge("cge") as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        assert await arrives(bridge)
        client.send(b":RM#:Me#")
        await asyncio.sleep(0.5)
        client.send(b":Qe#")
        assert await rests(bridge)


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("meanwhile", [b":TL#", b":TS#", b":ST59.0#", b":TQ#", b":Mge0500#", b":Mgn1000#", b":RG#:RM#"])
async def test_rate_change_or_guide_pulse_does_not_disturb_a_goto(mount: str, driven: str, meanwhile: bytes) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await asyncio.sleep(2.0)
        assert bridge.sim.slewing
        client.send(meanwhile)
        assert await arrives(bridge)
        dropped = [entry.note for entry in bridge.entries if "the guide pulse is dropped" in entry.note]
        assert bool(dropped) is meanwhile.startswith(b":Mg")


@pytest.mark.parametrize("ended", [False, True])
async def test_rate_set_during_a_goto_runs_afterwards(ended: bool) -> None:
    """The Moon's: 14.685 arcseconds a second; also when the goto was stopped."""
    async with Bridge("cge") as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        await asyncio.sleep(2.0)
        client.send(b":TL#")
        if ended:
            client.send(b":Q#")
            await asyncio.sleep(5.0)
        else:
            assert await arrives_near(bridge)
        before, began = bridge.sim.true_position()[0], bridge.clock()
        await asyncio.sleep(20.0)
        drift = (bridge.sim.true_position()[0] - before) * 3600.0 / (bridge.clock() - began)
        assert drift == pytest.approx(15.041 - 14.685, abs=0.02)


async def arrives_near(bridge: Any) -> bool:
    """The same of a mount that does not follow the stars afterwards."""
    client = bridge.client("10.0.0.9")
    for _ in range(60):
        client.send(b":GR#:D#")
        await asyncio.sleep(1.0)
    return separation(*bridge.sim.true_position(), *GOAL) < 0.1


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("held", [0.0, 0.06, 0.1, 0.3, 0.45, 0.8])
@pytest.mark.parametrize("when", ["during a goto", "just after one", "the second axis"])
async def test_arrow_released_soon_after_an_interrupted_goto_leaves_nothing_moving(
    mount: str, driven: str, held: float, when: str
) -> None:
    """The mount may have heard of the arrow and not yet acknowledged it, and the goto may seem to be under way."""
    async with Bridge(mount, driven=driven, config={"lowest": -90.0, "sun": 0.0}) as bridge:
        client = bridge.client()
        await client.ask(GOTO, ending=b"0")
        if when == "just after one":
            while separation(*bridge.sim.true_position(), *GOAL) > 0.001:
                client.send(b":GR#")
                await asyncio.sleep(0.1)
        else:
            await asyncio.sleep(2.0)
        if when == "the second axis":
            client.send(b":RM#:Me#")
            await asyncio.sleep(1.0)
        client.send(b":RM#:Mn#")
        await asyncio.sleep(held)
        client.send(b":Qn#")
        await asyncio.sleep(0.5)
        client.send(b":Qe#")
        assert await rests(bridge)
        assert not bridge.controller.wanted.axes_moved_by_hand
        await asyncio.sleep(2.0)
        assert bridge.sim.tracking


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_halt_ends_a_goto_even_after_a_timed_out_arrow_on_that_axis(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven, config={"dead_man_closed": 1.0}) as bridge:
        first = bridge.client()
        first.send(b":RM#:Me#")
        await asyncio.sleep(1.0)
        first.close()
        await asyncio.sleep(6.0)
        assert not bridge.controller.wanted.axes_moved_by_hand
        second = bridge.client()
        await second.ask(GOTO, ending=b"0")
        await asyncio.sleep(3.0)
        second.send(b":Qe#")
        assert await rests(bridge)
        assert separation(*bridge.sim.true_position(), *GOAL) > 1.0


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.3])
async def test_stop_ends_the_search_for_home(delay: float) -> None:
    async with Bridge("lx200gps", driven="lx200", surface="lx200gps") as bridge:
        client = bridge.client()
        client.send(b":hS#")
        await asyncio.sleep(delay)
        client.send(b":Q#")
        assert await rests(bridge)
