"""A goto whose ways all leave the altitude limits is refused with a place that leads there; following it arrives."""

from __future__ import annotations

import asyncio
import contextlib
import re

import pytest

from gateway.astro.spherical import hour_angle_to_horizon, separation
from gateway.core import operations as op
from gateway.core.errors import WayBlocked
from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.admission import slew_paths
from tests.support.in_process_gateway import Bridge
from tests.support.looks import at_rest, extremes, notes
from tests.support.sampling import as_a_rule

FIRST = re.compile(r"The way is too (low|high)\. Send it first to az (\d+), alt (\d+)\.")
#: Mount, protocol, latitude, lowest, highest; hour angle and declination from which and to which it is sent.
JOURNEYS = [
    ("cge", "nexstar", 20.0, 15.0, 90.0, (-62.0, 14.0), (16.0, 68.0)),
    ("cgem", "nexstar", -33.0, 10.0, 90.0, (170.0, -81.0), (62.0, -10.0)),
    ("cge", "nexstar", 45.0, 20.0, 90.0, (-173.0, 69.0), (-25.0, 17.0)),
    ("cgem", "nexstar", 60.0, 30.0, 90.0, (-169.0, 64.0), (-18.0, 13.0)),
    ("cge", "nexstar", 45.0, 0.0, 60.0, (20.0, -10.0), (20.0, 85.0)),
    ("lx200", "lx200", 45.0, 0.0, 75.0, (-50.0, 45.0), (50.0, 45.0)),
]


async def pointed(bridge: Bridge, hour_angle: float, dec: float) -> None:
    """Turn the axes there at once, as a German mount does it, and let the gateway see it."""
    mechanics, now = bridge.sim.mechanics, bridge.clock()
    mechanics.speedup = 1000.0
    mechanics.goto_sky(now, mechanics.sky.lst(now) - hour_angle, dec)
    await asyncio.sleep(5.0)
    mechanics.speedup = 1.0
    for _ in range(4):
        await bridge.controller.read_now(op.Slewing())
        await bridge.controller.read_now(op.Position())
        await asyncio.sleep(0.5)


async def followed(bridge: Bridge, goal: op.Equatorial, most: int = 4) -> tuple[list[str], float, float]:
    """Send the mount to the goal, by the places that refusals name -> these, and the lowest and highest altitude."""
    asked: list[str] = []
    low, high = await extremes(bridge, 0.1)
    for _ in range(most):
        try:
            await bridge.controller.perform(op.Goto(goal.ra, goal.dec))
        except WayBlocked as fault:
            asked.append(str(fault))
            first = FIRST.fullmatch(str(fault))
            if first is None:
                raise
            await bridge.controller.perform(op.GotoHorizontal(float(first[2]), float(first[3])))
            bottom, top = await at_rest(bridge)
            low, high = min(low, bottom), max(high, top)
        else:
            bottom, top = await at_rest(bridge)
            return asked, min(low, bottom), max(high, top)
    raise AssertionError(asked)


@pytest.mark.parametrize(("mount", "driven", "latitude", "lowest", "highest", "here", "there"), JOURNEYS)
async def test_waypoint_named_in_a_refused_goto_leads_to_the_target(
    mount: str,
    driven: str,
    latitude: float,
    lowest: float,
    highest: float,
    here: tuple[float, float],
    there: tuple[float, float],
) -> None:
    site = (latitude, 10.0)
    config = {"lowest": lowest, "highest": highest, "site": site, "sun": 0.0}
    async with Bridge(mount, driven=driven, site=site, config=config) as bridge:
        await pointed(bridge, *here)
        before = len(notes(bridge))
        goal = op.Equatorial((bridge.sim.mechanics.sky.lst(bridge.clock()) - there[0]) % 360.0, there[1])
        asked, low, high = await followed(bridge, goal)
        assert len(asked) == 1
        assert separation(goal.ra, goal.dec, *bridge.sim.true_position()) < 0.1
        assert lowest <= low and high <= highest
        assert not any("stopped at" in note for note in notes(bridge)[before:])


async def test_programs_read_a_refused_path_as_a_refusal_of_a_high_object() -> None:
    """Never "1": the object stands high. Not longer than a hand control's lines."""
    site = (20.0, 10.0)
    config = {"lowest": 15.0, "site": site, "sun": 0.0}
    async with Bridge("cge", site=site, config=config) as bridge:
        await pointed(bridge, -62.0, 14.0)
        hours = (bridge.sim.mechanics.sky.lst(bridge.clock()) - 16.0) % 360.0 / 15.0
        target = f":Sr{int(hours):02}:{int(hours % 1 * 60):02}:00#:Sd+68*00:00#:MS#".encode()
        said = await bridge.client().ask(target, ending=b".#")
        assert said.startswith(b"112The way is too low. Send it first")
        assert len(said) <= 2 + 1 + 60 + 1


async def test_goto_refusal_advises_the_arrows_where_every_path_crosses_a_limit() -> None:
    """It stands below the limit, and every way leads deeper at first."""
    async with Bridge("cge", config={"lowest": 0.0, "sun": 0.0}) as bridge:
        mechanics = bridge.sim.mechanics
        mechanics.speedup = 1000.0
        mechanics.goto_axes(bridge.clock(), -100.0, -30.0)
        await asyncio.sleep(5.0)
        mechanics.speedup, sidereal = 1.0, mechanics.sky.lst(bridge.clock())
        with pytest.raises(WayBlocked, match="Raise the tube with the arrows") as said:
            await bridge.controller.perform(op.Goto((sidereal - 10.0) % 360.0, 40.0))
        assert len(str(said.value)) <= 60


@pytest.mark.parametrize("hour_angle", [-1.5, -0.5, 0.5, 1.5])
def test_goto_near_the_meridian_is_judged_on_both_pier_sides(hour_angle: float) -> None:
    async def program() -> None:
        async with Bridge("cge") as bridge:
            astrometry = bridge.controller.astrometry
            sidereal = astrometry.sidereal_time()

            def ways(away: float, dec: float) -> int:
                goal, here = (
                    op.Equatorial((sidereal - away) % 360.0, dec),
                    op.Equatorial((sidereal + 60.0) % 360.0, 20.0),
                )
                return len(slew_paths.paths_of(bridge.controller.context, slew_paths.Journey(True, here, {True}, goal)))

            assert ways(hour_angle, 20.0) == ways(hour_angle + 180.0, 80.0) == ways(50.0, 89.0) == 2
            assert ways(hour_angle * 4.0 + 20.0, 20.0) == ways(50.0, 87.0) == 1

    run(program())


async def test_pier_side_that_contradicts_the_axes_leads_below_no_limit() -> None:
    """Driven by arrows under the pole, a hand control may still tell the side of its last goto."""
    async with Bridge("cge-pro", "4.21", config={"lowest": 10.0, "sun": 0.0}) as bridge:
        mechanics = bridge.sim.mechanics
        await pointed(bridge, 178.6, 57.4)
        mechanics.flipped = True
        sidereal = mechanics.sky.lst(bridge.clock())
        with contextlib.suppress(WayBlocked):
            await bridge.controller.perform(op.Goto((sidereal - 1.07) % 360.0, 43.6))
        low, _ = await at_rest(bridge)
        assert low >= 9.5


@pytest.mark.parametrize("latitude", [45.0, -33.0, 20.0])
@pytest.mark.parametrize("mount", ["cge", "cgem"])
async def test_goto_from_anywhere_to_anywhere_arrives_within_the_limits(mount: str, latitude: float) -> None:
    """No goto passes a limit; each arrives, in a few steps, and one that is refused names the next."""
    site, lowest = (latitude, 10.0), 15.0
    config = {"lowest": lowest, "site": site, "sun": 0.0}
    async with Bridge(mount, site=site, config=config) as bridge:
        number = 0
        for hour_angle in range(-170, 190, as_a_rule(50, whole=20)):
            dec = (number * 37) % 170 - 85.0
            number += 1
            if hour_angle_to_horizon(hour_angle, dec, latitude)[1] < lowest + 4.0:
                continue
            sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
            goal = op.Equatorial((sidereal - hour_angle) % 360.0, dec)
            for _ in range(4):  # one of which some ways leave the limits may end short
                _, low, _ = await followed(bridge, goal)
                assert low >= lowest
                if separation(goal.ra, goal.dec, *bridge.sim.true_position()) < 0.1:
                    break
            else:
                raise AssertionError(f"{hour_angle} {dec}: {notes(bridge)[-4:]}")
