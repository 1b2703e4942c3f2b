"""A sync during a goto: done on arrival if it is on the goto's own target, else refused, and at once."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Refused
from tests.support.in_process_gateway import Bridge

GOAL = 120.0, 30.0
GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
#: 0.3 degrees from the goal, 0.8, and six.
SAME, BESIDE, OTHER = b":Sr08:01:30#", b":Sr08:03:40#", b":Sr08:28:00#"
REST = b":Sd+30*00:00#:CM#"
MOUNTS = [("cpc", "nexstar"), ("cgem", "nexstar"), ("6-8se", "nexstar"), ("lx200gps", "lx200"), ("autostar", "lx200")]


async def nearly_there(bridge: Any, client: Any, degrees: float) -> None:
    """Send the mount to the goal, and wait until it is so far from it."""
    assert await client.ask(GOTO, ending=b"0") == b"110"
    while separation(*bridge.sim.true_position(), *GOAL) > degrees:
        client.send(b":GR#")
        await asyncio.sleep(0.1)
    assert bridge.sim.slewing


def off(bridge: Any) -> float:
    """How far the mount believes to be from where it is, degrees."""
    mechanics = bridge.sim.mechanics
    return separation(*mechanics.believed_position(bridge.clock()), *mechanics.true_position(bridge.clock()))


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_sync_on_the_gotos_target_is_done_on_arrival(mount: str, driven: str) -> None:
    """A driver that compares positions takes the goto for over when it is two arcminutes away, and syncs."""
    async with Bridge(mount, driven=driven) as bridge:
        client = bridge.client()
        await nearly_there(bridge, client, 0.03)
        before = bridge.clock()
        assert len(await client.ask(SAME + REST, 5.0, ending=b"#")) > 4, "it was refused"
        assert not bridge.sim.slewing and 0.1 < bridge.clock() - before < 3.5
        await asyncio.sleep(1.0)
        assert off(bridge) == pytest.approx(0.325, abs=0.03)


@pytest.mark.parametrize("degrees", [0.03, 0.5, 10.0])
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("wanted", [BESIDE, OTHER])
async def test_sync_on_another_object_during_a_goto_is_refused_at_once(
    wanted: bytes, degrees: float, mount: str, driven: str
) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client, error = bridge.client(), off(bridge)
        await nearly_there(bridge, client, degrees)
        before = bridge.clock()
        assert await client.ask(wanted + REST, 5.0, ending=b"#") == b"11#"
        assert bridge.clock() - before < 0.4
        await asyncio.sleep(20.0)
        assert off(bridge) == pytest.approx(error, abs=0.02)


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_sync_too_early_in_a_goto_is_refused_after_waiting(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        client, error = bridge.client(), off(bridge)
        await nearly_there(bridge, client, 20.0)
        assert await client.ask(SAME + REST, 5.0, ending=b"#") == b"11#"
        await asyncio.sleep(20.0)
        assert off(bridge) == pytest.approx(error, abs=0.02)


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("ends", ["closed", "stopped at the keys", "stopped by another"])
async def test_pending_sync_is_dropped_after_a_stop_or_a_disconnection(ends: str, mount: str, driven: str) -> None:
    """Its client has gone, the owner has ended the goto before its goal, or a stop came."""
    async with Bridge(mount, driven=driven) as bridge:
        client, other, error = bridge.client(), bridge.client("10.0.0.9"), off(bridge)
        await nearly_there(bridge, client, 3.0 if ends == "stopped at the keys" else 0.03)
        client.send(SAME + REST)
        await asyncio.sleep(0.05)
        assert bridge.sim.slewing
        if ends == "closed":
            client.close()
        elif ends == "stopped by another":
            other.send(b":Q#")
        else:
            bridge.sim.mechanics.stop_goto(bridge.clock())
        for _ in range(10):
            other.send(b":GR#:D#")
            await asyncio.sleep(1.0)
        assert off(bridge) == pytest.approx(error, abs=0.02)


async def test_sync_during_a_goto_in_azimuth_and_altitude_is_done_on_arrival() -> None:
    async with Bridge("cpc") as bridge:
        controller = bridge.controller
        await controller.perform(op.GotoHorizontal(150.0, 40.0))
        while separation(*bridge.sim.mechanics.axes(bridge.clock()), 150.0, 40.0) > 0.05:
            await controller.read_now(op.Slewing())
            await asyncio.sleep(0.1)
        assert bridge.sim.slewing
        goal = controller.astrometry.equatorial_of(op.Horizontal(150.0, 40.0))
        with pytest.raises(Refused, match="is moving"):
            await controller.perform(op.Sync(goal.ra + 3.0, goal.dec))
        await controller.perform(op.Sync(goal.ra, goal.dec))
        assert not bridge.sim.slewing
