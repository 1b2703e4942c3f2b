"""Tracking that somebody has switched at the mount's own keys is switched by the next order of a program."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize("mount", ["autostar", "lx200gps"])
@pytest.mark.parametrize("on", [True, False])
def test_an_order_is_sent_though_the_mount_was_thought_to_do_so_already(mount: str, on: bool) -> None:
    async def program() -> None:
        async with Bridge(mount, driven="lx200") as bridge:
            client, keys = bridge.client(), bridge.sim.connection()
            if not on:
                client.tell(b":AL#")
                await asyncio.sleep(2.0)
            keys(b":AL#" if on else b":AA#")
            assert bridge.sim.tracking is not on
            client.tell(b":AA#" if on else b":AL#")
            await asyncio.sleep(2.0)
            assert bridge.sim.tracking is on

    run(program())
