"""A cable that comes back, and the mark of a killed gateway: only what still moves as marked is stopped.

Meanwhile the owner has stopped the program's motion at the mount's own keys and begun another one.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.astro.axes import Build
from gateway.mount.motion.left_moving import MAX_MARK_AGE
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner

MOUNTS = [("cpc", "nexstar"), ("cgem", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200"), ("lx200", "lx200")]
SITES = [(45.0, 10.0), (-33.0, 10.0)]
CONFIG = {"lowest": -90.0, "sun": 0.0}
ARROW, GOTO = b":RM#:Me#", b":Sr08:00:00#:Sd+20*00:00#:MS#"
SHORT, LONG = 5.0, 16.0


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize("seconds", [SHORT, LONG])
@pytest.mark.parametrize("motion", [ARROW, b":RS#:Mn#:Mw#", GOTO])
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_mount_still_moving_when_the_cable_is_back_is_stopped(
    mount: str, driven: str, motion: bytes, seconds: float, site: tuple[float, float]
) -> None:
    async with Bridge(mount, driven=driven, site=site, speed=0.15 if motion is GOTO else 1.0, config=CONFIG) as bridge:
        owner, client = Owner(bridge, driven), bridge.client()
        await asyncio.sleep(1.0)
        client.send(motion)
        for _ in range(4):
            await asyncio.sleep(0.5)
            client.send(b":GR#:GD#")
        assert owner.moving
        await owner.cable_out(seconds)
        assert owner.moving
        await asyncio.sleep(8.0)
        assert not owner.moving and not bridge.controller.moving and not bridge.controller.wanted.stop_owed


#: A goto of the owner cannot be told from the one that was left, and is stopped.
OWN = [
    (mount, driven, motion, own)
    for mount, driven in MOUNTS
    for motion in (b":RM#:Mw#", GOTO)
    for own in ("up", "back", "goto")
    if (motion, own) != (GOTO, "goto")
]


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize(("mount", "driven", "motion", "own"), OWN)
async def test_motion_begun_at_the_hand_control_during_a_cable_fault_goes_on(
    mount: str, driven: str, motion: bytes, own: str, site: tuple[float, float]
) -> None:
    async with Bridge(mount, driven=driven, site=site, speed=0.3, config=CONFIG) as bridge:
        owner, client = Owner(bridge, driven), bridge.client()
        await asyncio.sleep(1.0)
        client.send(motion)
        for _ in range(4):
            await asyncio.sleep(0.5)
            client.send(b":GR#:GD#")
        out = asyncio.ensure_future(owner.cable_out(14.0))
        await asyncio.sleep(2.0)
        owner.keys("cancel", "let go", "first let go")
        await asyncio.sleep(4.0)
        await _own(bridge, owner, own)
        await out
        sense, since = truth_of(bridge.sim), bridge.controller.now()
        for _ in range(60):
            await asyncio.sleep(0.2)
            assert owner.moving
            if bridge.controller.line.state != "up":
                since = bridge.controller.now()
            if bridge.controller.now() - since > 3.0:
                break
        assert bridge.controller.line.state == "up"
        now = truth_of(bridge.sim)
        if own != "goto":
            assert (now.rate1, now.rate2) == pytest.approx((sense.rate1, sense.rate2), abs=0.3)
        assert not owner.ended()


async def _own(bridge: Bridge, owner: Owner, own: str) -> None:
    """Let the owner move the mount: an arrow, or a goto away from where the program's goto led."""
    await asyncio.sleep(2.0)
    if own == "back" and bridge.sim.mechanics.build is Build.GERMAN and bridge.sim.mechanics.geometry.pole_sign < 0:
        own = "first on"  # the motors of a German mount turn the other way in the south
    if own == "goto":
        ra, dec = bridge.sim.true_position()
        owner.goto(ra - 55.0, dec - 5.0 if dec > 0.0 else dec + 5.0)
    else:
        owner.keys(own)
    await asyncio.sleep(1.0)
    assert owner.moving


@pytest.mark.parametrize("seconds", [SHORT, LONG])
@pytest.mark.parametrize(
    ("mount", "driven", "motion", "own"),
    [
        *(case for case in OWN if case[3] != "back"),
        *((*mount, motion, "") for mount in MOUNTS for motion in (ARROW, GOTO)),
    ],
)
async def test_gateway_restarted_late_after_a_kill_does_not_stop_hand_control_motion(
    mount: str, driven: str, motion: bytes, own: str, seconds: float, tmp_path: Path
) -> None:
    """A recent one stops whatever moves."""
    kinds: dict[str, Any] = {"mount": mount, "driven": driven, "state": tmp_path, "config": CONFIG, "speed": 0.2}
    async with Bridge(**kinds) as first:
        first.client().send(motion)
        await asyncio.sleep(2.0)
        owner = Owner(first, driven)
        await first.kill()
        if own:
            owner.keys("cancel", "let go", "first let go")
            await asyncio.sleep(2.0)
            await _own(first, owner, own)
        await asyncio.sleep(seconds - (5.0 if own else 0.0))
        assert owner.moving
        async with Bridge(on=first, **kinds) as second:
            watching = Owner(second, driven)
            for _ in range(20):
                await asyncio.sleep(0.2)
                if own and seconds > MAX_MARK_AGE:
                    assert watching.moving
            assert watching.moving is bool(own and seconds > MAX_MARK_AGE)
            if not watching.moving:
                await asyncio.sleep(9.0)
                assert not list(tmp_path.glob("*.moving"))
