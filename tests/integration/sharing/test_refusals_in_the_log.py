"""Where a protocol has no form for no, what was refused stands in the log."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.wire_log import printable
from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize(
    "said",
    [b":$BZ100#", b":$BAxx#", b":Rg-1.0#", b":F0#", b":F9#", b":RA-1.0#", b":Mgn-5#", b":BD100#", b":hI990231000000#"],
)
async def test_refusal_of_an_lx200_command_that_has_no_reply_is_logged(said: bytes) -> None:
    async with Bridge("cge", surface="lx200gps") as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        client.send(said)
        await asyncio.sleep(1.0)
        assert client.received == b""
        assert any(said.decode()[:3] in entry.note and "refused" in entry.note for entry in bridge.entries)
        assert not [data for data in bridge.sent_requests()[before:] if data[:1] in (b"P", b"H", b"T")]


@pytest.mark.parametrize(
    "said",
    [
        b"T\x05",
        b"W\x5b\0\0\0\x0a\0\0\0",
        b"W\x2d\x3c\0\0\x0a\0\0\0",
        b"H\x18\0\0\1\1\x1a\0\0",
        b"H\x16\0\0\2\x1e\x1a\0\0",
        b"RZZZZ,1234",
        b"r1234ZZ00,12340000",
    ],
)
async def test_refused_nexstar_command_with_a_fixed_reply_is_logged(said: bytes) -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        assert await client.ask(said) == b"#"
        assert any(printable(said) in entry.note and "refused" in entry.note for entry in bridge.entries)
        assert not [data for data in bridge.sent_requests()[before:] if data[1:2] in (b"S", b"M", b"A")]


async def test_refusal_is_logged_once_for_every_host() -> None:
    async with Bridge("cge", surface="lx200gps") as bridge:
        for _ in range(2):
            client = bridge.client()
            client.send(b":F9#:F9#")
            await asyncio.sleep(1.0)
        assert sum("refused" in entry.note for entry in bridge.entries) == 1
