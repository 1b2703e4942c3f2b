"""What a client has sent and nobody has read yet does not undo a stop."""

from __future__ import annotations

import asyncio

import pytest

from gateway.transport.tcp import READ_BYTES
from tests.support.in_process_gateway import Bridge

ARROWS = b":RM#:Me#" * (4 * READ_BYTES // 8)


def shares(data: bytes) -> list[bytes]:
    """As a port reads them."""
    return [data[at : at + READ_BYTES] for at in range(0, len(data), READ_BYTES)]


@pytest.mark.parametrize("who", ["another program", "mount-gateway stop"])
async def test_commands_sent_before_a_stop_begin_no_motion_after_it(who: str) -> None:
    async with Bridge("cge") as bridge:
        bully, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        first, *rest = shares(ARROWS)
        bully.send(first)
        await asyncio.sleep(2.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}
        other.send(b":Q#") if who == "another program" else bridge.controller.begin_stop()
        for share in rest:
            await asyncio.sleep(0.05)
            bully.send(share)
        await asyncio.sleep(4.0)
        assert not bridge.controller.moving
        assert not bridge.sim.slewing
        assert bridge.sim.tracking


async def test_client_with_no_backlog_left_moves_the_mount_again() -> None:
    async with Bridge("cge") as bridge:
        bully, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        bully.send(shares(ARROWS)[0])
        await asyncio.sleep(1.0)
        other.send(b":Q#")
        bully.send(b":Me#")  # the rest of what it had sent
        await asyncio.sleep(3.0)
        assert not bridge.controller.moving
        bully.send(b":Me#")
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}


async def test_client_can_move_the_mount_again_long_after_a_backlog() -> None:
    async with Bridge("cge") as bridge:
        client, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        client.send(b":GR#" * (READ_BYTES // 4))
        await asyncio.sleep(30.0)
        other.send(b":Q#")
        await asyncio.sleep(30.0)
        client.send(b":RM#:Me#")
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}
