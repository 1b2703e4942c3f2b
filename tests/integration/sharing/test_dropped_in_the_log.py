"""Bytes of a program that nothing comes of stand in the log, with the reason."""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.lx200 import framing as lx200
from gateway.protocols.nexstar.framing import NexStarFramer
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge


def _dropped(bridge: Bridge) -> list[tuple[bytes, str]]:
    return [(entry.data, entry.note) for entry in bridge.entries if entry.arrow == "x"]


@pytest.mark.parametrize(
    ("said", "dropped"),
    [
        (b"Ka:GR#", (b"Ka", lx200.NOISE)),
        (b"GR#", (b"GR", lx200.NOISE)),
        (b"\xff\xfe:GR#:GD#", (b"\xff\xfe", lx200.NOISE)),
        (b":GR\x06:GR#", (b":GR", lx200.NO_HASH)),
        (b":G:GR#", (b":G", lx200.NO_HASH)),
        (b"$X:GR#", (b"$X", lx200.NOISE)),
        (b":" + b"z" * 70 + b"#:GR#", (b":" + b"z" * 64, lx200.TOO_LONG)),
    ],
)
async def test_noise_on_an_lx200_surface_is_logged_with_the_reason(said: bytes, dropped: tuple[bytes, str]) -> None:
    async with Bridge() as bridge:
        bridge.client().send(said)
        await asyncio.sleep(0.5)
        assert dropped in _dropped(bridge)


@pytest.mark.parametrize(
    ("said", "dropped"),
    [
        (b":GR#", (b":GR#", NexStarFramer.noise_reason)),
        (b"e\xffJ", (b"\xffJ", NexStarFramer.noise_reason)),
        (b"GET / HTTP/1.0", (b"GET / HTTP/1.0", NexStarFramer.noise_reason)),
    ],
)
async def test_noise_on_a_nexstar_surface_is_logged_with_the_reason(said: bytes, dropped: tuple[bytes, str]) -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge") as bridge:
        bridge.client().send(said)
        await asyncio.sleep(0.5)
        assert dropped in _dropped(bridge)


async def test_incomplete_nexstar_command_is_logged_with_the_reason() -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        client.send(b"R34AB")
        await asyncio.sleep(2.0)
        client.send(b"e")
        client.send(b"R34")
        client.close()
        await asyncio.sleep(0.5)
        assert _dropped(bridge) == [(b"R34AB", NexStarFramer.partial_reason), (b"R34", NexStarFramer.cut_off_reason)]


async def test_half_a_command_at_the_end_of_a_connection_is_logged() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        client.send(b":GR")
        client.close()
        assert _dropped(bridge) == [(b":GR", lx200.NO_HASH)]


async def test_bytes_of_an_unrecognised_client_are_logged_as_dropped() -> None:
    async with Bridge() as bridge:
        caller = Caller(bridge.acceptor)
        caller.tell(b"V")
        await asyncio.sleep(5.0)
        caller.close()
        assert [data for data, _ in _dropped(bridge)] == [b"V"]


async def test_duplicate_stop_and_orders_cancelled_by_a_stop_are_logged() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        client.send(b":Q#:Q#:Q#")
        client.send(b":Sr05:00:00#:Sd+10*00:00#:MS#:Me#:Qe#")
        await asyncio.sleep(3.0)
        dropped = [data for data, _ in _dropped(bridge)]
        assert dropped == [b":Q#", b":Q#", b":Me#"]


async def test_harmless_bytes_are_not_logged_as_lost() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        assert await client.ask(b"#:GR#\r\n\0", ending=b"#") != b""
        await asyncio.sleep(1.0)
        assert _dropped(bridge) == []


@pytest.mark.parametrize("framer", [lx200.Lx200Framer, NexStarFramer])
def test_hours_of_noise_take_no_memory(framer: type[lx200.Lx200Framer] | type[NexStarFramer]) -> None:
    cutting = framer()
    for _ in range(100):
        cutting.feed(b"\xff" * 1000, 0.0)
    assert sum(len(data) for data in cutting.dropped.values()) == 1000
