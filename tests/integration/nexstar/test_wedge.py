"""A Celestron fork on its wedge: equatorial, and its axes read from north all the same."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize(("site", "mode"), [((45.0, 10.0), b"T\x02"), ((-35.0, 150.0), b"T\x03")])
async def test_fork_on_a_wedge_refuses_axis_gotos_below_the_horizon(site: tuple[float, float], mode: bytes) -> None:
    """Azimuth 0 is north: under the pole in the north, on the meridian in the south."""
    async with Bridge("cpc", site=site, config={"site": site}, presented="nexstar", surface="cpc") as bridge:
        bridge.sim.feed(mode)
        await asyncio.sleep(10)
        above, below = (b"b80000000,00000000", b"b00000000,00000000")[:: 1 if site[0] > 0 else -1]
        client = bridge.client()
        await client.ask(below)
        await asyncio.sleep(5)
        assert below not in bridge.sent_requests()
        assert any("Object Below Horizon" in entry.note for entry in bridge.entries)
        await client.ask(above)
        await asyncio.sleep(5)
        assert above in bridge.sent_requests()


@pytest.mark.parametrize(("site", "mode"), [((45.0, 10.0), b"T\x02"), ((-35.0, 150.0), b"T\x03")])
async def test_fork_on_a_wedge_parks_at_the_pole(site: tuple[float, float], mode: bytes) -> None:
    async with Bridge("cpc", site=site, config={"site": site}) as bridge:
        bridge.sim.feed(mode)
        await asyncio.sleep(10)
        bridge.client().send(b":hP#")
        await asyncio.sleep(90)
        assert abs(bridge.sim.mechanics.true_position(bridge.clock())[1]) > 89.5
        assert not bridge.sim.tracking
