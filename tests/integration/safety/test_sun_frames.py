"""The Sun by both frames: where the mount believes the sky to be, and where its axes and every other clock put it.

Judged by where the tube truly points. What a wrong clock, site or sync does to gotos towards the Sun is played by the
attacks of ``test_instrument.py``. On 2026-03-20 at 14:30 UTC the Sun is at azimuth 235, altitude 30 over 45 N 10 E.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Contradicted, NearSun
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.looks import goes, notes, sync, to

#: 2026-03-20 14:30 UTC, in the afternoon, and 02:00 UTC, at night.
DAY, NIGHT = 1774017000.0, 1773972000.0
LIMIT = 20.0
NEXSTARS = [("cpc", "4.21", "nexstar"), ("evolution", "5.31", "nexstar")]
MEADES = [("lx200gps", None, "lx200"), ("autostar", None, "lx200")]


# --- syncs: the mount believes to point elsewhere -----------------------------------------------------------------


@pytest.mark.parametrize(("mount", "version", "driven"), NEXSTARS + MEADES)
async def test_sync_near_the_zenith_does_not_bring_the_tube_to_the_sun(
    mount: str, version: str | None, driven: str
) -> None:
    """3.6 degrees on the sky turn the azimuth by 180: what is opposite to the Sun then is the Sun."""
    async with Bridge(mount, version, driven=driven, start=DAY, config={"sync_limit": 180.0}) as bridge:
        assert (await to(bridge, 55.0, 88.2))[0] is None
        await sync(bridge, 235.0, 88.2)
        fault, nearest = await to(bridge, 55.0, 30.0)
        assert isinstance(fault, NearSun)
        assert nearest > LIMIT
        fault, nearest = await to(bridge, 325.0, 50.0)  # the tube goes to azimuth 145
        assert fault is None
        assert nearest > LIMIT


@pytest.mark.parametrize(("mount", "version", "driven"), [("cge", "4.21", "nexstar"), *MEADES])
async def test_goto_after_a_wrong_sync_keeps_the_altitude_limits(mount: str, version: str | None, driven: str) -> None:
    """The sync lifts what the mount believes by 13 degrees, so the tube would go 13 degrees lower."""
    async with Bridge(mount, version, driven=driven, start=NIGHT, config={"lowest": 10.0}) as bridge:
        assert (await to(bridge, 180.0, 40.0))[0] is None
        await sync(bridge, 180.0, 53.0)
        fault, _ = await to(bridge, 180.0, 15.0)
        assert isinstance(fault, Contradicted)
        assert "syncs turned one by 13 degrees" in fault.brief
        assert len(fault.brief) <= 60
        assert (await to(bridge, 180.0, 30.0))[0] is None
        assert truth_of(bridge.sim).altitude > 10.0


# --- a clock --------------------------------------------------------------------------------------------------------


async def test_mount_aligned_with_a_wrong_clock_avoids_the_sun_of_its_coordinates() -> None:
    """Its right ascension is right, so the Sun is where its coordinates say, whatever any clock says."""
    async with Bridge("cge", start=DAY, host_ahead=0.0) as bridge:
        sun = bridge.controller.suns.suns_to_avoid()[0]
        bridge.site_clock.take_mount_clock(op.Moment(bridge.clock() + 7200.0, 0.0))
        fault, nearest = await goes(bridge, op.Goto(sun.ra + 5.0, sun.dec))
        assert isinstance(fault, NearSun)
        assert nearest > LIMIT


# --- what another source ends, and what not -------------------------------------------------------------------------


async def away(bridge: Any, degrees: float, hours: float) -> op.Equatorial:
    """A place so many degrees east of where a clock that is ``hours`` ahead puts the Sun on the mount's sky."""
    sun = bridge.controller.suns.suns_to_avoid()[0]
    return op.Equatorial(sun.ra - hours * 15.0 + degrees, sun.dec)


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
async def test_sun_of_a_contradicting_clock_ends_an_arrow_but_not_tracking_or_the_keypad(
    mount: str, driven: str
) -> None:
    """This computer's clock is two and a half hours behind the true time, which the mount has."""
    async with Bridge(mount, driven=driven, start=DAY, host_ahead=-2.5 * 3600.0) as bridge:
        place, client = await away(bridge, 30.0, -2.5), bridge.client()
        fault, _ = await goes(bridge, op.Goto(place.ra, place.dec))
        assert fault is None
        client.send(b":RS#:Mw#")
        for _ in range(40):
            client.send(b":GR#")
            await asyncio.sleep(0.25)
        assert not bridge.controller.movement.any_motion
        assert "stopped at" in "\n".join(notes(bridge)), "an arrow of a program"
        here = await bridge.controller.answer(op.Position())
        assert LIMIT - 1.0 < wrap180(here.ra - (await away(bridge, 0.0, -2.5)).ra) < 30.0


@pytest.mark.parametrize("ahead", [-2.5, -2.0])
async def test_tracking_guiding_and_keypad_continue_near_the_sun_of_another_clock(ahead: float) -> None:
    async with Bridge("cpc", start=DAY) as bridge:
        place, mechanics = await away(bridge, 10.0, ahead), bridge.sim.mechanics
        assert (await goes(bridge, op.Goto(place.ra, place.dec)))[0] is None
        bridge.site_clock.computer_time = lambda: bridge.clock() + ahead * 3600.0  # it jumps
        client = bridge.client()
        for turn in range(200):
            client.send(b":GR#")
            await asyncio.sleep(1.0)
            if turn == 50:
                await bridge.controller.perform(op.Pulse(op.Direction.WEST, 1000))
            if turn == 100:
                mechanics.set_rate(bridge.clock(), 1, 1.0)
            if turn == 105:
                mechanics.resume_tracking(bridge.clock())
        assert bridge.sim.tracking
        assert not [note for note in notes(bridge) if "stopped" in note or "switched off" in note]
        place = await away(bridge, 5.0, ahead)
        assert isinstance((await goes(bridge, op.Goto(place.ra, place.dec)))[0], NearSun)


async def test_running_motion_continues_when_a_clock_jumps() -> None:
    async with Bridge("cpc", start=DAY) as bridge:
        place = await away(bridge, 4.0, -2.5)
        await bridge.controller.perform(op.Goto(place.ra, place.dec))
        await asyncio.sleep(2.0)
        bridge.site_clock.computer_time = lambda: bridge.clock() - 2.5 * 3600.0
        for _ in range(60):
            await asyncio.sleep(1.0)
        here = await bridge.controller.answer(op.Position())
        assert abs(wrap180(here.ra - place.ra)) < 0.1
        assert "stopped" not in "\n".join(notes(bridge))
        assert truth_of(bridge.sim).sun_distance > LIMIT
