"""Clients that are gone: what they sent counts for a second, their backlog begins nothing, what is due is answered."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.transport.listening import split_address
from gateway.transport.tcp import READ_BYTES, READ_PAUSE
from tests.support.in_process_gateway import Bridge
from tests.support.process import PATIENCE
from tests.unit.clients.test_backlog import shares

ARROWS = b":RM#:Me#" * 60_000


async def flood(visitor: Any, data: bytes, seconds: float) -> None:
    """As a port reads it."""
    for share in shares(data)[: round(seconds / READ_PAUSE)]:
        visitor.send(share)
        await asyncio.sleep(READ_PAUSE)


async def test_command_read_long_after_it_was_sent_moves_nothing() -> None:
    async with Bridge("cge") as bridge:
        bully = bridge.client("10.0.0.1")
        await flood(bully, ARROWS, 0.9)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}, "for a second it is as good as new"
        await flood(bully, ARROWS, 7.0)
        for _ in range(3):
            await flood(bully, ARROWS, 1.0)
            assert not bridge.controller.moving
        said = [entry.note for entry in bridge.entries if "sends commands faster" in entry.note]
        assert len(said) == 1


async def test_backlog_of_a_gone_client_stops_motion_but_starts_none() -> None:
    async with Bridge("cge") as bridge:
        gone, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        await flood(gone, b":GR#" * 20_000, 2.0)
        other.send(b":RM#:Mn#")
        await flood(gone, b":GR#" * 2000, 0.5)
        gone.received = b""
        gone.send((b":Sr05:00:00#:Sd+30*00:00#:MS#:RM#:Me#" + b":GR#" * READ_BYTES)[:READ_BYTES])
        await asyncio.sleep(1.0)
        assert gone.received.startswith(b"111Stopped.#")
        assert gone.received.endswith(b"#")
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        gone.send((b":Q#" + b":GR#" * READ_BYTES)[:READ_BYTES])
        await asyncio.sleep(2.0)
        assert not bridge.controller.moving


async def test_client_with_no_backlog_left_can_hold_an_arrow_again() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client("10.0.0.1")
        await flood(client, b":GR#" * 10_000, 3.0)
        for _ in range(12):
            client.send(b":GR#:Me#")
            await asyncio.sleep(0.1)
        client.send(b":RM#:Me#")
        await asyncio.sleep(20.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}
        client.send(b":Q#")


async def test_arrow_motion_ends_after_its_client_stopped_sending() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client("10.0.0.1")
        client.send(b":RM#:Me#")
        await asyncio.sleep(1.0)
        client.connection.peer_closed()
        await asyncio.sleep(7.0)
        assert not bridge.controller.moving


async def test_late_arrow_of_a_disconnected_client_does_not_keep_moving() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client("10.0.0.1")
        await flood(client, b":GR#" * 10_000, 3.0)
        client.connection.peer_closed()
        await asyncio.sleep(3.0)
        client.send(b":RM#:Me#")
        await asyncio.sleep(20.0)
        assert not bridge.controller.moving


# --- sockets ----------------------------------------------------------------------------------------------------------


async def _last_words(where: str, said: bytes) -> bytes:
    """Send commands over a connection of its own, and end it; return what comes until it is closed."""
    reader, writer = await asyncio.open_connection(*split_address(where))
    try:
        writer.write(said)
        writer.write_eof()
        async with asyncio.timeout(PATIENCE):
            return await reader.read()
    finally:
        writer.close()


@pytest.mark.real_time
@pytest.mark.parametrize("scheme", ["tcp", "rfc2217"])
async def test_client_that_stopped_sending_is_answered_before_its_connection_closes(scheme: str) -> None:
    mount = MountConfig(at="lx200:autostar@sim", latency=0.1, sun=0.0, lowest=-90.0)
    gateway = Gateway(mount, [SurfaceConfig(at=f"lx200@{scheme}://127.0.0.1:0")])
    await gateway.open()
    try:
        assert await gateway.wait_identified(PATIENCE)
        goto = b":Sa+40*00#:Sz180*00#:MA#", (b"110", b"111")  # done or refused: on a slow computer the line is busy
        for said, heard in ((b":GR#", b"#"), goto, (b":GVP#", b"#"), (b":D#", b"#")):
            end = time.monotonic() + PATIENCE
            while not (answer := await _last_words(gateway.ports[0].address, said)).endswith(heard):
                assert time.monotonic() < end, (said, answer)  # on a slow computer the mount may be silent once
    finally:
        await gateway.close()
