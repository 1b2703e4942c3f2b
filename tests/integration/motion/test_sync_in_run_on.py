"""A sync while the mount runs on after a stop, or is moved at its keypad, waits for rest, or is refused."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import Refused
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner
from tests.support.truth import moving

GOTO, REST = b":Sr08:00:00#:Sd+30*00:00#:MS#", 60
MOUNTS = [("cpc", "nexstar"), ("cgem", "nexstar"), ("lx200gps", "lx200")]


async def at_its_goal(bridge: Bridge, driven: str) -> None:
    """Send the mount to a place in the open sky, which a Meade is aligned on."""
    client = bridge.client()
    client.send(GOTO)
    for _ in range(REST):
        await client.ask(b":D#", ending=b"#")
        await asyncio.sleep(0.5)
    if driven == "lx200":
        here = await bridge.controller.read_now(op.Position())
        await bridge.controller.perform(op.Sync(here.ra, here.dec))


@pytest.mark.parametrize("delay", [0.1, 0.3])
@pytest.mark.parametrize("stop", [b":Q#", b":Qe#"])
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_sync_after_a_stop_is_done_when_the_mount_rests(
    mount: str, driven: str, stop: bytes, delay: float
) -> None:
    """What it names is then where the mount believes to be, so that it turns nothing."""
    async with Bridge(mount, driven=driven, config={"sun": 0.0}) as bridge:
        await at_its_goal(bridge, driven)
        client, sent = bridge.client(), (b"s", b"S") if driven == "nexstar" else (b":CM",)
        client.send(b":RS#:Me#")
        await asyncio.sleep(3.0)
        here = await bridge.controller.read_now(op.Position())
        assert moving(bridge.sim)
        client.send(stop)
        await asyncio.sleep(delay)
        before = len(bridge.sent_requests())
        sync = asyncio.ensure_future(bridge.controller.perform(op.Sync(here.ra, here.dec)))
        for _ in range(400):
            if any(command.startswith(sent) for command in bridge.sent_requests()[before:]):
                assert not moving(bridge.sim)
                break
            await asyncio.sleep(0.01)
        await asyncio.wait_for(sync, 5.0)


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_sync_while_a_keypad_arrow_is_held_is_refused(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven, config={"sun": 0.0}) as bridge:
        await at_its_goal(bridge, driven)
        owner, client = Owner(bridge, driven), bridge.client()
        owner.keys("first on")
        for _ in range(8):
            await client.ask(b":GR#", ending=b"#")
            await asyncio.sleep(0.5)
        here = await bridge.controller.read_now(op.Position())
        with pytest.raises(Refused, match="The mount is moving"):
            await bridge.controller.perform(op.Sync(here.ra, here.dec))
        owner.keys("first let go")
        await asyncio.sleep(1.5)
        here = await bridge.controller.read_now(op.Position())
        await bridge.controller.perform(op.Sync(here.ra, here.dec))
