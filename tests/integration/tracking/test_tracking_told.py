"""What a program is told of tracking: the mode that was set, which a key held down on a Meade does not change.

NexStar protocol: ``t`` tells 0 off, 1 alt-az, 2 EQ north, 3 EQ south. A Meade stops tracking while an arrow is pressed,
and says so by ``:GW#`` (N in its second place).
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.support.in_process_gateway import Bridge

MOUNTS = [("autostar", False), ("lx200gps", False), ("autostar", True), ("lx200gps", True)]


@asynccontextmanager
async def over(mount: str, wedge: bool) -> AsyncIterator[Bridge]:
    """A fork; one on a wedge was put there at its keys before the gateway looks at it again."""
    async with Bridge(
        mount, driven="lx200", presented="nexstar", surface="cpc", config={"lowest": -90.0, "sun": 0.0}
    ) as bridge:
        if wedge:
            bridge.sim.connection()(b":AP#")
            await asyncio.sleep(8.0)
        yield bridge


@pytest.mark.parametrize(("mount", "wedge"), MOUNTS)
@pytest.mark.parametrize("key", [3, 5, 7])
async def test_arrow_motion_does_not_change_the_reported_tracking_mode(mount: str, wedge: bool, key: int) -> None:
    mode = bytes((2 if wedge else 1,)) + b"#"
    async with over(mount, wedge) as bridge:
        client = bridge.client()
        assert await client.ask(b"t") == mode
        for axis in (0x10, 0x11):
            assert await client.ask(bytes((80, 2, axis, 0x24, key, 0, 0, 0))) == b"#"
            for _ in range(30):
                assert await client.ask(b"t") == mode, "while it is held"
                await asyncio.sleep(0.2)
            assert await client.ask(bytes((80, 2, axis, 0x24, 0, 0, 0, 0))) == b"#"
            for _ in range(30):
                assert await client.ask(b"t") == mode, "after it"
                await asyncio.sleep(0.1)
        assert bridge.sim.tracking


@pytest.mark.parametrize(("mount", "wedge"), MOUNTS)
async def test_restoring_the_mode_that_was_read_leaves_tracking_on(mount: str, wedge: bool) -> None:
    async with over(mount, wedge) as bridge:
        client = bridge.client()
        assert await client.ask(b"P\x02\x10\x24\x04\0\0\0") == b"#"
        await asyncio.sleep(4.0)
        told = await client.ask(b"t")
        assert await client.ask(b"P\x02\x10\x24\0\0\0\0") == b"#"
        assert await client.ask(b"T" + told[:1]) == b"#"
        await asyncio.sleep(4.0)
        assert bridge.sim.tracking
        assert b":AL#" not in bridge.sent_requests()


@pytest.mark.parametrize(("mount", "wedge"), MOUNTS)
async def test_tracking_that_is_off_is_reported_as_off_during_a_goto_or_an_arrow(mount: str, wedge: bool) -> None:
    async with over(mount, wedge) as bridge:
        client = bridge.client()
        assert await client.ask(b"T\0") == b"#"
        await asyncio.sleep(3.0)
        assert await client.ask(b"t") == b"\0#"
        ra, dec = bridge.sim.true_position()
        words = [round((angle % 360.0) / 360.0 * 2**32) for angle in (ra + 30.0, dec - 10.0)]
        assert await client.ask(f"r{words[0]:08X},{words[1]:08X}".encode()) == b"#"
        for _ in range(150):
            await asyncio.sleep(0.2)
            assert await client.ask(b"t") == b"\0#"
        assert await client.ask(b"P\x02\x11\x24\x07\0\0\0") == b"#"
        for _ in range(8):
            await asyncio.sleep(0.5)
            assert await client.ask(b"t") == b"\0#", "while a key is held"
        assert await client.ask(b"P\x02\x11\x24\0\0\0\0") == b"#"
        await asyncio.sleep(3.0)
        assert not bridge.sim.tracking


@pytest.mark.parametrize(("mount", "wedge"), MOUNTS)
async def test_tracking_switched_off_during_an_arrow_stays_off(mount: str, wedge: bool) -> None:
    async with over(mount, wedge) as bridge:
        client = bridge.client()
        assert await client.ask(b"P\x02\x10\x24\x04\0\0\0") == b"#"
        await asyncio.sleep(4.0)
        assert await client.ask(b"T\0") == b"#"
        assert await client.ask(b"P\x02\x10\x24\0\0\0\0") == b"#"
        await asyncio.sleep(4.0)
        assert not bridge.sim.tracking
        assert await client.ask(b"t") == b"\0#"
