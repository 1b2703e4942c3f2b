"""What the axis readings of a hand control mean: azimuth and altitude of a fork, the hour angle on a polar mount.

A fork on its wedge reads from north, where its azimuth axis points at the pole: 180 on the meridian in the north, 0 in
the south. A German mount reads its hour angle (NexStar protocol, Get Position; both 90 at its index, the pole).
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.nexstar_flows import place, precise, settled

NORTH, SOUTH = (45.0, 10.0), (-34.0, 18.5)
MOUNTS = [("lx200", "lx200"), ("lx200", "lx200-16"), ("nexstar", "cpc")]


async def arrived(bridge: Bridge, client: RehearsalClient, hour_angle: float, dec: float) -> None:
    sidereal = await bridge.controller.answer(op.SiderealTime())
    await bridge.controller.perform(op.Goto((sidereal - hour_angle) % 360.0, dec))
    await asyncio.sleep(1.0)
    await settled(client, 300.0)
    await asyncio.sleep(3.0)


@pytest.mark.parametrize("site", [NORTH, SOUTH], ids=["north", "south"])
@pytest.mark.parametrize(("driven", "mount"), MOUNTS, ids=[mount for _, mount in MOUNTS])
@pytest.mark.parametrize("model", ["cpc", "cge"])
async def test_axis_readings_of_an_equatorial_fork_are_hour_angle_and_declination(
    model: str, driven: str, mount: str, site: tuple[float, float]
) -> None:
    north = 1.0 if site is NORTH else -1.0
    zero = 180.0 if site is NORTH and model == "cpc" else 0.0
    async with Bridge(
        mount, driven=driven, presented="nexstar", surface=model, site=site, config={"lowest": -90.0, "sun": 0.0}
    ) as bridge:
        if driven == "nexstar":
            bridge.sim.feed(b"T\x02" if site is NORTH else b"T\x03")
            await asyncio.sleep(10.0)
        client = bridge.client()
        await arrived(bridge, client, 30.0, north * 20.0)
        first, second = place(await client.ask(b"z"))
        turned = 15.04 / 3600.0 * 30.0
        assert wrap180(first - zero - north * 30.0) == pytest.approx(0.0, abs=2.0 * turned)
        assert second == pytest.approx(20.0, abs=0.01)
        for device, reading in ((b"\x10", first), (b"\x11", second)):
            told = await client.ask(b"P\x01" + device + b"\x01\0\0\0\x03")
            assert wrap180(int.from_bytes(told[:3], "big") / 2**24 * 360.0 - reading) == pytest.approx(0.0, abs=0.1)
        # from elsewhere it comes back to what was read
        there = bridge.sim.true_position()
        await arrived(bridge, client, -20.0, north * 40.0)
        assert await client.ask(precise(b"b", first, second)) == b"#"
        await asyncio.sleep(1.0)
        await settled(client, 300.0)
        assert separation(*bridge.sim.true_position(), *there) < 1.0, "the sky has moved on, no more"
        # one axis alone: the other stays
        assert await client.ask(b"P\x04\x11\x02\x1c\x71\xc7\0") == b"#"  # 40 degrees
        await asyncio.sleep(1.0)
        await settled(client, 300.0)
        now = place(await client.ask(b"z"))
        assert now[1] == pytest.approx(40.0, abs=0.01) and abs(wrap180(now[0] - first)) < 1.0
