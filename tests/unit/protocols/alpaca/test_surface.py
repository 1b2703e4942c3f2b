"""The Alpaca surface over a whole gateway on virtual time: motions are told exactly as long as they last."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.clients.access import AccessRules
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from tests.support import exact_sky

START = 1769634000.0
CRAB = "RightAscension=5.5756 Declination=22.0145"


def stage(mount: str = "6-8se", driven: str = "nexstar", **settings: Any) -> RehearsalGateway:
    return RehearsalGateway(mount, start=START, driven=driven, presented="alpaca", named=True, **settings)


async def ask(program: RehearsalClient, line: str) -> Any:
    """A value; an error as its number."""
    told = json.loads(await program.ask(line.encode() + b"\n", ending=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


async def connected(own: RehearsalGateway, host: str = "127.0.0.1") -> RehearsalClient:
    client = own.client(host)
    assert await ask(client, "put connected Connected=True") is None
    assert await ask(client, "get connected") is True
    return client


async def test_axis_moved_by_a_vanished_alpaca_program_stops_after_half_a_minute() -> None:
    """Half a minute after its last request the axis rests; the requests of another program do not hold it."""
    async with stage() as own:
        client, other = await connected(own), await connected(own, "192.0.2.7")
        await ask(client, "put moveaxis Axis=1 Rate=0.1")
        for _ in range(28):
            await asyncio.sleep(1.0)
            assert await ask(other, "get slewing") is True
        await asyncio.sleep(4.0)
        assert await ask(other, "get slewing") is False


async def test_alpaca_abort_ends_all_motion_of_any_program() -> None:
    async with stage() as own:
        client, other = await connected(own), own.client("192.0.2.7")
        await ask(client, f"put slewtocoordinatesasync {CRAB}")
        await asyncio.sleep(1.0)
        assert own.sim.slewing
        assert await ask(other, "put abortslew") is None, "also of a program that has not connected"
        await asyncio.sleep(2.0)
        assert not own.sim.slewing and await ask(client, "get slewing") is False


async def test_read_only_alpaca_program_can_stop_but_change_nothing() -> None:
    async with stage(access=AccessRules(read_only=True)) as own:
        client = await connected(own)
        assert isinstance(await ask(client, "get rightascension"), float)
        for line in (f"put slewtocoordinatesasync {CRAB}", "put tracking Tracking=false", "put park",
                     "put utcdate UTCDate=2020-01-01T00:00:00Z", "put sitelatitude SiteLatitude=10"):  # fmt: skip
            assert await ask(client, line) == -0x40B, line
        assert await ask(client, "put abortslew") is None, "a stop is never refused"
        assert not own.sim.slewing


@pytest.mark.parametrize("latitude", [45.0, -45.0])
@pytest.mark.parametrize(("mount", "version"), [("cge", "4.21"), ("cgem", "5.31")])
async def test_alpaca_pier_side_after_a_goto_is_the_predicted_one(mount: str, version: str, latitude: float) -> None:
    """East of the pier it looks west, in either hemisphere and whatever letter the hand control tells."""
    async with stage(mount, version=version, site=(latitude, 10.0), speed=20.0) as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = await connected(own)
        for hours, side in ((2.0, 0), (-2.0, 1)):
            ra = (await ask(client, "get siderealtime") - hours) % 24.0
            place = f"RightAscension={ra} Declination={latitude / 3.0}"
            assert await ask(client, f"get destinationsideofpier {place}") == side
            assert await ask(client, f"put slewtocoordinatesasync {place}") is None
            while await ask(client, "get slewing"):
                await asyncio.sleep(0.5)
            assert await ask(client, "get sideofpier") == side
