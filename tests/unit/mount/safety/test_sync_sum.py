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
from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.sync_sum import SyncSum, check_sync
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


def refused(
    so_far: SyncSum, distance: float, *turns: tuple[float, float], by_day: bool = True, limit: float = 15.0
) -> str:
    """Why a sync that many degrees north is refused if it turns the axes like this, or so; "" if it is not."""
    try:
        check_sync(limit, so_far, [turns] * len(so_far.axes), place(), place(0.0, distance), by_day, "zenith")
    except SyncTooFar as fault:
        return str(fault)
    return ""


def test_the_sum_is_taken_on_the_sky_and_at_the_axes() -> None:
    east = SyncSum().added(place(350.0, 60.0), place(10.0, 60.0), [[(20.0, 0.0)]])
    assert (east.east, east.axes) == (pytest.approx(10.0), ((20.0, 0.0),))
    assert SyncSum(3.0, 1.0).added(place(), place(0.0, 3.0), [[(0.0, 3.0)]]).size == pytest.approx(5.0)
    assert east.added(place(), place(), [[(350.0, -4.0)]]).axes[0] == pytest.approx(
        (10.0, -4.0)
    )  # a turn and ten degrees


@pytest.mark.parametrize("by_day", [False, True])
@pytest.mark.parametrize(("so_far", "distance", "turn", "why"), [
    ((0.0, 0.0), 14.0, (0.0, 14.0), ""),
    ((0.0, 14.0), 2.0, (0.0, 2.0), "turns an axis by 16 degrees with those since the alignment"),
    ((0.0, 14.0), 2.0, (0.0, -2.0), ""),
    ((0.0, 0.0), 16.0, (0.0, 16.0), "16 degrees from the present position"),
    ((0.0, 0.0), 3.6, (180.0, 0.0), "turns an axis by 180 degrees. Sync on a star farther from the zenith, align"),
    ((-14.0, 0.0), 3.0, (-2.0, 1.0), "turns an axis by 16 degrees with those"),
    ((90.0, 14.0), 3.0, (-100.0, 0.0), ""),  # smaller, without its sign
    ((90.0, 14.0), 30.0, (-100.0, 0.0), ""),  # at any distance
    ((90.0, 14.0), 30.0, (-85.0, -28.5), "30 degrees from the present position"),  # the other is larger
    ((90.0, 14.0), 30.0, (-85.0, 0.04), ""),  # but for rounding
    ((90.0, 14.99), 30.0, (-85.0, 0.04), "30 degrees from the present position"),  # within the limit
    ((90.0, 0.0), 0.0, (0.0, 0.0), "turns an axis by 90 degrees with those"),  # neither smaller
])  # fmt: skip
@pytest.mark.safety_line(8)
def test_what_is_refused(
    so_far: tuple[float, float], distance: float, turn: tuple[float, float], why: str, by_day: bool
) -> None:
    said = refused(SyncSum(turned=so_far), distance, turn, by_day=by_day)
    if "turns an axis" in why and not by_day:
        assert said == ""
    else:
        assert why in said and bool(said) == bool(why)


@pytest.mark.safety_line(8)
def test_by_night_the_turn_of_an_axis_does_not_count() -> None:
    """Plate solving: half a degree at an altitude of 89 degrees turns the azimuth by 30."""
    assert refused(SyncSum(), 0.5, (30.0, 0.0), by_day=False) == ""
    assert refused(SyncSum(), 1.0, (180.0, 0.0), by_day=False) == ""
    assert "30 degrees" in refused(SyncSum(), 0.5, (30.0, 0.0), by_day=True)
    after = SyncSum(0.0, 14.8, (90.0, 0.0))  # the sum on the sky must stay within the limit, too
    assert "16 degrees off" in refused(after, 0.9, (0.0, 0.9), by_day=False)
    assert "95 degrees with those" in refused(SyncSum(turned=(90.0, 0.0)), 5.0, (5.0, 0.0), by_day=True)


@pytest.mark.safety_line(8)
def test_of_two_turns_that_are_possible_the_larger_counts() -> None:
    """Beyond the pole a mount may keep the way in which its tube points there, or turn it around."""
    around = (0.0, 0.9), (-180.0, -6.9)
    said = refused(SyncSum(), 0.9, *around)
    assert "turn an axis by 180 degrees" in said
    assert refused(SyncSum(), 0.9, *around, by_day=False) == ""
    then = SyncSum().added(place(), place(0.0, 0.9), [around])
    assert then.axes == around
    assert "180 degrees with those since" in refused(then, 2.0, (0.0, 2.0))
    again = then.added(place(), place(0.0, 0.9), [[(0.0, 0.9), (180.0, -6.0)], [(0.0, 1.8), (180.0, 8.7)]])
    assert len(again.axes) == 2  # the others are the same but for a turn
    assert msgspec.json.decode(msgspec.json.encode(again), type=SyncSum) == again
    many = SyncSum(turned=(0.0, 0.0), otherwise=tuple((0.0, 2.0 * one) for one in range(1, 9)))
    assert len(many.added(place(), place(), [[(0.0, 0.0)]] * 9).axes) == 4


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
def test_the_sum_is_what_the_axes_were_turned_by(mount: str, driven: str, south: bool, equatorial: bool) -> None:
    """Both sides of the pier, both hemispheres: the correction of the simulated axes is the truth."""

    async def program() -> None:
        site = (-33.0, 10.0) if south else (45.0, 10.0)
        async with Bridge(mount, driven=driven, site=site, config={"site": site, "lowest": -90.0}) as bridge:
            mechanics = bridge.sim.mechanics
            if driven == "nexstar" and equatorial:
                bridge.sim.feed(b"T\x03" if south else b"T\x02")
            elif equatorial:
                mechanics.rebuild(bridge.clock(), Build.WEDGE)
            first = mechanics.correction
            for number, (hour_angle, away) in enumerate([(-30.0, 20.0), (40.0, 5.0), (20.0, 25.0), (-50.0, 10.0)]):
                ra = (mechanics.sky.sidereal(bridge.clock()) - hour_angle) % 360.0
                here = await pointed(bridge, ra, -away if south else away)
                await bridge.controller.perform(op.Sync(here.ra + (-1.0) ** number * 1.5, here.dec + 2.0))
                await asyncio.sleep(1.0)
                turned = (wrap180(now - then) for then, now in zip(first, mechanics.correction, strict=True))
                (counted,) = bridge.controller.synced.value.axes
                assert counted == pytest.approx(tuple(turned), abs=0.05)

    run(program())


@pytest.mark.parametrize(("start", "taken"), [(EVENING, True), (DAY, False)])
@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("autostar", "lx200")])
def test_near_the_zenith_of_an_alt_azimuth_mount(mount: str, driven: str, start: float, taken: bool) -> None:
    """By night a sync counts by what it is on the sky, by day also by how far it turns the azimuth."""

    async def program() -> None:
        async with Bridge(mount, driven=driven, start=start) as bridge:
            astrometry, synced = bridge.controller.astrometry, bridge.controller.synced
            here = astrometry.equatorial(op.Horizontal(40.0, 88.5))
            await pointed(bridge, here.ra, here.dec)
            there = astrometry.equatorial(op.Horizontal(70.0, 88.5))
            try:
                await bridge.controller.perform(op.Sync(there.ra, there.dec))
                assert taken and synced.value.axes[0][0] == pytest.approx(30.0, abs=5.0)
            except SyncTooFar:
                assert not taken and synced.value.axes[0] == pytest.approx((0.0, 0.0), abs=0.2)
                return
            low = astrometry.equatorial(op.Horizontal(70.0, 40.0))
            await pointed(bridge, low.ra, low.dec)
            here = astrometry.horizon(await bridge.controller.read_now(op.Position()))
            there = astrometry.equatorial(op.Horizontal(here.az - 29.0, here.alt))  # 22 degrees on the sky
            await bridge.controller.perform(op.Sync(there.ra, there.dec))
            assert synced.value.axes[0] == pytest.approx((1.0, 0.0), abs=5.0)

    run(program())


@pytest.mark.parametrize(("mount", "taken"), [("cge", False), ("cpc", True)])
def test_near_the_pole_right_ascension_counts_in_full_on_an_equatorial_mount(mount: str, taken: bool) -> None:
    """28 degrees of right ascension at declination 75 are 7 on the sky, and turn a polar axis by 28. By day."""

    async def program() -> None:
        async with Bridge(mount, start=DAY, config={"sun": 1.0}) as bridge:
            client = bridge.client()
            await client.ask(b":Sr06:00:00#:Sd+75*00:00#:MS#", until=b"0")
            for _ in range(60):
                client.tell(b":D#")
                await asyncio.sleep(1.0)
            here = await bridge.controller.answer(op.Position())
            try:
                await bridge.controller.perform(op.Sync(here.ra + 28.0, here.dec))
                assert taken
            except SyncTooFar:
                assert not taken

    run(program())


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
def test_small_syncs_do_not_add_up_beyond_the_limit(mount: str, driven: str) -> None:
    async def program() -> None:
        async with Bridge(mount, driven=driven) as bridge:
            if driven == "lx200":
                await sync_north(bridge, 0.1)  # a Meade is aligned by its first one
            way = -1.0 if mount == "cge" else 1.0  # this one begins at the pole
            assert await sync_north(bridge, way * 9.0) is None
            assert "18 degrees off" in str(await sync_north(bridge, way * 9.0))
            assert await sync_north(bridge, way * 5.0) is None
            assert await sync_north(bridge, way * -10.0) is None
            assert await sync_north(bridge, way * 9.0) is None

    run(program())


def test_a_new_alignment_begins_anew() -> None:
    """The hand control is switched off and on, and aligned again."""

    async def program() -> None:
        async with Bridge("cpc") as bridge:
            assert await sync_north(bridge, 14.0) is None
            assert await sync_north(bridge, 14.0) is not None
            bridge.sim.aligned = False
            await bridge.controller.read_now(op.GetStatus())
            bridge.sim.aligned = True
            await bridge.controller.read_now(op.GetStatus())
            assert await sync_north(bridge, 14.0) is None

    run(program())


def test_a_jump_that_no_motor_makes_is_a_new_alignment() -> None:
    async def program() -> None:
        async with Bridge("cpc") as bridge:
            assert await sync_north(bridge, 14.0) is None
            mechanics, now = bridge.sim.mechanics, bridge.clock()
            client = bridge.client()
            for second in range(4):
                await client.ask(b":GR#")
                await asyncio.sleep(0.5)
                if second == 1:
                    ra, dec = mechanics.believed(bridge.clock())
                    mechanics.sync(bridge.clock(), ra + 30.0, dec)
            assert now < bridge.clock()
            assert bridge.controller.synced.value == SyncSum()

    run(program())


def test_the_sum_outlives_the_gateway(tmp_path: Path) -> None:
    async def program() -> None:
        async with Bridge("cpc", state=tmp_path) as first:
            assert await sync_north(first, 14.0) is None
        async with Bridge("cpc", state=tmp_path, on=first) as second:
            assert await sync_north(second, 14.0) is not None
            assert await sync_north(second, 0.5) is None

    run(program())
