"""A stop that the mount did not hear: the position shows it, and it is sent again. Every mount, every kind of end."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import separation
from tests.support.cable import lose_commands
from tests.support.in_process_gateway import Bridge

MEADES = ["lx200", "lx200-16", "autostar", "lx200gps"]
GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"


def bridge_to(mount: str) -> Bridge:
    return Bridge(mount, driven="lx200" if mount in MEADES else "nexstar", config={"lowest": -90.0, "sun": 0.0})


def speed(bridge: Any, before: tuple[float, float], seconds: float) -> float:
    return separation(*before, *bridge.sim.true_position()) / seconds


async def seconds_to_rest(bridge: Any, at_most: float) -> float:
    """Since now; programs poll meanwhile."""
    began, client = bridge.controller.now(), bridge.client("10.0.0.9")
    while bridge.controller.now() - began < at_most:
        before = bridge.sim.true_position()
        client.send(b":GR#")
        await asyncio.sleep(0.2)
        if speed(bridge, before, 0.2) < 0.02:
            return float(bridge.controller.now() - began)
    return at_most


@pytest.mark.parametrize(
    ("mount", "times"), [(mount, times) for mount in MEADES for times in (1, 3)] + [("cge", 1), ("cpc", 1), ("cge", 3)]
)
@pytest.mark.parametrize("motion", [b":RS#:Me#", b":RS#:Mn#:Mw#", b":RM#:Ms#", GOTO])
@pytest.mark.safety_line(1)
async def test_lost_stop_is_sent_again(mount: str, motion: bytes, times: int) -> None:
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(motion)
        await asyncio.sleep(4.0)
        ends = (b":Q#",) if mount in MEADES else (b"M", b"P\x02\x10\x24\0", b"P\x02\x11\x24\0")
        missed = lose_commands(bridge, ends, times)
        client.send(b":Q#")
        assert await seconds_to_rest(bridge, 30.0) < {1: 6.0, 3: 9.0 if mount in MEADES else 15.0}[times]
        assert missed
        await asyncio.sleep(10.0)
        assert bridge.sim.tracking


@pytest.mark.parametrize("mount", MEADES)
async def test_lost_release_is_sent_again_and_the_other_axis_goes_on(mount: str) -> None:
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#:Mn#")
        await asyncio.sleep(3.0)
        missed = lose_commands(bridge, (b":Qe#",))
        client.send(b":Qe#")
        for _ in range(16):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        assert missed
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        assert set(bridge.sim.arrows) == {2}


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize("fastest", [b":RS#", b":Sw4#", b":Sw2#"])
async def test_lost_release_at_the_fastest_rate_is_sent_again(mount: str, fastest: bytes) -> None:
    """A 16 inch goes at 4 degrees a second, half of what the others do; :Sw slows all of them."""
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(fastest + b":Me#")
        await asyncio.sleep(3.0)
        missed = lose_commands(bridge, (b":Qe#",))
        client.send(b":Qe#")
        assert await seconds_to_rest(bridge, 30.0) < 6.0
        assert missed


@pytest.mark.parametrize("mount", ["autostar", "cge", "cpc"])
@pytest.mark.parametrize("motion", [b":RS#:Me#", b":RG#:Me#", b":RC#:Mn#", GOTO])
async def test_stop_that_the_mount_heard_is_not_sent_again(mount: str, motion: bytes) -> None:
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(motion)
        await asyncio.sleep(4.0)
        client.send(b":Q#")
        await asyncio.sleep(10.0)
        stops = [sent for sent in bridge.sent_requests() if sent in (b":Q#", b"M")]
        assert len(stops) == (2 if mount in MEADES else 1), "a Meade acknowledges nothing, so it is told twice"
        assert not bridge.controller.end_watch.is_watching
        assert not [entry for entry in bridge.entries if "not stopped" in entry.note]


async def test_mount_that_ignores_every_stop_is_reported() -> None:
    async with bridge_to("autostar") as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(3.0)
        lose_commands(bridge, (b":Q",), 1000)
        client.send(b":Q#")
        assert await seconds_to_rest(bridge, 25.0) == 25.0
        warned = [entry.note for entry in bridge.entries if entry.note.startswith("WARNING: the mount keeps moving")]
        assert 1 <= len(warned) <= 2
        await seconds_to_rest(bridge, 90.0)
        assert not bridge.controller.end_watch.is_watching, "it is not fought for without end"
        assert bridge.sent_requests().count(b":Q#") <= 9


async def test_repeated_stop_does_not_end_an_arrow_begun_after_it() -> None:
    async with bridge_to("autostar") as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(3.0)
        client.send(b":Q#")
        await asyncio.sleep(0.2)
        client.send(b":Me#")
        for _ in range(20):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        assert bridge.sent_requests().count(b":Q#") == 1
        assert set(bridge.sim.arrows) == {1}
