"""A NexStar program whose command is interrupted: its end, which arrives too late, moves nothing; a release ends."""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.nexstar.framing import NexStarFramer
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving

CUT = [
    (b"r34A", b"B0500,12CE0500"),
    (b"W", b"T\0T\0T\0T\0"),
    (b"H\x0f\x1a\0\x04\x06\x05", b"T\0"),
    (b"P\x02\x10", b"T\0\0\0\0"),
    (b"K", b"x"),
]


def _bridge() -> Bridge:
    return Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge")


@pytest.mark.parametrize(("half", "end"), CUT)
@pytest.mark.parametrize("apart", [None, 0.03])
async def test_end_of_an_interrupted_nexstar_command_moves_nothing(
    half: bytes, end: bytes, apart: float | None
) -> None:
    async with _bridge() as bridge:
        client = bridge.client()
        assert await client.ask(b"Kz", ending=b"#") == b"z#"
        client.send(half)
        await asyncio.sleep(1.2)
        sent = len(bridge.sent_requests())
        for piece in [end] if apart is None else [end[at : at + 1] for at in range(len(end))]:
            client.send(piece)
            await asyncio.sleep(apart or 0.0)
        await asyncio.sleep(3.0)
        assert not [frame for frame in bridge.sent_requests()[sent:] if frame.startswith((b":M", b":A", b":S", b":h"))]
        assert not moving(bridge.sim)
        assert (end, NexStarFramer.late_reason) in [(entry.data, entry.note) for entry in bridge.entries]
        assert await client.ask(b"Kz", ending=b"#") == b"z#"


@pytest.mark.parametrize("length", range(1, 8))
async def test_interrupted_nexstar_arrow_is_released(length: int) -> None:
    async with _bridge() as bridge:
        client, other = bridge.client(), bridge.client()
        other.send(b"P\x02\x10$\x07\0\0\0")
        await asyncio.sleep(1.0)
        assert moving(bridge.sim)
        client.send(b"P\x02\x10$\x09\0\0\0"[:length])
        await asyncio.sleep(1.1)
        assert await client.ask(b"P\x02\x10$\0\0\0\0", ending=b"#") == b"#"
        await asyncio.sleep(2.0)
        assert not moving(bridge.sim)


async def test_nexstar_request_after_an_interrupted_command_waits_only_briefly() -> None:
    async with _bridge() as bridge:
        client = bridge.client()
        assert await client.ask(b"e", ending=b"#") != b""
        client.send(b"P\x02")
        await asyncio.sleep(1.5)
        began = bridge.controller.now()
        assert len(await client.ask(b"e", ending=b"#")) == 18
        assert bridge.controller.now() - began < 0.5
