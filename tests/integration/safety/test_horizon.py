"""Until somebody writes a limit the horizon is a courtesy: it judges goals by the mount's own site and clock.

A way below it costs nothing, and no other source votes. What is written is kept on the way, and by every source.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Contradicted, NearSun, WayBlocked
from gateway.diagnostics.virtual_time import run
from gateway.mount.site.site_clock import SiteClock
from tests.integration.safety.test_ways import pointed
from tests.support.in_process_gateway import Bridge
from tests.support.looks import at_rest, notes
from tests.support.truth import altitude

NORTH, SOUTH = (45.0, 10.0), (-33.0, 150.0)
GERMANS = [("nexstar", "cge"), ("nexstar", "cgem"), ("nexstar", "synscan"), ("lx200", "onstep"), ("alpaca", "german")]
#: A June morning at 45 N 10 E.
DAY = 1782028800.0


@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("driven", "mount"), [*GERMANS, ("nexstar", "cpc"), ("lx200", "lx200gps")])
async def test_hamlib_parks_from_any_position(driven: str, mount: str, site: tuple[float, float]) -> None:
    """``:MA#`` to azimuth 0, altitude 0: the way of a German mount may pass below the horizon."""
    async with Bridge(mount, driven=driven, site=site, surface="lx200gps", config={"sun": 0.0}) as bridge:
        client = bridge.client()
        for azimuth, height in ((160.0, 30.0), (265.0, 50.0)):
            goal = bridge.controller.astrometry.equatorial_of(op.Horizontal(azimuth, height))
            await bridge.controller.perform(op.Goto(goal.ra, goal.dec))
            await at_rest(bridge)
            assert await client.ask(b":Sz000*00#:Sa+00*00#:MA#", ending=b"110") == b"110"
            await at_rest(bridge)
            there = bridge.controller.astrometry.equatorial_of(op.Horizontal(0.0, 0.0))
            assert separation(*bridge.sim.true_position(), there.ra, there.dec) < 0.5


@pytest.mark.parametrize("written", [False, True])
def test_path_below_the_horizon_is_allowed_without_a_configured_limit(written: bool) -> None:
    """From beneath the pole a German mount turns over the northern horizon, down to -14 degrees."""

    async def program() -> None:
        config = {"lowest": 0.0, "sun": 0.0} if written else {"sun": 0.0}
        async with Bridge("cge", config=config) as bridge:
            await pointed(bridge, -170.0, 60.0)
            goal = (bridge.sim.mechanics.sky.lst(bridge.clock()) + 40.0) % 360.0, -15.0
            if written:
                with pytest.raises(WayBlocked, match="The way is too low"):
                    await bridge.controller.perform(op.Goto(*goal))
                return
            await bridge.controller.perform(op.Goto(*goal))
            low, _ = await at_rest(bridge)
            assert low < -10.0
            assert separation(*bridge.sim.true_position(), *goal) < 0.1

    run(program())


async def test_goto_that_sinks_far_below_its_path_is_ended() -> None:
    """The target was garbled on its way, or the hand control flips the wrong way."""
    async with Bridge("cge", config={"sun": 0.0}) as bridge:
        goal = bridge.controller.astrometry.equatorial_of(op.Horizontal(100.0, 8.0))
        await bridge.controller.perform(op.Goto(goal.ra, goal.dec))
        mechanics = bridge.sim.mechanics
        lost = bridge.controller.astrometry.equatorial_of(op.Horizontal(100.0, -70.0))
        mechanics.goto_sky(bridge.clock(), lost.ra, lost.dec)
        low, _ = await at_rest(bridge)
        assert -22.0 < low < -2.0
        assert any("far below its way" in note for note in notes(bridge))


@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "6-8se"), ("nexstar", "cge"), ("lx200", "autostar")])
async def test_goto_off_its_path_ends_before_a_configured_limit(driven: str, mount: str) -> None:
    """It was sent elsewhere by the mount itself: it is watched like an arrow, with the margin of its speed."""
    async with Bridge(mount, driven=driven, config={"lowest": 20.0, "sun": 0.0}) as bridge:
        sky = bridge.controller.astrometry
        start, goal = (sky.equatorial_of(op.Horizontal(azimuth, 50.0)) for azimuth in (90.0, 200.0))
        await bridge.controller.perform(op.Goto(start.ra, start.dec))
        await at_rest(bridge)
        await bridge.controller.perform(op.Goto(goal.ra, goal.dec))
        await asyncio.sleep(0.2)
        lost = sky.equatorial_of(op.Horizontal(95.0, -30.0))
        bridge.sim.mechanics.goto_sky(bridge.clock(), lost.ra, lost.dec)
        low, _ = await at_rest(bridge)
        assert low >= 19.5 and altitude(bridge.sim) < 50.0


@pytest.mark.parametrize("written", [False, True])
async def test_goto_is_refused_over_a_contradicting_clock_only_if_a_limit_is_configured(written: bool) -> None:
    """This computer is five hours slow: by night, nothing comes of it without a limit. T4 on an alt-az NexStar."""
    config = {"lowest": 15.0} if written else {}
    async with Bridge("cpc", config=config, host_ahead=-5 * 3600.0, start=DAY + 12 * 3600.0) as bridge:
        goal = bridge.controller.astrometry.equatorial_of(op.Horizontal(90.0, 30.0))
        if written:
            with pytest.raises(Contradicted):
                await bridge.controller.perform(op.Goto(goal.ra, goal.dec))
        else:
            await bridge.controller.perform(op.Goto(goal.ra, goal.dec))


async def to_the_sun(bridge: Bridge) -> None:
    """Send the mount to what is the Sun where its tube goes: it takes it for another place of its wrong sky."""
    sun = bridge.controller.astrometry.sky.sun(bridge.clock())
    turned = bridge.sim.mechanics.sky.lst(bridge.clock()) - bridge.sim.mechanics.true_sky.lst(bridge.clock())
    await bridge.controller.perform(op.Goto((sun[0] + turned) % 360.0, sun[1]))


@pytest.mark.parametrize("confirmed", ["", "the page", "the keys"])
def test_goto_near_the_sun_of_the_previous_site_is_refused_after_a_large_site_change(confirmed: str) -> None:
    """The sign of the longitude: 60 W for 60 E. Nobody but the mount knew the site."""

    async def program() -> None:
        config, site = {"lowest": -30.0}, (45.0, 60.0)
        async with Bridge("lx200gps", driven="lx200", site=site, start=DAY + 14400.0, config=config) as bridge:
            await bridge.client("10.0.0.7").ask(b":Sg060*00#", ending=b"1")
            await asyncio.sleep(6.0)
            assert bridge.sim.mechanics.sky.longitude == pytest.approx(-60.0)
            if confirmed == "the page":
                bridge.controller.site_clock.confirmed_site = op.Place(45.0, -60.0)
            elif confirmed == "the keys":
                bridge.site_clock.take_mount_site(op.Place(45.0, -61.0))
            if confirmed:
                assert bridge.site_clock.former_site() is None
                return
            with pytest.raises(NearSun, match="site before") as refused:
                await to_the_sun(bridge)
            assert "60.0 E" in str(refused.value) and "60.0 W" in str(refused.value)
            assert "on the page" in str(refused.value)

    run(program())


def test_previous_site_is_remembered_after_many_small_site_changes() -> None:
    clock = [1000.0]
    known = SiteClock(lambda: clock[0], lambda: 1.8e9, None)
    known.take_mount_site(op.Place(45.0, 60.0))
    for step in range(1, 16):
        clock[0] += 40.0
        known.take_mount_site(op.Place(45.0, 60.0 - 2.5 * step), sent_by_gateway=True, set_by="10.0.0.7")
    assert known.former_site() == op.Place(45.0, 60.0)
    known.confirmed_site = op.Place(45.0, 22.5)
    assert known.former_site() is None
    known.take_mount_site(op.Place(45.0, -22.5), sent_by_gateway=True, set_by="10.0.0.7")
    assert known.former_site() == op.Place(45.0, 22.5), "the confirmed one"
    clock[0] += 12 * 3600.0
    known.take_mount_site(op.Place(45.0, -30.0), sent_by_gateway=True, set_by="10.0.0.7")
    assert known.former_site() == op.Place(45.0, -22.5), "the first one is too old"
    for _ in range(48):
        assert known.former_site() is not None
        clock[0] += 900.0
        known.take_mount_site(op.Place(45.0, -30.0))
    assert known.former_site() is None, "the mount has told the new one for so long"


async def test_goto_a_twentieth_of_a_degree_below_the_horizon_is_accepted() -> None:
    async with Bridge("cpc") as bridge:
        for height, refused in ((-0.05, False), (-0.2, True)):
            goal = bridge.controller.astrometry.equatorial_of(op.Horizontal(120.0, height))
            if refused:
                with pytest.raises(BelowHorizon):
                    await bridge.controller.admission.admit(op.Goto(goal.ra, goal.dec))
            else:
                await bridge.controller.admission.admit(op.Goto(goal.ra, goal.dec))
