"""The limit of the hour angle by truth: arrows over and under the pole, and gotos anywhere, in both hemispheres.

How far the shaft is above horizontal is judged by the true axes (``past_meridian``), on every kind of German mount.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.control.user_messages import first_messages
from gateway.app.mount_state import mount_state
from gateway.astro.axes import Build
from gateway.core import operations as op
from gateway.core.errors import PastMeridian
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

MOUNTS = {
    "cge": ("nexstar", "cge"), "cgem": ("nexstar", "cgem"), "synscan": ("nexstar", "synscan"),
    "onstep": ("lx200", "onstep"), "teenastro": ("lx200", "teenastro"), "alpaca": ("alpaca", "german"),
}  # fmt: skip
#: Hours and degrees past the meridian that are allowed, and the degrees that a stop may end before and beyond.
HOURS, LIMIT, REACHED, RUN_ON = 0.5, 7.5, 8.0, 1.0
#: A limit, degrees past the meridian, that tracking reaches within twelve minutes from 1 degree before it.
CLOSE = 2.0


def bridge_to(name: str, latitude: float, hours: float = HOURS) -> Bridge:
    driven, model = MOUNTS[name]
    config = {"hour_angle_limit": hours, "lowest": -90.0, "sun": 0.0}
    return Bridge(model, driven=driven, site=(latitude, 10.0), latency=0.05, config=config)


async def goto(bridge: Bridge, hour_angle: float, dec: float) -> None:
    """Go to this hour angle (degrees, west positive), and wait for the end."""
    ask = bridge.controller.perform
    await ask(op.Goto((bridge.sim.mechanics.sky.lst(bridge.clock()) - hour_angle) % 360.0, dec))
    for _ in range(300):
        await asyncio.sleep(1.0)
        if not await ask(op.Slewing()):
            return
    raise AssertionError("the goto never ends")


async def hold(bridge: Bridge, *directions: op.Direction, seconds: float) -> float:
    """Press arrows until they are ended; return how far the tube was past the meridian at most."""
    worst, ask = -90.0, bridge.controller.perform
    for direction in directions:
        try:
            await ask(op.Move(direction, op.Rate(key=9)))
        except PastMeridian:
            return worst
    client = bridge.client()
    for _ in range(round(seconds * 10)):
        client.send(b":GR#:GD#")
        await asyncio.sleep(0.1)
        past = truth_of(bridge.sim).past_meridian
        assert past is not None
        worst = max(worst, past)
    await bridge.controller.stop()
    return worst


WEST, EAST, NORTH, SOUTH = op.Direction.WEST, op.Direction.EAST, op.Direction.NORTH, op.Direction.SOUTH


WAYS = ["west", "east", "under the pole", "over the pole, then west", "over the pole, then east"]
#: Hour angles and declinations towards the elevated pole.
GOALS = [(-45.0, 30.0), (15.0, 50.0), (75.0, 40.0), (-3.0, 20.0), (170.0, 75.0), (-100.0, 70.0)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("latitude", [45.0, -33.0])
@pytest.mark.parametrize("name", list(MOUNTS))
@pytest.mark.safety_line(5)
@pytest.mark.sampled(2)
async def test_arrows_keep_the_hour_angle_limit(name: str, latitude: float, way: str) -> None:
    async with bridge_to(name, latitude) as bridge:
        up = 1.0 if latitude > 0 else -1.0
        begin = {"west": -30.0, "east": 30.0, "under the pole": 150.0}.get(way, 40.0)
        await goto(bridge, begin, up * 70.0)
        worst = -90.0
        if way.startswith("over"):
            over = NORTH if latitude > 0 else SOUTH
            worst = max(worst, await hold(bridge, over, seconds=12.0))
            await asyncio.sleep(3.0)
        west = way in ("west", "under the pole") or way.endswith("then west")
        worst = max(worst, await hold(bridge, WEST if west else EAST, seconds=60.0))
        assert LIMIT - REACHED <= worst <= LIMIT + RUN_ON


@pytest.mark.parametrize("latitude", [45.0, -33.0])
@pytest.mark.parametrize("name", list(MOUNTS))
@pytest.mark.safety_line(5)
@pytest.mark.sampled(2)
async def test_goto_of_a_flipping_mount_ends_within_the_hour_angle_limit(name: str, latitude: float) -> None:
    async with bridge_to(name, latitude) as bridge:
        up = 1.0 if latitude > 0 else -1.0
        for hour_angle, dec in GOALS:
            await goto(bridge, hour_angle, up * dec)
            past = truth_of(bridge.sim).past_meridian
            assert past is not None and past <= LIMIT


@pytest.mark.parametrize(("name", "latitude"), [("onstep", 45.0), ("teenastro", -33.0), ("alpaca", 45.0)])
async def test_tracking_ends_at_the_hour_angle_limit(name: str, latitude: float) -> None:
    async with bridge_to(name, latitude, CLOSE / 15.0) as bridge:
        await goto(bridge, -1.0, 20.0)
        await asyncio.sleep(1200.0)
        past = truth_of(bridge.sim).past_meridian
        assert past is not None and CLOSE - 0.5 <= past <= CLOSE + 0.2
        assert not bridge.sim.tracking


async def test_last_known_pier_side_is_used_when_the_mount_stops_reporting_it() -> None:
    async with bridge_to("alpaca", 45.0, CLOSE / 15.0) as bridge:
        await goto(bridge, -1.0, 20.0)
        await asyncio.sleep(20.0)
        sim: Any = bridge.sim
        sim.lacks = frozenset({"sideofpier"})
        await asyncio.sleep(1200.0)
        past = truth_of(bridge.sim).past_meridian
        assert past is not None and CLOSE - 0.5 <= past <= CLOSE + 0.2


@pytest.mark.parametrize(
    ("driven", "model", "kept"),
    [
        ("lx200", "onstep", True), ("lx200", "lx200", True), ("lx200", "lx200gps", True), ("nexstar", "cpc", True),
        ("alpaca", "polar", True), ("lx200", "autostar", False), ("alpaca", "german", False),
    ],
)  # fmt: skip
async def test_start_names_a_mount_on_which_the_hour_angle_limit_cannot_be_kept(
    driven: str, model: str, kept: bool
) -> None:
    """An Autostar on a wedge may be a German mount, and this server tells no side of the pier."""
    lacks = {"lacks": frozenset({"sideofpier"})} if model == "german" else {}
    config = {"hour_angle_limit": HOURS, "sun": 0.0}
    async with Bridge(model, driven=driven, config=config, simulated=lacks) as bridge:
        if model == "autostar":
            bridge.sim.mode_letter = "P"  # type: ignore[attr-defined]
            bridge.sim.mechanics.set_build(bridge.clock(), Build.WEDGE)
            await asyncio.sleep(20.0)
        controller = bridge.controller
        at_start = [one.text for one in first_messages(controller, None, None)]
        for shown in (mount_state(controller).to_state().allowed, at_start):
            assert bool([words for words in shown if "no effect on this mount" in words]) is not kept
