"""A read that many wait for belongs to all of them; and none waits for ever because another comes just before it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.integration.safety.test_by_hand import ready
from tests.support.in_process_gateway import Bridge
from tests.support.sampling import as_a_rule


@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
def test_stop_of_a_motion_not_yet_begun_cancels_no_shared_read(presented: str) -> None:
    """An arrow right after a stop waits for the position; so do programs that poll, and the next stop is theirs not."""
    question, stop = (b":GR#", b":Q#") if presented == "lx200" else (b"e", b"M")
    arrow = b":Mn#" if presented == "lx200" else b"P\x02\x11\x24\x09\0\0\0"

    async def program(late: float) -> None:
        async with Bridge(
            "cge", presented=presented, surface=None, latency=0.1, config={"lowest": -90.0}, speed=4.0
        ) as bridge:
            hand, other = bridge.client("127.0.0.1"), bridge.client("127.0.0.2")
            await bridge.controller.perform(op.Goto(100.0, 40.0))
            await ready(bridge, hand, question)
            hand.send(b":RS#" + arrow if presented == "lx200" else arrow)
            await asyncio.sleep(2.0)
            await bridge.controller.stop()
            hand.send(arrow)
            await asyncio.sleep(late)
            answer = asyncio.create_task(other.ask(question, 3.0))
            await asyncio.sleep(0.02)
            hand.send(stop)
            bridge.controller.begin_stop()
            assert await answer

    for step in range(0, 13, as_a_rule(3, whole=1)):
        run(program(0.04 * step))


async def test_client_that_gives_up_a_read_does_not_cancel_it_for_others() -> None:
    async with Bridge("cge") as bridge:
        waiting = asyncio.create_task(bridge.controller.read_now(op.Position()))
        other = asyncio.create_task(bridge.controller.read_now(op.Position()))
        await asyncio.sleep(0.01)
        waiting.cancel()
        assert isinstance(await other, op.Equatorial)


def stray(bridge: Any, data: bytes) -> None:
    """Bytes come that nobody asked for: from now on some quiet is wanted before a question like the last one."""
    bridge.controller.line.wire.deliver(data)


@pytest.mark.parametrize("mount", ["lx200gps", "autostar", "lx200-16"])
@pytest.mark.parametrize("latency", [0.1, 0.15, 0.2])
async def test_end_of_a_goto_is_noticed_after_a_stray_byte(mount: str, latency: float) -> None:
    """Two halves of a position fill a slow line nearly, and the bars of :D# come in the pauses between."""
    async with Bridge(mount, driven="lx200", presented="nexstar", surface="6-8se", latency=latency) as bridge:
        client = bridge.client()
        stray(bridge, b"\x15")
        assert await client.ask(b"r34000000,10000000", 20.0) == b"#"
        await asyncio.sleep(5.0)
        assert bridge.sim.slewing
        while bridge.sim.slewing:
            await asyncio.sleep(0.5)
        await asyncio.sleep(5.0)
        assert await client.ask(b"L", 5.0, ending=b"#") == b"0#"
        assert not bridge.controller.moving
