"""A sync of a mount whose tube was driven over the pole, or over the zenith: nobody knows which way it turns the axes.

A hand control may keep the way in which its tube points there, or solve for the side of its last goto, which turns the
first axis by half a circle. Judged by the correction of the simulated axes, and by where the tube truly points.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.axes import Build
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import SyncTooFar
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.instrument.attacks import assault, attacks
from tests.support.looks import extremes

#: 2026-06-21 11:00 UTC
DAY = 1782039600.0
GERMANS = [("advanced-gt", "4.10"), ("cge", "4.21"), ("cgem", "5.31"), ("avx", None), ("synscan", "4.39.05")]
#: Mount, protocol, how it stands; the second axis of none of them is beyond 90 degrees but by an arrow.
FORKS = [
    ("6-8se", "nexstar", Build.WEDGE), ("lx200gps", "lx200", Build.WEDGE),
    ("lx200gps", "lx200", Build.ALTAZ), ("autostar", "lx200", Build.ALTAZ), ("cpc", "nexstar", Build.ALTAZ),
]  # fmt: skip


def standing(mount: str, version: str | None = None, latitude: float = 45.0, **given: Any) -> Bridge:
    site = (latitude, 10.0)
    return Bridge(mount, version, site=site, config={"site": site, "lowest": -90.0, "sun": 2.0}, **given)


async def over(bridge: Bridge, degrees: float, rate: bytes = b":RM#") -> None:
    """A program's arrow carries the tube so far over the pole or the zenith."""
    client, mechanics = bridge.client(), bridge.sim.mechanics
    arrow = b"n" if mechanics.geometry.pole_sign > 0 or mechanics.build is Build.ALTAZ else b"s"
    client.send(rate + b":M" + arrow + b"#")
    for _ in range(80):
        client.send(b":GR#" if mechanics.axes(bridge.clock())[1] < 90.0 + degrees else b":Q#:GR#")
        await asyncio.sleep(0.25)
    assert mechanics.axes(bridge.clock())[1] > 90.0 + degrees


async def synced(bridge: Bridge, away: float) -> tuple[str, tuple[float, float]]:
    """Sync on the told right ascension, so far from the pole -> why not, and what that turned the true axes by."""
    mechanics = bridge.sim.mechanics
    here: op.Equatorial = await bridge.controller.read_now(op.Position())
    before, why = mechanics.sync_correction, ""
    try:
        await bridge.controller.perform(op.Sync(here.ra, here.dec - away if here.dec > 0.0 else here.dec + away))
    except SyncTooFar as fault:
        why = str(fault)
    await asyncio.sleep(1.0)
    first, second = (wrap180(now - then) for then, now in zip(before, mechanics.sync_correction, strict=True))
    return why, (first, second)


def counted(bridge: Bridge, turned: tuple[float, float], within: float = 0.2) -> bool:
    """Whether what the axes were turned by is one of the sums that the gateway takes for possible: of the second axis
    with either sign.
    """
    sums = [
        (first, sign * second) for first, second in bridge.controller.syncs.value.axis_turns for sign in (1.0, -1.0)
    ]
    return any(max(abs(wrap180(a - b)) for a, b in zip(one, turned, strict=True)) < within for one in sums)


@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.safety_line(4)
def test_goto_after_a_wrong_sync_at_the_pole_avoids_the_sun(seed: int) -> None:
    """A mount that was switched on looks at the pole: nobody knows on which side of the pier it solves for a sync."""
    attack = next(one for one in attacks() if one.name == "a sync of +14°, to the Sun")
    result = run(assault(attack, "synscan", seed))
    assert not result.through, result


async def near_the_pole(bridge: Bridge, driven: str, build: Build, second: float) -> None:
    """The mount stands like that, and its tube a little before the pole or the zenith; a Meade is aligned by a sync."""
    mechanics = bridge.sim.mechanics
    if driven == "nexstar" and build is Build.WEDGE:
        bridge.sim.feed(b"T\x02")
    if build is Build.GERMAN:
        bridge.sim.mode_letter = "P"  # type: ignore[attr-defined]
    mechanics.set_build(bridge.clock(), build)
    await asyncio.sleep(15.0)
    mechanics.speedup = 1000.0
    mechanics.goto_axes(bridge.clock(), 100.0, second)
    await asyncio.sleep(4.0)
    mechanics.speedup = 1.0
    if driven == "lx200":
        assert not (await synced(bridge, 0.0))[0]


@pytest.mark.parametrize(("mount", "driven", "build"), FORKS)
@pytest.mark.safety_line(8)
async def test_both_goto_directions_are_checked_for_a_fork_synced_beyond_the_pole(
    mount: str, driven: str, build: Build
) -> None:
    async with standing(mount, driven=driven, start=DAY) as bridge:
        await near_the_pole(bridge, driven, build, 80.0)
        await over(bridge, 5.0)
        why, turned = await synced(bridge, 4.0)
        assert not why
        assert counted(bridge, turned, 1.0)
        assert len(bridge.controller.syncs.value.axis_turns) == 2


@pytest.mark.parametrize("by", [b":RS#", b":RM#", b"guide pulse"])
@pytest.mark.parametrize(("mount", "build"), [
    ("lx200gps", Build.WEDGE), ("lx200", Build.WEDGE), ("autostar", Build.GERMAN),
])  # fmt: skip
async def test_meade_is_recognised_beyond_the_pole_by_its_right_ascension(mount: str, build: Build, by: bytes) -> None:
    """It does not tell its axes; its right ascension is another by half a circle then, and back when it is back."""
    async with standing(mount, driven="lx200", start=DAY) as bridge:
        client, mechanics = bridge.client(), bridge.sim.mechanics
        await near_the_pole(bridge, "lx200", build, 89.995 if by == b"guide pulse" else 80.0)
        if by == b"guide pulse":
            client.send(b":Mgn4300#")
            await asyncio.sleep(8.0)
        else:
            await over(bridge, 0.02, by)
        assert mechanics.axes(bridge.clock())[1] > 90.005
        assert not bridge.controller.watch.observed.upright
        client.send(by + b":Ms#" if by != b"guide pulse" else b":Mgs9000#")
        for _ in range(60):
            client.send(b":GR#" if mechanics.axes(bridge.clock())[1] > 89.98 else b":Q#:GR#")
            await asyncio.sleep(0.25)
        assert mechanics.axes(bridge.clock())[1] < 89.995
        why, turned = await synced(bridge, 8.0)
        assert not why
        assert counted(bridge, turned)


@pytest.mark.parametrize("tracks", [True, False])
@pytest.mark.parametrize("rate", [b":RS#", b":RM#"])
@pytest.mark.parametrize(("mount", "driven"), [("lx200gps", "lx200"), ("autostar", "lx200"), ("cpc", "nexstar")])
async def test_goto_of_a_fork_synced_beyond_the_zenith_is_judged_both_ways_round(
    mount: str, driven: str, rate: bytes, tracks: bool
) -> None:
    """Lower at its azimuth: a mount that tracks keeps the way in which it points, one that does not turns around."""
    async with standing(mount, driven=driven, start=EVENING) as bridge:
        controller, mechanics = bridge.controller, bridge.sim.mechanics
        await near_the_pole(bridge, driven, Build.ALTAZ, 80.0)
        if not tracks:
            await controller.perform(op.SetTracking(on=False))
        await over(bridge, 0.02, rate)
        here = controller.astrometry.horizontal(await controller.read_now(op.Position()))
        lower = controller.astrometry.equatorial_of(op.Horizontal(here.az, here.alt - 8.0))
        before = mechanics.sync_correction
        await controller.perform(op.Sync(lower.ra, lower.dec))
        first, second = (wrap180(now - then) for then, now in zip(before, mechanics.sync_correction, strict=True))
        assert (abs(first) < 1.0) is tracks
        assert counted(bridge, (first, second), 1.0)


@pytest.mark.parametrize("start", [EVENING, DAY])
@pytest.mark.parametrize("latitude", [45.0, -33.0])
@pytest.mark.parametrize(("mount", "version"), GERMANS)
@pytest.mark.safety_line(8)
async def test_sync_at_the_pole_is_accepted_and_both_goto_directions_are_checked(
    mount: str, version: str | None, latitude: float, start: float
) -> None:
    """For plate solvers at the pole. After it the limits hold whichever way the mount has turned."""
    async with standing(mount, version, latitude, start=start) as bridge:
        await asyncio.sleep(1.0)
        await over(bridge, 3.0)
        why, turned = await synced(bridge, 0.9)
        assert not why
        assert counted(bridge, turned)
        assert len(bridge.controller.syncs.value.axis_turns) == 2
        why, again = await synced(bridge, 0.9)
        assert not why
        assert counted(bridge, (turned[0] + again[0], turned[1] + again[1]), 2.0)
        assert len(bridge.controller.syncs.value.axis_turns) == 2, "they do not become ever more"


@pytest.mark.parametrize("arrows", [b":Mw#:Ms#", b":Me#:Mn#", b":Ms#", b":Mn#"])
@pytest.mark.parametrize(("mount", "version"), GERMANS[:4])
async def test_arrow_after_a_sync_at_the_pole_keeps_the_limit(mount: str, version: str | None, arrows: bytes) -> None:
    config = {"lowest": 15.0, "sun": 0.0}
    async with Bridge(mount, version, config=config, start=EVENING) as bridge:
        await asyncio.sleep(1.0)
        await over(bridge, 3.0)
        assert not (await synced(bridge, 0.9))[0]
        client, low = bridge.client(), 90.0
        client.send(b":RS#" + arrows)
        for _ in range(120):
            client.send(b":GR#")
            low = min(low, (await extremes(bridge, 0.5))[0])
        assert low > 14.0
