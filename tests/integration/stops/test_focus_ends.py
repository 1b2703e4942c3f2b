"""The focuser stands still when it was told to: neither a stop of the mount nor a lost answer takes that back.

Bytes as in the manuals: ``:F+#`` ``:FQ#`` on a Meade; ``P 2 18 36 rate`` to a focuser on a NexStar's bus.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.protocols.nexstar.simulator.mount import FocuserMotor
from tests.support.cable import swallow
from tests.support.in_process_gateway import Bridge

HALT = b"P\x02\x12\x24\x00\x00\x00\x00"
MOUNTS = [("cpc", "nexstar"), ("lx200gps", "lx200")]


def bridge_to(mount: str, driven: str) -> Bridge:
    bridge = Bridge(mount, driven=driven)
    if driven == "nexstar":
        bridge.sim.focuser = FocuserMotor()
    return bridge


def moves(bridge: Any) -> bool:
    if hasattr(bridge.sim, "accessories"):
        return bool(bridge.sim.accessories["focuser"])
    return bool(bridge.sim.focuser.is_moving(bridge.sim.clock()))


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("packet", [b":FQ#:Q#", b":Qe#:FQ#:Q#", b":FQ#:Qe#:Qw#:Qn#:Qs#", b":Q#:FQ#"])
async def test_stop_of_the_mount_does_not_cancel_the_end_of_the_focuser(mount: str, driven: str, packet: bytes) -> None:
    async with bridge_to(mount, driven) as bridge:
        client = bridge.client()
        client.send(b":F+#")
        await asyncio.sleep(1.0)
        assert moves(bridge)
        client.send(packet)
        await asyncio.sleep(2.0)
        assert not moves(bridge)
        assert bridge.controller.wanted.value.focus_motion is None


@pytest.mark.parametrize("times", [1, 3])
@pytest.mark.parametrize("how", ["told", "gone"])
async def test_end_of_the_focuser_is_sent_until_acknowledged(how: str, times: int) -> None:
    async with bridge_to("cpc", "nexstar") as bridge:
        client = bridge.client()
        client.send(b":FS#:F+#")
        await asyncio.sleep(1.0)
        assert moves(bridge)
        lost = swallow(bridge, lambda data: data == HALT, times)
        if how == "told":
            client.send(b":FQ#")
        else:
            client.close()
        await asyncio.sleep(40.0)
        assert len(lost) == times
        assert bridge.sent_requests().count(HALT) == times + 1
        assert not moves(bridge)
        assert bridge.controller.wanted.value.focus_motion is None
        assert not bridge.controller.wanted.value.pending


async def test_repeated_focuser_stop_does_not_end_a_newer_focuser_motion() -> None:
    async with bridge_to("cpc", "nexstar") as bridge:
        client = bridge.client()
        client.send(b":FS#:F+#")
        await asyncio.sleep(1.0)
        lost = swallow(bridge, lambda data: data == HALT)
        client.send(b":FQ#")
        while not bridge.controller.wanted.value.pending or not lost:
            await asyncio.sleep(0.1)
        client.send(b":F-#")
        await asyncio.sleep(8.0)
        assert moves(bridge)
        assert bridge.sent_requests().count(HALT) == 1
