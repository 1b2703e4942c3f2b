"""Several programs share one mount of their own kind: what is theirs alone, and what is passed on to it."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
async def test_programs_that_share_a_meade_have_separate_precision_and_target(model: str) -> None:
    async with Bridge(model, driven="lx200", presented="lx200", surface=model) as bridge:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        assert await one.ask(b":GR#:GD#", ending=b"00#") == await other.ask(b":GR#:GD#", ending=b"00#")
        other.send(b":U#")
        assert len(await other.ask(b":GR#")) == 8
        assert len(await one.ask(b":GR#")) == 9
        one.send(b":LM42#")  # the gateway's own library: its target is this client's alone
        assert await one.ask(b":MS#") == b"0"
        assert any(sent.startswith(b":Sr05:36:3") for sent in bridge.sent_requests())
        one.send(b":Q#")
        await asyncio.sleep(1)
        assert (await one.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", ending=b"110")).startswith(b"11")
        while await one.ask(b":D#") == b"\x7f#":
            await asyncio.sleep(1)
        assert await other.ask(b":U#:GR#") == b"07:00:00#"


async def test_nexstar_surface_of_a_named_model_passes_raw_motion_only_to_focusers() -> None:
    """Device 0 is all on the bus; 0x0b and 0x04 run to a switch or an index; 0x81, 0x84 and 0x31 write memory."""
    async with Bridge("cge", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        for raw in (
            b"P\2\0\x24\t\0\0\0", b"P\1\x10\x0b\0\0\0\0", b"P\4\0\2\x10\0\0\0", b"P\4\0\x17\x10\0\0\0",
            b"P\4\0\6\x10\0\0\0", b"P\4\x10\4\0\0\0\0", b"P\2\x10\x81\0\0\0\1", b"P\2\x10\x31\0\0\0\1",
            b"P\2\x10\x84\0\0\0\1",
        ):  # fmt: skip
            await client.ask(raw, 2)
            assert raw not in bridge.sent_requests()
        for passed in (b"P\2\x12\x24\3\0\0\0", b"P\1\x10\x12\0\0\0\1"):
            await client.ask(passed, 2)
            assert passed in bridge.sent_requests()
