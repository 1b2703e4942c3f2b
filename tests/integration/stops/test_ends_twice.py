"""A Meade acknowledges no end of a motion, so each is sent twice: not at rest, and never into something newer."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.cable import lose_commands
from tests.support.in_process_gateway import Bridge

MEADES = ["lx200", "lx200-16", "autostar", "lx200gps"]
GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"


def meade(mount: str, **others: Any) -> Bridge:
    return Bridge(mount, driven="lx200", config={"lowest": -90.0, "sun": 0.0}, **others)


def times(bridge: Bridge, command: bytes) -> list[float]:
    """When it was sent."""
    return [entry.time for entry in bridge.entries if (entry.side, entry.arrow, entry.data) == ("mount", ">", command)]


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize(
    ("motion", "end"),
    [(b":RG#:Me#", b":Q#"), (b":RG#:Me#", b":Qe#"), (b":RS#:Mn#", b":Qn#"), (b":RC#:Mw#", b":Q#"), (GOTO, b":Q#")],
)
async def test_lost_stop_of_an_arrow_is_sent_again_within_half_a_second(mount: str, motion: bytes, end: bytes) -> None:
    """Too slow a motion, or too short a time, for the position to show it."""
    async with meade(mount) as bridge:
        client = bridge.client()
        client.send(motion)
        await asyncio.sleep(2.0)
        missed = lose_commands(bridge, (end,))
        asked = bridge.clock()
        client.send(end)
        await asyncio.sleep(0.15)  # an exchange may be under way
        assert missed == [end]
        await asyncio.sleep(1.0)
        first, second = times(bridge, end)
        assert first - asked < 0.15, "the first is not kept waiting"
        assert second - first == pytest.approx(0.3, abs=0.1)
        assert not bridge.sim.arrows
        assert not bridge.sim.slewing


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize("after", [0.0, 0.1, 0.25, 0.29, 0.3])
@pytest.mark.parametrize("newer", [GOTO, b":Mw#", b":Me#", b":Mn#"])
async def test_motion_begun_after_a_stop_is_not_ended_by_its_repetition(mount: str, after: float, newer: bytes) -> None:
    async with meade(mount) as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        client.send(b":Q#")
        await asyncio.sleep(after)
        client.send(newer)
        await asyncio.sleep(2.0)
        assert bridge.sim.slewing if newer == GOTO else bridge.sim.arrows
        assert truth_of(bridge.sim).moving


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize("after", [0.0, 0.1, 0.29])
async def test_repeated_stop_of_an_axis_does_not_end_a_later_guide_pulse(mount: str, after: float) -> None:
    async with meade(mount) as bridge:
        client = bridge.client()
        client.send(b":RC#:Mn#:Me#")
        await asyncio.sleep(2.0)
        client.send(b":Qe#")
        await asyncio.sleep(1.0)
        assert set(bridge.sim.arrows) == {2}
        client.send(b":Qn#")
        await asyncio.sleep(after)
        client.send(b":Mgn2000#")
        await asyncio.sleep(1.0)
        assert truth_of(bridge.sim).moving


@pytest.mark.parametrize("mount", MEADES)
async def test_stop_of_a_mount_at_rest_is_sent_only_once(mount: str) -> None:
    async with meade(mount) as bridge:
        client = bridge.client()
        for _ in range(5):
            client.send(b":Q#")
            await asyncio.sleep(1.0)
        assert len(times(bridge, b":Q#")) == 5


async def test_lost_end_of_a_gateway_timed_pulse_is_sent_again() -> None:
    async with meade("lx200") as bridge:
        client = bridge.client()
        missed = lose_commands(bridge, (b":Qe#",))
        client.send(b":Mge0500#")
        await asyncio.sleep(1.5)
        assert missed
        assert len(times(bridge, b":Qe#")) == 2
        assert not bridge.sim.arrows


async def test_focuser_stops_though_its_first_stop_command_was_lost() -> None:
    async with meade("autostar") as bridge:
        client = bridge.client()
        client.send(b":F+#")
        await asyncio.sleep(1.0)
        missed = lose_commands(bridge, (b":FQ#",))
        client.send(b":FQ#")
        await asyncio.sleep(1.0)
        assert missed
        assert bridge.sim.accessories["focuser"] == 0


async def test_end_of_a_pulse_is_sent_when_a_busy_telescope_hears_again() -> None:
    """A classic that calculates its planets hears :Q# alone; no position shows that a rate so low goes on.

    Its owner has set the date at the keypad: the gateway sends none to a mount that moves.
    """
    settings = {"lowest": -90.0, "sun": 0.0, "site_time": "always"}
    async with Bridge("lx200", driven="lx200", config=settings) as bridge:
        bridge.client().send(b":Mge4000#")
        await asyncio.sleep(0.3)
        bridge.sim.busy_until = bridge.clock() + 10.0
        await asyncio.sleep(3.0)
        assert bridge.sim.busy
        await asyncio.sleep(20.0)
        assert not bridge.sim.arrows


async def test_released_arrow_stops_a_meade_that_reports_busy() -> None:
    """An LX200GPS that says that it is busy would turn on at two degrees a second until it hears again."""
    async with Bridge("lx200gps", driven="lx200", config={"lowest": -90.0, "sun": 0.0}) as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(1.5)
        bridge.sim.busy_until = bridge.clock() + 10.0
        await asyncio.sleep(1.0)
        assert bridge.sim.arrows
        client.send(b":Qe#")
        await asyncio.sleep(2.0)
        assert bridge.sim.busy
        assert not bridge.sim.arrows
        assert not bridge.controller.wanted.axes_moved_by_hand
