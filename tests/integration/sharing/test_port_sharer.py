"""LX200 on both sides: several programs share one mount, each with a precision and a target of its own."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
def test_programs_that_share_a_meade_keep_precision_and_target_apart(model: str) -> None:
    async def program() -> None:
        async with Bridge(model, driven="lx200", presented="lx200", surface=model) as bridge:
            one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
            assert await one.ask(b":GR#:GD#", until=b"00#") == await other.ask(b":GR#:GD#", until=b"00#")
            other.tell(b":U#")
            assert len(await other.ask(b":GR#")) == 8
            assert len(await one.ask(b":GR#")) == 9
            one.tell(b":LM42#")  # the gateway's own library: its target is this client's alone
            assert await one.ask(b":MS#") == b"0"
            assert any(sent.startswith(b":Sr05:36:3") for sent in bridge.sent())
            one.tell(b":Q#")
            await asyncio.sleep(1)
            assert (await one.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b"110")).startswith(b"11")
            while await one.ask(b":D#") == b"\x7f#":
                await asyncio.sleep(1)
            assert await other.ask(b":U#:GR#") == b"07:00:00#"

    run(program())
