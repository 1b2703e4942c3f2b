"""Guide pulses mean the sky for Alpaca programs and the motor for others, and every surface can be told otherwise."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.mount.policy import Limits
from tests.support import exact_sky
from tests.support.each import each

START = 1769634000.0
NORTH, SOUTH = (45.0, 10.0), (-34.0, 10.0)


async def ask(program: RehearsalClient, line: str) -> Any:
    told = json.loads(await program.ask(line.encode() + b"\n", ending=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


async def declination_after(own: RehearsalGateway, direction: int) -> float:
    """Guide for two seconds; return the change of the true declination, arcseconds."""
    client = own.client()
    await ask(client, "put connect")
    before = own.sim.true_position()[1]
    assert await ask(client, f"put pulseguide Direction={direction} Duration=2000") is None
    await asyncio.sleep(4.0)
    return (own.sim.true_position()[1] - before) * 3600.0


@pytest.mark.parametrize("hours", [-3.0, 3.0])
@pytest.mark.parametrize("site", [NORTH, SOUTH], ids=["north", "south"])
@pytest.mark.parametrize("mount", ["cgem", "cge"])
async def test_alpaca_pulse_north_raises_the_declination_on_both_pier_sides(
    mount: str, site: tuple[float, float], hours: float
) -> None:
    async with RehearsalGateway(
        mount, start=START, presented="alpaca", named=True, site=site, config={"sun": 0.0}
    ) as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        await ask(client, "put connect")
        ra = (await ask(client, "get siderealtime") - hours) % 24.0
        await ask(client, f"put slewtocoordinatesasync RightAscension={ra} Declination={site[0] / 3.0}")
        while await ask(client, "get slewing"):
            await asyncio.sleep(0.5)
        await asyncio.sleep(2.0)
        assert await declination_after(own, 0) == pytest.approx(15.0, rel=0.1)
        assert await declination_after(own, 1) == pytest.approx(-15.0, rel=0.1)


@each(
    ("protocol", "surface", "mount", "by_sky"),
    [
        ("alpaca", None, None, True),
        ("lx200", None, None, False),
        ("alpaca", None, "motor", False),
        ("lx200", None, "sky", True),
        ("alpaca", "motor", "sky", False),
        ("lx200", "sky", "motor", True),
    ],
)
def test_guide_direction_setting_of_the_surface_beats_mount_and_protocol(
    protocol: str, surface: str | None, mount: str | None, by_sky: bool
) -> None:
    config = SurfaceConfig(at="-", guide_directions=surface)  # type: ignore[arg-type]
    made = make_surface(Endpoint(protocol, "-"), config, Limits(), mount)
    assert made.settings.guides_by_sky is by_sky
