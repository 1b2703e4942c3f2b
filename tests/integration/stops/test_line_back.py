"""A line that comes back: what moved when it was lost is ended, and a stop that is owed goes before everything."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

MEADES = ["lx200", "lx200-16", "autostar", "lx200gps"]
MOUNTS = [*MEADES, "cge", "cpc", "6-8se"]
STOPS = (b":Q#", b"#:Q#", b"M", b"P\x02\x10\x24\x00\x00\x00\x00", b"P\x02\x11\x24\x00\x00\x00\x00")


def bridge_to(mount: str) -> Bridge:
    return Bridge(mount, driven="lx200" if mount in MEADES else "nexstar", config={"lowest": -90.0, "sun": 0.0})


async def cut(bridge: Any, seconds: float) -> list[bytes]:
    """Pull the cable out for so long -> what is sent first when it is back."""
    wire = bridge.controller.line.wire
    opening = wire.open

    async def no_port(*callbacks: Any) -> None:
        raise OSError(2, "no such port")

    wire.open = no_port
    bridge.controller.line.transaction.connection_lost("unplugged")
    await asyncio.sleep(seconds)
    before = len(bridge.sent_requests())
    wire.open = opening
    while len(bridge.sent_requests()) == before:
        await asyncio.sleep(0.01)
    await asyncio.sleep(0.5)
    return bridge.sent_requests()[before:]


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("motion", [b":RM#:Me#", b":RS#:Mn#:Mw#", b":RC#:Ms#", b":Sr05:00:00#:Sd+30*00:00#:MS#"])
async def test_motion_from_before_a_lost_line_is_ended_when_the_line_is_back(mount: str, motion: bytes) -> None:
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(motion)
        for _ in range(20):
            client.send(b":GR#")
            await asyncio.sleep(0.1)
        assert bridge.controller.moving
        first = await cut(bridge, 4.0)
        assert first[0] in STOPS
        await asyncio.sleep(2.0)
        assert not truth_of(bridge.sim).moving
        assert not bridge.controller.wanted.stop_owed and not bridge.controller.moving
        assert [entry for entry in bridge.entries if "connection to the mount was lost during a motion" in entry.note]


@pytest.mark.parametrize("mount", MOUNTS)
async def test_stop_requested_while_the_line_was_lost_is_sent_first(mount: str) -> None:
    async with bridge_to(mount) as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        asyncio.get_running_loop().call_later(1.0, client.send, b":Q#")
        first = await cut(bridge, 4.0)
        assert first[0] in STOPS
        await asyncio.sleep(3.0)
        assert not bridge.controller.wanted.stop_owed


@pytest.mark.parametrize("mount", MOUNTS)
async def test_resting_mount_gets_no_stop_after_line_loss(mount: str) -> None:
    async with bridge_to(mount) as bridge:
        await asyncio.sleep(2.0)
        before = len(bridge.sent_requests())
        await cut(bridge, 4.0)
        await asyncio.sleep(10.0)
        assert not [sent for sent in bridge.sent_requests()[before:] if sent in STOPS]


async def test_stop_swallowed_by_half_a_hand_control_command_is_repeated() -> None:
    """The stop may be taken for the other half, so it is written again when the hand control has given that up."""
    async with bridge_to("cge") as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        transaction = bridge.controller.line.transaction
        transaction.half_command_sent, transaction.last_request = True, b"P\x02\x10\x24\x05\x00\x00\x00"
        began = bridge.controller.now()
        wire: Any = bridge.controller.line.wire
        feed, wire.feed = wire.feed, lambda data: b""
        assert (await cut(bridge, 0.1))[0] in STOPS
        assert bridge.controller.now() - began < 1.2
        await asyncio.sleep(began + 3.5 - bridge.controller.now())
        wire.feed = feed
        await asyncio.sleep(2.5)
        assert not truth_of(bridge.sim).moving


async def test_half_a_meade_command_is_closed_before_the_stop() -> None:
    async with bridge_to("autostar") as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        bridge.controller.line.transaction.half_command_sent = True
        assert (await cut(bridge, 0.1))[0] == b"#:Q#"
