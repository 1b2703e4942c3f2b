"""A goto to a place over the horizon leaves the drive of an equatorial mount as the program left it: off.

Judged by the true axes: the tube stands within two minutes of arc of the place, and stays there.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.astro.spherical import hour_angle_to_horizon, separation
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.protocols.mechanics.simulated import Simulated
from tests.support import exact_sky

START = 1769634000.0
NORTH, SOUTH = (45.0, 10.0), (-34.0, 10.0)
#: Mount, protocol, site, what its owner tells it before: a Meade is polar after :AP.
MOUNTS = [
    ("cgem", "nexstar", NORTH, b""), ("cgem", "nexstar", SOUTH, b""), ("cge", "nexstar", NORTH, b""),
    ("lx200gps", "lx200", NORTH, b":AP#"), ("autostar", "lx200", NORTH, b":AP#"),
    ("german", "alpaca", NORTH, b""), ("polar", "alpaca", SOUTH, b""),
]  # fmt: skip
#: Degrees: how far from the place.
NEAR = 2.0 / 60.0


def horizon(sim: Simulated) -> tuple[float, float]:
    ra, dec = sim.true_position()
    sky = sim.mechanics.true_sky
    return hour_angle_to_horizon(sky.lst(sim.now) - ra, dec, sky.latitude)


async def ask(program: RehearsalClient, line: str) -> Any:
    told = json.loads(await program.ask(line.encode() + b"\n", ending=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


def over(mount: tuple[str, str, tuple[float, float], bytes], presented: str) -> RehearsalGateway:
    stage = RehearsalGateway(
        mount[0], start=START, driven=mount[1], presented=presented, site=mount[2], named=True, config={"sun": 0.0}
    )
    if mount[3]:
        stage.sim.feed(mount[3])
    return stage


@pytest.mark.parametrize("hours", [-3.0, 3.0])
@pytest.mark.parametrize(("az", "alt"), [(150.0, 45.0), (250.0, 30.0), (20.0, 60.0)])
@pytest.mark.parametrize("mount", MOUNTS, ids=lambda one: f"{one[0]}{one[2][0]:+.0f}")
async def test_equatorial_drive_stays_off_after_an_alpaca_alt_az_goto(
    mount: Any, az: float, alt: float, hours: float
) -> None:
    async with over(mount, "alpaca") as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        await ask(client, "put connect")
        ra = (await ask(client, "get siderealtime") - hours) % 24.0
        await ask(client, f"put slewtocoordinatesasync RightAscension={ra} Declination={mount[2][0] / 3.0}")
        while await ask(client, "get slewing"):
            await asyncio.sleep(0.5)
        assert await ask(client, "put tracking Tracking=false") is None
        assert await ask(client, f"put slewtoaltazasync Azimuth={az} Altitude={alt}") is None
        while await ask(client, "get slewing"):
            assert await ask(client, "get tracking") is False
            await asyncio.sleep(0.5)
        first = horizon(own.sim)
        assert separation(*first, az, alt) < NEAR
        await asyncio.sleep(60.0)
        assert await ask(client, "get tracking") is False
        assert separation(*horizon(own.sim), *first) < 2.0 / 3600.0, "it stands"


@pytest.mark.parametrize("mount", MOUNTS[:2], ids=lambda one: f"{one[0]}{one[2][0]:+.0f}")
async def test_equatorial_drive_stays_off_after_an_lx200_alt_az_goto(mount: Any) -> None:
    async with over(mount, "lx200") as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        client.send(b":AL#")
        await asyncio.sleep(1.0)
        assert await client.ask(b":Sz150*00#") + await client.ask(b":Sa+45*00#") == b"11"
        assert await client.ask(b":MA#") == b"0"
        while await client.ask(b":D#") != b"#":
            await asyncio.sleep(0.5)
        assert separation(*horizon(own.sim), 150.0, 45.0) < NEAR
        assert (await client.ask(b":GW#"))[1:2] == b"N"


async def test_equatorial_drive_stays_off_after_an_alt_az_goto_with_emulated_sync() -> None:
    """The mount itself goes to where the place is without that sync, by its axes."""
    async with over(("gt", "nexstar", NORTH, b""), "alpaca") as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        await ask(client, "put connect")
        ra, dec = await ask(client, "get rightascension"), await ask(client, "get declination")
        assert await ask(client, f"put synctocoordinates RightAscension={ra - 0.07} Declination={dec + 1}") is None
        assert await ask(client, "put tracking Tracking=false") is None
        assert await ask(client, "put slewtoaltazasync Azimuth=100 Altitude=50") is None
        while await ask(client, "get slewing"):
            assert await ask(client, "get tracking") is False
            await asyncio.sleep(0.5)
        told = await ask(client, "get azimuth"), await ask(client, "get altitude")
        assert separation(*told, 100.0, 50.0) < NEAR
        assert separation(*horizon(own.sim), 100.0, 50.0) > 1.0, "the mount knows nothing of the sync"
        first = horizon(own.sim)
        await asyncio.sleep(60.0)
        assert separation(*horizon(own.sim), *first) < 2.0 / 3600.0, "it stands"


async def test_classic_that_cannot_stop_tracking_refuses_a_goto_over_the_horizon() -> None:
    async with over(("lx200", "lx200", NORTH, b""), "alpaca") as own:
        client = own.client()
        await ask(client, "put connect")
        assert await ask(client, "put slewtoaltazasync Azimuth=150 Altitude=45") == -0x400
        await asyncio.sleep(2.0)
        assert not own.sim.slewing
