"""A server that once answers with an error what it has: what it can do, and what it reports, is not lost by that.

INDI's Alpaca server has the number 1 for every error, also for one that is over a moment later.
"""

from __future__ import annotations

import asyncio
from math import inf
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.protocols.alpaca.simulator.telescope import AlpacaError
from tests.integration.alpaca.test_servers import arrive, goal, server
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving

ANYTHING, INVALID, UNSPECIFIED = 1, 0x401, 0x500
#: What a server may have failed to answer when it was identified, and the operation that it is needed for.
ABILITIES = [
    ("canslewasync", op.Goto(0.0, 40.0)), ("canpark", op.Park()),
    ("canpulseguide", op.Pulse(op.Direction.EAST, 200)),
    ("cansettracking", op.SetTracking(on=False, heard=True)),
    ("canmoveaxis", op.Move(op.Direction.WEST, op.Rate(key=5))),
    ("axisrates", op.Move(op.Direction.WEST, op.Rate(key=5))),
]  # fmt: skip


def fails(bridge: Bridge, member: str, number: int = ANYTHING, times: float = 1, **given: str) -> None:
    """Let the server answer the next requests for a member (with these parameters) with an error."""
    usual, left = bridge.sim.respond, times

    def respond(method: str, path: str, parameters: dict[str, str]) -> Any:
        nonlocal left
        if left and method == "GET" and path.endswith(f"/{member}") and given.items() <= parameters.items():
            left -= 1
            raise AlpacaError(number, "Something went wrong")
        return usual(method, path, parameters)

    bridge.sim.respond = respond  # type: ignore[method-assign]


@pytest.mark.parametrize("number", [ANYTHING, INVALID, UNSPECIFIED])
@pytest.mark.parametrize("when", ["at the start", "later"])
async def test_tracking_is_read_again_after_a_failed_answer(number: int, when: str) -> None:
    one = server(platform=6)
    if when == "at the start":
        fails(one, "tracking", number)
    async with one:
        await asyncio.sleep(10.0)
        if when == "later":
            fails(one, "tracking", number)
        one.sim.track(False)
        await asyncio.sleep(20.0)
        assert (await one.controller.answer(op.GetStatus())).tracking is op.Tracking.OFF


@pytest.mark.parametrize("when", ["at the start", "later"])
async def test_device_state_is_requested_again_after_a_failed_answer(when: str) -> None:
    one = server()
    if when == "at the start":
        fails(one, "devicestate")
    async with one:
        await asyncio.sleep(5.0)
        if when == "later":
            fails(one, "devicestate")
        await asyncio.sleep(10.0)
        before = len(one.sent_requests())
        await asyncio.sleep(10.0)
        assert b"get devicestate\n" in one.sent_requests()[before:]
        assert b"get rightascension\n" not in one.sent_requests()[before:]


async def test_park_by_another_program_is_noticed_after_a_failed_answer() -> None:
    async with server(platform=6) as one:
        fails(one, "atpark")
        await asyncio.sleep(20.0)
        one.sim.park()
        await asyncio.sleep(60.0)
        assert one.sim.at == "park"
        assert (await one.controller.answer(op.GetActivity())).parked


@pytest.mark.parametrize("when", ["at the start", "later"])
async def test_arrows_of_a_german_mount_keep_their_direction_after_a_failed_answer(when: str) -> None:
    one = server()
    if when == "at the start":
        fails(one, "sideofpier")
    async with one:
        assert not one.driver.hides_pier_side
        await one.controller.perform(goal(one, 30.0))
        await arrive(one)
        if when == "later":
            fails(one, "sideofpier")
        for _ in range(2):
            before = one.sim.true_position()[1]
            await one.controller.perform(op.Move(op.Direction.NORTH, op.Rate(degrees=0.5)))
            await asyncio.sleep(1.0)
            await one.controller.perform(op.StopAxis(2))
            await asyncio.sleep(2.0)
            assert one.sim.true_position()[1] > before + 0.2


@pytest.mark.parametrize(("member", "operation"), ABILITIES)
@pytest.mark.parametrize("number", [ANYTHING, UNSPECIFIED])
async def test_alpaca_ability_is_requested_again_after_a_failed_answer(
    member: str, operation: op.Operation[Any], number: int
) -> None:
    one = server(config={"lowest": -90.0})
    fails(one, member, number)
    async with one:
        await one.controller.perform(operation)
        assert not any(b"slewtocoordinates " in line for line in one.sent_requests())


@pytest.mark.parametrize("number", [ANYTHING, UNSPECIFIED, 0x400])
async def test_stop_includes_an_axis_whose_state_is_unknown(number: int) -> None:
    """Another program, or the hand control, may move it, and no AbortSlew ends that there."""
    one = server(config={"lowest": -90.0}, lacks=frozenset({"abortslew"}))
    fails(one, "canmoveaxis", number, inf, Axis="1")
    async with one:
        one.sim.move_axis(2, 0.5)
        await asyncio.sleep(1.0)
        assert moving(one.sim)
        await one.controller.stop()
        await asyncio.sleep(1.0)
        assert not moving(one.sim)


async def test_stop_leaves_out_an_axis_that_the_mount_does_not_have() -> None:
    async with server(lacks=frozenset({"moveaxis"})) as one:
        await one.controller.perform(goal(one))
        await asyncio.sleep(1.0)
        await one.controller.stop()
        await asyncio.sleep(1.0)
        assert not moving(one.sim) and not any(line.startswith(b"put moveaxis") for line in one.sent_requests())
