"""The loop of motion: what cancels one order leaves the loop, and the order after it, alone."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import Fault, Refused
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

EAST = op.Move(op.Direction.EAST, op.Rate(name="max"))


@pytest.mark.parametrize("fails", [False, True])
def test_axis_stop_that_interrupts_an_arrow_is_not_cancelled_with_it(fails: bool) -> None:
    """The cancellation comes too late for the arrow, and would arrive at the next thing that the loop waits for."""

    async def program() -> None:
        async with Bridge("6-8se") as bridge:
            controller, asked = bridge.controller, list[op.Operation]()
            admit = controller.admission.admit

            async def interrupted(operation: op.Operation, by: object = None) -> op.Operation:
                asked.append(operation)
                if asked == [EAST]:
                    controller.reconciler.accept(op.StopAxis(2), None, None)
                    if fails:
                        raise Refused("in the same step")
                    return operation
                return await admit(operation)

            controller.admission.admit = interrupted  # type: ignore[method-assign, assignment]
            begun: list[op.Operation] = []
            controller.reconciler.acknowledged.connect(begun.append)
            controller.reconciler.accept(EAST, None, None)
            await asyncio.sleep(3.0)
            assert asked[1:3] == [op.StopAxis(2), EAST], "the end comes first, and the arrow again after it"
            assert begun[-1] == EAST and not controller.wanted.value.pending

    run(program())


@pytest.mark.parametrize("newer", [op.Goto(80.0, 40.0), EAST])
async def test_motion_stopped_before_sending_is_not_sent_to_the_mount(newer: op.Operation) -> None:
    """Both in one call: the loop is started for the order, and has not run yet."""
    async with Bridge("6-8se", config={"sun": 0.0, "lowest": -90.0}) as bridge:
        controller, begun = bridge.controller, list[op.Operation]()
        controller.reconciler.acknowledged.connect(begun.append)
        before = len(bridge.sent_requests())
        waiting = asyncio.ensure_future(controller.perform(newer))
        controller.loop.call_soon(controller.begin_stop)
        with pytest.raises(Fault):
            await waiting
        await asyncio.sleep(3.0)
        assert not begun and not controller.wanted.value.stop_owed
        moves = [data for data in bridge.sent_requests()[before:] if data[:1] == b"r" or (data[:1] == b"P" and data[4])]
        assert not moves, "not a byte of it"
        await controller.perform(newer)
        assert len(begun) == 1
