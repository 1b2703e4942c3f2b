"""A fork whose tube was driven over the pole or the zenith goes back that way, wherever it is sent."""

from __future__ import annotations

import asyncio

import pytest
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.mount.policy import Limits
from gateway.mount.safety.admission import slew_paths
from tests.integration.safety.test_by_hand import polled, ready
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.instrument.attacks import LOW, arrow, goes
from tests.support.instrument.worlds import Slip, World
from tests.support.looks import altitude, at_rest, notes

#: East of the pole and near it; from there over the pole it looks west.
BESIDE_THE_POLE = -90.0, 80.0


@pytest.mark.parametrize(("hour_angle", "declination"), [(100.0, 45.0), (120.0, 52.0), (140.0, 52.0)])
@pytest.mark.parametrize(("driven", "model"), [("lx200", "lx200"), ("nexstar", "cpc")])
async def test_goto_from_beyond_the_pole_ends_before_its_path_leads_below_the_limit(
    driven: str, model: str, hour_angle: float, declination: float
) -> None:
    """The short way there is clear, the one that the mount takes passes beneath the pole."""
    async with Bridge(model, driven=driven, config={"lowest": 10.0}) as bridge:
        client = bridge.client()
        if driven == "nexstar":
            bridge.sim.feed(b"T\x02")  # it stands on a wedge, says its hand control
            await asyncio.sleep(10.0)
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - BESIDE_THE_POLE[0]) % 360.0, BESIDE_THE_POLE[1]))
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Mn#")
        await polled(bridge, client, b":GR#", 7.5)
        client.send(b":Qn#")
        await asyncio.sleep(2.0)
        assert bridge.sim.mechanics.axes(bridge.clock())[1] > 110.0
        await bridge.controller.perform(op.Goto((sidereal - hour_angle) % 360.0, declination))
        low, _ = await at_rest(bridge)
        assert low >= 10.0
        assert any(note.startswith("stopped at the altitude limit") for note in notes(bridge))


@pytest.mark.parametrize("kind", ["teenastro", "onstep"])
async def test_german_mount_beyond_the_pole_keeps_the_altitude_limit_in_gotos(kind: str) -> None:
    """One way to the goal leads down at once from where it stands, just above the limit beyond the pole."""
    async with World(kind, (45.0, 10.0), EVENING, Slip(), {"lowest": 20.0}) as world:
        await goes(world, 0.0, 55.0)
        await arrow(world, "n", 30.0)
        begin = len(world.looks)
        for azimuth in (170.0, 190.0, 90.0, 270.0):
            await goes(world, azimuth, 40.0)
            await arrow(world, "n", 10.0)
        assert min(look.altitude for look in world.looks[begin:]) > 20.0 - LOW


async def test_goto_from_beyond_the_zenith_does_not_cross_a_limit() -> None:
    """Somebody at the keypad brought it there."""
    async with Bridge("6-8se", presented="nexstar", surface="cpc") as bridge:
        await bridge.controller.perform(op.GotoHorizontal(180.0, 60.0))
        await ready(bridge, bridge.client(), b"e")
        bridge.sim.mechanics.goto_axis(bridge.clock(), 2, 130.0)
        await asyncio.sleep(60.0)
        assert altitude(bridge) == pytest.approx(50.0, abs=0.5)
        bridge.controller.context.policy = replace(bridge.controller.policy, limits=Limits(highest=75.0))
        await bridge.controller.perform(op.GotoHorizontal(0.0, 40.0))
        _, high = await at_rest(bridge)
        assert high <= 75.0
        assert high > 65.0, "it goes as far as it may"


@pytest.mark.parametrize(
    ("azimuth", "turns"),
    [(20.0, [20.0]), (170.0, [170.0]), (178.0, [178.0, -182.0]), (182.0, [-178.0, 182.0]), (190.0, [-170.0])],
)
async def test_both_azimuth_directions_are_checked_for_a_fork_displaced_by_a_sync(
    azimuth: float, turns: list[float]
) -> None:
    """A sync has displaced its axes from the sky: which way is the shorter one nobody can say."""
    async with Bridge("6-8se") as bridge:
        here = await bridge.controller.read(op.Position())
        there = bridge.controller.astrometry.horizontal(here).az + azimuth, 40.0
        journey = slew_paths.Journey(False, here, {False}, op.Equatorial(0.0, 0.0), there)
        found = slew_paths.paths_of(bridge.controller.context, journey)
        assert [turn[0] for _, turn in found] == pytest.approx(turns)
