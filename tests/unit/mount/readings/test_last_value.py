"""Where the mount does not answer, a read is answered with the last value, and a state with what does no harm.

Both surfaces do alike: the position as it was told last for 10 s, a state for ever. A position that was never told is
answered with silence.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

#: What each surface asks where the mount points, and a reply's length.
PLACES = {"lx200": (b":GR#", 9), "nexstar": (b"e", 18)}


def cut(bridge: Bridge) -> None:
    """From now on the mount hears and says nothing."""
    wire: Any = bridge.controller.line.wire
    wire.feed = lambda data: b""


@pytest.mark.parametrize("presented", PLACES)
async def test_position_request_is_answered_while_a_classic_lx200_calculates(presented: str) -> None:
    async with Bridge("lx200", driven="lx200", presented=presented, surface=None) as bridge:
        question, length = PLACES[presented]
        client = bridge.client()
        await client.ask(question)
        await asyncio.sleep(1.5)  # what was told grows old
        bridge.controller.spawn(bridge.controller.perform(op.SetClock(bridge.clock() + 86400.0, 0.0)))
        for _ in range(30):
            began = bridge.controller.now()
            assert len(await client.ask(question, 4.0)) == length
            assert bridge.controller.now() - began < 3.5
            await asyncio.sleep(0.2)


@pytest.mark.parametrize("driven", ["lx200", "nexstar"])
@pytest.mark.parametrize("presented", PLACES)
async def test_last_position_is_repeated_for_ten_seconds(presented: str, driven: str) -> None:
    model = "lx200gps" if driven == "lx200" else "cpc"
    async with Bridge(model, driven=driven, presented=presented, surface=None) as bridge:
        question, length = PLACES[presented]
        client = bridge.client()
        told = await client.ask(question)
        cut(bridge)
        began = bridge.controller.now()
        while bridge.controller.now() < began + 6.0:
            assert await client.ask(question, 3.5) == told
            assert len(told) == length
            await asyncio.sleep(0.3)
        await asyncio.sleep(6.0)
        assert await client.ask(question, 4.0) == b""


@each("driven", ["lx200", "nexstar"])
async def test_nexstar_surface_reports_safe_states_without_a_mount(driven: str) -> None:
    model = "lx200gps" if driven == "lx200" else "cpc"
    bridge = Bridge(model, driven=driven, presented="nexstar", surface=None)
    cut(bridge)
    bridge.controller.start()
    await asyncio.sleep(1.0)
    client = bridge.client()
    assert await client.ask(b"L", 3.5) == b"0#"
    assert await client.ask(b"J", 3.5) == b"\0#"
    assert await client.ask(b"t", 3.5) == b"\0#"
    assert await client.ask(b"e", 4.0) == b""
    await bridge.controller.close()


@each("driven", ["lx200", "nexstar"])
async def test_lx200_surface_reports_safe_states_without_a_mount(driven: str) -> None:
    model = "lx200gps" if driven == "lx200" else "cpc"
    bridge = Bridge(model, driven=driven, presented="lx200", surface="autostar")
    cut(bridge)
    bridge.controller.start()
    await asyncio.sleep(1.0)
    client = bridge.client()
    assert await client.ask(b":D#", 3.5) == b"#"
    assert await client.ask(b":GW#", 3.5) == b"AN0"
    assert await client.ask(b":GR#", 4.0) == b""
    await bridge.controller.close()


async def test_altitude_and_azimuth_are_computed_where_the_telescope_lacks_them() -> None:
    async with Bridge("autostar", driven="lx200", surface="autostar") as bridge:
        wire: Any = bridge.controller.line.wire
        feed = wire.feed
        wire.feed = lambda data: b"" if data in (b":GA#", b":GZ#") else feed(data)
        client = bridge.client()
        for _ in range(10):
            assert (await client.ask(b":GA#", 3.5))[:5] == b"+45*0"
            assert (await client.ask(b":GZ#", 3.5))[:5] == b"180*0"
            await asyncio.sleep(1.0)
        assert bridge.sent_requests().count(b":GZ#") <= 3  # then it is known that nothing comes
        assert bridge.controller.line.state == "up"
