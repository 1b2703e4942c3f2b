"""Syncs add up: it is their sum since the alignment that may not put the horizon somewhere else."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gateway.astro.axes import Build
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import SyncTooFar
from gateway.mount.safety.sync_sum import SyncSum, checked_sync_sum
from tests.support.in_process_gateway import EVENING, Bridge

#: 2026-06-21 17:00 UTC
DAY = 1782061200.0


async def sync_north(bridge: Any, degrees: float) -> Exception | None:
    """Sync that much farther north than the mount believes to point -> why not."""
    here = await bridge.controller.answer(op.Position())
    try:
        await bridge.controller.perform(op.Sync(here.ra, here.dec + degrees))
    except SyncTooFar as fault:
        return fault
    await asyncio.sleep(1.0)
    return None


def place(ra: float = 0.0, dec: float = 0.0) -> op.Equatorial:
    return op.Equatorial(ra, dec)


def refused(so_far: SyncSum, distance: float, *turns: tuple[float, float], limit: float = 15.0) -> str:
    """Why a sync that many degrees north is refused if it turns the axes like this, or so; "" if it is not."""
    try:
        checked_sync_sum(limit, so_far, turns, place(), place(0.0, distance))
    except SyncTooFar as fault:
        return str(fault)
    return ""


def test_sum_of_syncs_counts_degrees_on_the_sky_and_axis_turns() -> None:
    east = SyncSum().with_sync(place(350.0, 60.0), place(10.0, 60.0), [(20.0, 0.0)])
    assert (east.east, east.axis_turns) == (pytest.approx(10.0), ((20.0, 0.0),))
    assert SyncSum(3.0, 1.0).with_sync(place(), place(0.0, 3.0), [(0.0, 3.0)]).size == pytest.approx(5.0)
    then = east.with_sync(place(), place(), [(350.0, -4.0)])
    assert then.axis_turns[0] == pytest.approx((10.0, -4.0))  # a turn and ten degrees


@pytest.mark.parametrize(("so_far", "distance", "turn", "why"), [
    ((0.0, 0.0), 14.0, (0.0, 14.0), ""),
    ((0.0, 0.0), 16.0, (0.0, 16.0), "16 degrees from the present position"),
    ((0.0, 0.0), 3.6, (180.0, 0.0), ""),  # the turn of an axis does not count: half a degree at the zenith is far
    ((90.0, 14.0), 3.0, (-100.0, 0.0), ""),  # smaller, without its sign
    ((90.0, 14.0), 30.0, (-100.0, 0.0), ""),  # at any distance
    ((90.0, 14.0), 30.0, (-85.0, -28.5), "30 degrees from the present position"),  # the other is larger
    ((90.0, 14.0), 30.0, (-85.0, 0.04), ""),  # but for rounding
    ((90.0, 14.99), 30.0, (-85.0, 0.04), "30 degrees from the present position"),  # within the limit
])  # fmt: skip
@pytest.mark.safety_line(8)
def test_sync_beyond_the_sum_is_refused(
    so_far: tuple[float, float], distance: float, turn: tuple[float, float], why: str
) -> None:
    said = refused(SyncSum(turned=so_far), distance, turn)
    assert why in said and bool(said) == bool(why)


@pytest.mark.safety_line(8)
def test_sync_sum_on_the_sky_stays_within_the_limit() -> None:
    after = SyncSum(0.0, 14.8, (90.0, 0.0))
    assert "16 degrees off" in refused(after, 0.9, (0.0, 0.9))
    assert refused(after, -0.9, (0.0, -0.9)) == ""


def test_sync_beyond_the_pole_is_summed_for_both_possible_axis_turns() -> None:
    """Beyond the pole a mount may keep the way in which its tube points there, or turn it around."""
    around = (0.0, 0.9), (-180.0, -6.9)
    then = SyncSum().with_sync(place(), place(0.0, 0.9), around)
    assert then.axis_turns == around
    again = then.with_sync(place(), place(0.0, 0.9), [(0.0, 0.9), (180.0, -6.0)])
    assert again.axis_turns == (pytest.approx((0.0, 1.8)), pytest.approx((-180.0, -7.8)))
    assert msgspec.json.decode(msgspec.json.encode(again), type=SyncSum) == again


async def pointed(bridge: Bridge, ra: float, dec: float) -> op.Equatorial:
    """Send the mount there, wait until it has arrived, and return what it then tells."""
    await bridge.controller.perform(op.Goto(ra % 360.0, dec))
    await asyncio.sleep(2.0)
    while await bridge.controller.read_now(op.Slewing()):
        await asyncio.sleep(1.0)
    await asyncio.sleep(3.0)
    told: op.Equatorial = await bridge.controller.read_now(op.Position())
    return told


@pytest.mark.parametrize(("mount", "driven", "south", "equatorial"), [
    ("cpc", "nexstar", False, False), ("evolution", "nexstar", True, False), ("6-8se", "nexstar", False, True),
    ("cpc", "nexstar", True, True), ("cge", "nexstar", False, True), ("cgem", "nexstar", True, True),
    ("lx200gps", "lx200", False, False), ("autostar", "lx200", True, False), ("lx200-16", "lx200", False, True),
])  # fmt: skip
async def test_sync_sum_equals_the_correction_of_the_axes(
    mount: str, driven: str, south: bool, equatorial: bool
) -> None:
    """Both sides of the pier, both hemispheres: the correction of the simulated axes is the truth."""
    site = (-33.0, 10.0) if south else (45.0, 10.0)
    async with Bridge(mount, driven=driven, site=site, config={"site": site, "lowest": -90.0}) as bridge:
        mechanics = bridge.sim.mechanics
        if driven == "nexstar" and equatorial:
            bridge.sim.feed(b"T\x03" if south else b"T\x02")
        elif equatorial:
            mechanics.set_build(bridge.clock(), Build.WEDGE)
        first = mechanics.sync_correction
        for number, (hour_angle, away) in enumerate([(-30.0, 20.0), (40.0, 5.0), (20.0, 25.0), (-50.0, 10.0)]):
            ra = (mechanics.sky.lst(bridge.clock()) - hour_angle) % 360.0
            here = await pointed(bridge, ra, -away if south else away)
            await bridge.controller.perform(op.Sync(here.ra + (-1.0) ** number * 1.5, here.dec + 2.0))
            await asyncio.sleep(1.0)
            turned = (wrap180(now - then) for then, now in zip(first, mechanics.sync_correction, strict=True))
            (counted,) = bridge.controller.syncs.value.axis_turns
            assert counted == pytest.approx(tuple(turned), abs=0.05)


@pytest.mark.parametrize("start", [EVENING, DAY])
@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("autostar", "lx200")])
async def test_small_sync_near_the_zenith_turns_azimuth_far_and_can_be_undone(
    mount: str, driven: str, start: float
) -> None:
    async with Bridge(mount, driven=driven, start=start) as bridge:
        astrometry, synced = bridge.controller.astrometry, bridge.controller.syncs
        here = astrometry.equatorial_of(op.Horizontal(40.0, 88.5))
        await pointed(bridge, here.ra, here.dec)
        there = astrometry.equatorial_of(op.Horizontal(70.0, 88.5))
        await bridge.controller.perform(op.Sync(there.ra, there.dec))
        assert synced.value.axis_turns[0][0] == pytest.approx(30.0, abs=5.0)
        low = astrometry.equatorial_of(op.Horizontal(70.0, 40.0))
        await pointed(bridge, low.ra, low.dec)
        here = astrometry.horizontal(await bridge.controller.read_now(op.Position()))
        there = astrometry.equatorial_of(op.Horizontal(here.az - 29.0, here.alt))  # 22 degrees on the sky
        await bridge.controller.perform(op.Sync(there.ra, there.dec))
        assert synced.value.axis_turns[0] == pytest.approx((1.0, 0.0), abs=5.0)


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
async def test_small_syncs_do_not_add_up_beyond_the_limit(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        if driven == "lx200":
            await sync_north(bridge, 0.1)  # a Meade is aligned by its first one
        way = -1.0 if mount == "cge" else 1.0  # this one begins at the pole
        assert await sync_north(bridge, way * 9.0) is None
        assert "18 degrees off" in str(await sync_north(bridge, way * 9.0))
        assert await sync_north(bridge, way * 5.0) is None
        assert await sync_north(bridge, way * -10.0) is None
        assert await sync_north(bridge, way * 9.0) is None


async def test_new_alignment_resets_the_sync_sum() -> None:
    """The hand control is switched off and on, and aligned again."""
    async with Bridge("cpc") as bridge:
        assert await sync_north(bridge, 14.0) is None
        assert await sync_north(bridge, 14.0) is not None
        bridge.sim.aligned = False
        await bridge.controller.read_now(op.GetStatus())
        bridge.sim.aligned = True
        await bridge.controller.read_now(op.GetStatus())
        assert await sync_north(bridge, 14.0) is None


async def test_position_jump_faster_than_a_motor_counts_as_a_new_alignment() -> None:
    async with Bridge("cpc") as bridge:
        assert await sync_north(bridge, 14.0) is None
        mechanics, now = bridge.sim.mechanics, bridge.clock()
        client = bridge.client()
        for second in range(4):
            await client.ask(b":GR#")
            await asyncio.sleep(0.5)
            if second == 1:
                ra, dec = mechanics.believed_position(bridge.clock())
                mechanics.sync(bridge.clock(), ra + 30.0, dec)
        assert now < bridge.clock()
        assert bridge.controller.syncs.value == SyncSum()


async def test_sync_sum_survives_a_restart(tmp_path: Path) -> None:
    async with Bridge("cpc", state=tmp_path) as first:
        assert await sync_north(first, 14.0) is None
    async with Bridge("cpc", state=tmp_path, on=first) as second:
        assert await sync_north(second, 14.0) is not None
        assert await sync_north(second, 0.5) is None
