"""A goto that ends elsewhere than at its goal is told of, once, and not begun again."""

from __future__ import annotations

import asyncio
import struct
from contextlib import suppress
from typing import Any

import pytest

from gateway.app.api.opening import mount_in_process
from gateway.app.mount_state import mount_state
from gateway.core import operations as op
from gateway.core.errors import Fault, Stopped
from gateway.core.operations import Equatorial
from gateway.diagnostics.virtual_time import run
from gateway.fleet.mount_messages import published_state
from gateway.mount.readings.reader import miss_text
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner
from tests.support.sampling import as_a_rule

GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("cancelled", [True, False])
async def test_goto_cancelled_at_the_keypad_is_reported(mount: str, driven: str, cancelled: bool) -> None:
    async with Bridge(mount, driven=driven, config={"lowest": -90.0, "sun": 0.0}) as bridge:
        owner, client = Owner(bridge, driven), bridge.client()
        await client.ask(b":GR#")
        client.send(GOTO)
        await asyncio.sleep(3.0)
        if cancelled:
            owner.keys("cancel")
        for _ in range(60):
            await client.ask(b":D#")
            await asyncio.sleep(1.0)
        told = [entry.note for entry in bridge.entries if "from its goal" in entry.note]
        assert len(told) == cancelled
        assert not bridge.controller.moving


@pytest.mark.parametrize(("mount", "driven"), [("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("ends", ["stop", "gateway"])
def test_goto_ended_by_the_gateway_is_not_reported_as_missed(mount: str, driven: str, ends: str) -> None:
    """Whenever the stop falls between two answers of a mount that is asked all the time."""

    async def program(late: float) -> None:
        async with Bridge(mount, driven=driven, config={"lowest": -90.0, "sun": 0.0}, latency=0.1) as bridge:
            client = bridge.client()
            await client.ask(b":GR#")
            client.send(GOTO)
            await asyncio.sleep(3.0)
            polls = asyncio.ensure_future(polled(bridge))
            await asyncio.sleep(1.0 + late)
            if ends == "stop":
                await bridge.controller.stop()
                await asyncio.sleep(3.0)
            else:
                await bridge.gateway.close()
            polls.cancel()
            assert not [entry.note for entry in bridge.entries if "from its goal" in entry.note]

    async def polled(bridge: Bridge) -> None:
        while True:
            with suppress(Fault):
                await bridge.controller.read_now(op.Slewing())
            await asyncio.sleep(0.01)

    for step in range(0, 20, as_a_rule(3, whole=1)):
        run(program(0.02 * step))


#: How a goto ends -> the beginning of what is told.
ENDS = {
    "at the keypad": "the goto ended ",
    "at a limit": "the goto ended before its goal: stopped at the altitude limit (",
    "by a lost cable": "the goto ended before its goal: stopped when the connection to the mount was lost",
    "by a client": "",
    "at its goal": "",
}


async def ended(bridge: Any, driven: str, how: str) -> None:
    """Send the mount to its goal, and let this end the goto."""
    owner = Owner(bridge, driven)
    await bridge.controller.perform(op.Goto(120.0, 30.0))
    await asyncio.sleep(3.0)
    if how == "at the keypad":
        owner.keys("cancel")
    elif how == "at a limit":
        bridge.sim.mechanics.goto_axes(bridge.clock(), 0.0, -60.0)
    elif how == "by a lost cable":
        owner.cable.pull()
        await asyncio.sleep(1.0)
        owner.cable.out = False
    elif how == "by a client":
        await bridge.controller.stop()
    for _ in range(60):
        await bridge.controller.answer(op.Slewing())
        await asyncio.sleep(1.0)


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("how", ENDS)
async def test_missed_goto_is_reported_until_the_next_order(how: str, mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven, config={"sun": 0.0}) as bridge:
        controller = bridge.controller
        telescope = mount_in_process(bridge.gateway)
        await ended(bridge, driven, how)
        words = (await telescope.perform(op.GetActivity())).short
        assert words.startswith(ENDS[how]) and bool(words) == bool(ENDS[how])
        assert (words in mount_state(controller).to_state().wanted) is bool(words)
        assert published_state(bridge.gateway)["goto_ended_short"] == (words or None)
        if words:
            with pytest.raises(Stopped, match="the goto ended"):
                await telescope.arrived()
        else:
            await telescope.arrived()
        await telescope.perform(op.StopAxis(1))
        assert (await telescope.perform(op.GetActivity())).short == ""


@pytest.mark.parametrize("how", ENDS)
async def test_missed_goto_shows_in_the_stellarium_status(how: str) -> None:
    async with Bridge("cpc", presented="stellarium", surface=None, config={"sun": 0.0}) as bridge:
        client = bridge.client()
        await ended(bridge, "nexstar", how)
        [status] = struct.unpack("<i", client.received[-4:])
        assert status == (-2 if ENDS[how] else 0)
        await mount_in_process(bridge.gateway).goto(121.0, 30.0)
        await asyncio.sleep(2.0)
        assert client.received[-4:] == b"\0\0\0\0"


def test_goto_that_ends_near_its_target_counts_as_arrived() -> None:
    goal = Equatorial(10.0, 20.0)
    assert miss_text(goal, Equatorial(10.0, 20.4)) == ""
    assert "1.0 degrees from its goal" in miss_text(goal, Equatorial(10.0, 21.0))
    assert "180.0 degrees" in miss_text(Equatorial(0.0, 90.0), Equatorial(120.0, -90.0))
