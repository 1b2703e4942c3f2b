"""What a NexStar program takes a Meade for: a fork, a fork on its wedge, or a German mount that changes sides."""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.axes import Build
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.protocols.nexstar.surface.presented import default_model
from tests.support.in_process_gateway import Bridge

NORTH, SOUTH = (45.0, 10.0), (-34.0, 18.5)
ABSENT = b"\0\0\0#"


def german(site: tuple[float, float]) -> Bridge:
    """An Autostar on a German mount (LXD75): ACK answers P, :GW# begins with G."""
    bridge = Bridge(
        "autostar", driven="lx200", presented="nexstar", surface="cge", site=site, config={"lowest": -90.0, "sun": 0.0}
    )
    bridge.sim.mode_letter = "P"
    bridge.sim.mechanics.set_build(bridge.sim.now, Build.GERMAN)
    return bridge


@pytest.mark.parametrize(
    ("equatorial", "is_german", "name", "number"),
    [(False, False, "6-8se", 12), (True, None, "cpc", 9), (True, False, "cpc", 9), (True, True, "cge", 5)],
)
@pytest.mark.parametrize("gps", [False, True])
def test_default_presented_model_matches_the_type_of_mount(
    equatorial: bool, is_german: bool | None, name: str, number: int, gps: bool
) -> None:
    model = default_model(equatorial, is_german, gps, None)
    assert (model["name"], model["id"], model["version"]) == (name, number, (4, 21))
    assert ("gps" in model["has"]) is gps, "a unit that is not there is not presented"


@pytest.mark.parametrize("site", [NORTH, SOUTH])
async def test_classic_on_its_wedge_tracks_equatorially_and_reports_no_pier_side(site: tuple[float, float]) -> None:
    async with Bridge("lx200", driven="lx200", presented="nexstar", surface="cpc", site=site) as bridge:
        client = bridge.client()
        assert await client.ask(b"m") == b"\x09#"
        assert await client.ask(b"t") == (b"\x02#" if site is NORTH else b"\x03#")
        with pytest.raises(Unsupported):
            await bridge.controller.answer(op.PierSide())


@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize("hours", [-0.1, 0.1])
async def test_german_meade_reports_the_pier_side_of_its_last_goto(site: tuple[float, float], hours: float) -> None:
    """And stays there past the meridian; its second motor turns the tube as that side has it."""
    async with german(site) as bridge:
        client = bridge.client()
        sidereal = await bridge.controller.answer(op.SiderealTime())
        await bridge.controller.perform(op.Goto((sidereal - 15.0 * hours) % 360.0, 0.0))
        for _ in range(120):
            await asyncio.sleep(1.0)
            if await client.ask(b"L") == b"0#":
                break
        flipped = bridge.sim.mechanics.flipped
        assert flipped is ((hours < 0) is (site is NORTH))
        assert await client.ask(b"p") == (b"W#" if flipped else b"E#")
        before = bridge.sim.mechanics.axes(bridge.clock())[1]
        assert await client.ask(b"P\x02\x11\x24\x07\0\0\0") == b"#"
        await asyncio.sleep(2.0)
        assert await client.ask(b"P\x02\x11\x24\0\0\0\0") == b"#"
        await asyncio.sleep(2.0)
        assert bridge.sim.mechanics.axes(bridge.clock())[1] > before + 0.5, "0x24 turns the motor forwards"
        await asyncio.sleep(0.2 * 3600.0)
        assert await client.ask(b"p", 20.0) == (b"W#" if flipped else b"E#")


async def test_german_meade_before_its_first_goto_reports_the_side_where_it_points() -> None:
    async with german(NORTH) as bridge:
        ra = (await bridge.controller.answer(op.Position())).ra
        hour_angle = ((await bridge.controller.answer(op.SiderealTime())) - ra + 180.0) % 360.0 - 180.0
        assert await bridge.controller.answer(op.PierSide()) == ("W" if hour_angle < 0.0 else "E")
