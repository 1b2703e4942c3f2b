"""No read waits for ever because another one, asked again and again, always comes just before its turn."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tests.support.in_process_gateway import Bridge
from tests.support.virtual import run


def stray(bridge: Any, data: bytes) -> None:
    """Bytes come that nobody asked for: from now on some quiet is wanted before a question like the last one."""
    bridge.controller.line.wire._deliver(data)


@pytest.mark.parametrize("mount", ["lx200gps", "autostar", "lx200-16"])
@pytest.mark.parametrize("latency", [0.1, 0.15, 0.2])
def test_the_end_of_a_goto_is_told_after_a_stray_byte(mount: str, latency: float) -> None:
    """Two halves of a position fill a slow line nearly, and the bars of :D# come in the pauses between."""

    async def program() -> None:
        async with Bridge(mount, driven="lx200", presented="nexstar", surface="6-8se", latency=latency) as bridge:
            client = bridge.client()
            stray(bridge, b"\x15")
            assert await client.ask(b"r34000000,10000000", 20.0) == b"#"
            await asyncio.sleep(5.0)
            assert bridge.sim.slewing
            while bridge.sim.slewing:
                await asyncio.sleep(0.5)
            await asyncio.sleep(5.0)
            assert await client.ask(b"L", 5.0, until=b"#") == b"0#"
            assert not bridge.controller.moving

    run(program())
