"""Backlash is one setting for each sense of a motor on a hand control; what a program sets of one leaves the other."""

from __future__ import annotations

import asyncio

from tests.support.in_process_gateway import Bridge


async def test_backlash_of_one_direction_leaves_the_other_unchanged() -> None:
    """Celestron's motor commands 0x10 and 0x11, read back by 0x40 and 0x41."""
    async with Bridge("cpc", presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        assert await client.ask(b"P\x02\x10\x10\x21\x00\x00\x00", ending=b"#") == b"#"
        assert await client.ask(b"P\x02\x10\x11\x2c\x00\x00\x00", ending=b"#") == b"#"
        sent = bridge.sent_requests()
        assert sent.count(b"P\x02\x10\x10\x21\x00\x00\x00") == sent.count(b"P\x02\x10\x11\x2c\x00\x00\x00") == 1
        assert not [command for command in sent if command[:5] in (b"P\x02\x10\x11\x21", b"P\x02\x10\x10\x2c")]
        assert await client.ask(b"P\x01\x10\x40\x00\x00\x00\x01", ending=b"#") == b"\x21#"
        assert await client.ask(b"P\x01\x10\x41\x00\x00\x00\x01", ending=b"#") == b"\x2c#"


async def test_lx200_program_sets_backlash_of_both_directions_as_one_value() -> None:
    async with Bridge("cpc", surface="lx200gps") as bridge:
        client = bridge.client()
        await client.ask(b":$BZ21#:GR#")
        await asyncio.sleep(1)
        assert {b"P\x02\x10\x10\x15\x00\x00\x00", b"P\x02\x10\x11\x15\x00\x00\x00"} <= set(bridge.sent_requests())
