"""Which way a rate of ``MoveAxis`` turns each kind of mount: the table of docs/programs/arrows.md, by the true axes."""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import wrap180
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from tests.conformance.ascom.properties import connect
from tests.conformance.ascom.telescope import Telescope
from tests.conformance.ascom.test_judge import START
from tests.support import exact_sky

NORTH, SOUTH = 45.0, -34.0
#: Model, protocol, what its owner tells it, latitude, hour angle; and whether positive rates turn east, and north.
POLAR = [
    ("cgem", "nexstar", b"", NORTH, -3.0, False, False),
    ("cgem", "nexstar", b"", NORTH, 3.0, False, True),
    ("cgem", "nexstar", b"", SOUTH, -3.0, True, False),
    ("cgem", "nexstar", b"", SOUTH, 3.0, True, True),
    ("lx200gps", "lx200", b":AP#", NORTH, -3.0, False, True),
    ("lx200gps", "lx200", b":AP#", SOUTH, -3.0, True, False),
    ("lx200", "lx200", b"", NORTH, 3.0, False, True),
]


async def moved(scope: Telescope, axis: int, rate: float, horizontal: bool = False) -> float:
    """Return the degrees by which two seconds at this rate change what this axis is for."""

    async def read() -> float:
        if horizontal:
            return float(await scope.get("Altitude" if axis else "Azimuth"))
        return float(scope.own.sim.true_position()[axis])

    await scope.put("MoveAxis", Axis=axis, Rate=rate)
    before = await read()
    await asyncio.sleep(2.0)
    change = wrap180(await read() - before)
    await scope.put("MoveAxis", Axis=axis, Rate=0.0)
    await scope.stands(30.0)
    return change


@pytest.mark.parametrize("row", POLAR, ids=lambda row: f"{row[0]}{row[3]:+.0f}{row[4]:+.0f}")
async def test_moveaxis_turns_the_tube_the_documented_way_on_the_sky(
    row: tuple[str, str, bytes, float, float, bool, bool],
) -> None:
    model, driven, told, latitude, hours, east, north = row
    async with RehearsalGateway(
        model, start=START, driven=driven, presented="alpaca", site=(latitude, 10.0), named=True, config={"sun": 0.0}
    ) as own:
        own.sim.feed(told)
        exact_sky.load(own.controller.astrometry.sky)
        scope = Telescope(own)
        await connect(scope)
        await scope.slew_to_hour_angle(hours)
        for axis, more in ((0, east), (1, north)):
            assert (await moved(scope, axis, 2.0) > 1.0) is more
            assert (await moved(scope, axis, -2.0) < -1.0) is more


@pytest.mark.parametrize(("model", "driven"), [("cpc", "nexstar"), ("lx200gps", "lx200")])
async def test_moveaxis_turns_the_tube_the_documented_way_over_the_horizon(model: str, driven: str) -> None:
    async with RehearsalGateway(
        model, start=START, driven=driven, presented="alpaca", named=True, config={"sun": 0.0}
    ) as own:
        exact_sky.load(own.controller.astrometry.sky)
        scope = Telescope(own)
        await connect(scope)
        await scope.slew_to_hour_angle(-3.0)
        for axis in (0, 1):
            assert await moved(scope, axis, 2.0, True) > 1.0
            assert await moved(scope, axis, -2.0, True) < -1.0
