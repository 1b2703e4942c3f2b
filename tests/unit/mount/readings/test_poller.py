"""The status that no program asks for is known all the same: pages show it, and they do not ask the mount."""

from __future__ import annotations

import asyncio

import pytest

from gateway.app.mount_state import mount_state
from gateway.app.status import activity
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

MOUNTS = pytest.mark.parametrize(("mount", "driven"), [("6-8se", "nexstar"), ("lx200gps", "lx200")])


def shown(bridge: Bridge) -> str:
    return activity(mount_state(bridge.controller).look)


def played(mount: str, driven: str, order: op.Operation, after: float, speed: float = 1.0) -> list[str]:
    """What is shown after an order without any program: at once, and after so many seconds."""

    async def program() -> list[str]:
        async with Bridge(mount, driven=driven, speed=speed, config={"lowest": -90.0}) as bridge:
            await asyncio.sleep(3.0)
            await bridge.controller.perform(order)
            first = shown(bridge)
            await asyncio.sleep(after)
            return [first, shown(bridge)]

    return run(program())


@MOUNTS
def test_tracking_state_is_never_unknown_after_tracking_is_switched(mount: str, driven: str) -> None:
    first, then = played(mount, driven, op.SetTracking(False), 2.0)
    assert first in ("tracking", "not tracking") and then == "not tracking"


@MOUNTS
def test_parked_mount_is_shown_as_parked(mount: str, driven: str) -> None:
    assert played(mount, driven, op.Park(), 120.0, speed=4.0)[1] == "parked"


def test_parking_mount_is_never_shown_as_tracking() -> None:
    """Nobody need ask a hand control whose tracking the gateway itself has turned off."""

    async def program() -> list[str]:
        async with Bridge("6-8se", speed=4.0, config={"lowest": -90.0}) as bridge:
            await asyncio.sleep(3.0)
            await bridge.controller.perform(op.Park())
            seen = [shown(bridge)]
            while seen[-1] != "parked":
                await asyncio.sleep(0.05)
                seen += [shown(bridge)] * (shown(bridge) != seen[-1])
            return seen

    assert run(program()) == ["slewing", "parked"]


def test_tracking_switched_at_the_hand_control_is_noticed() -> None:
    async def program() -> str:
        async with Bridge("6-8se") as bridge:
            await asyncio.sleep(3.0)
            assert shown(bridge) == "tracking"
            bridge.sim.connection(lambda _: None)(b"T\0")
            await asyncio.sleep(13.0)
            return shown(bridge)

    assert run(program()) == "not tracking"


def test_status_that_no_program_polls_is_not_read_during_a_goto() -> None:
    """The line is for positions then."""

    async def program() -> list[bytes]:
        async with Bridge("cge", config={"lowest": -90.0, "sun": 0.0}) as bridge:
            await asyncio.sleep(10.0)
            ra, _ = bridge.sim.true_position()
            await bridge.controller.perform(op.Goto((ra + 90.0) % 360.0, 0.0))
            await asyncio.sleep(3.0)
            before = len(bridge.sent_requests())
            while bridge.sim.slewing:
                await asyncio.sleep(0.1)
            return bridge.sent_requests()[before:]

    sent = run(program())
    assert sum(one in (b"e", b"E") for one in sent) > 20
    assert not {b"J", b"t"} & set(sent)
