"""What a program is told between two readings: nothing from before an order, and where the mount has got to."""

from __future__ import annotations

import asyncio

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.readings.cache import NOT_CACHED
from tests.support.each import each
from tests.support.in_process_gateway import Bridge


@each("order", [op.Goto(100.0, 40.0), op.AbortMotion()])
def test_a_position_from_before_an_order_is_not_told_after_it(order: op.Operation) -> None:
    """However fresh it is: the mount may have left it."""

    async def program() -> None:
        async with Bridge("cge", latency=0.001) as bridge:
            await bridge.controller.perform(op.Goto(60.0, 40.0))
            await bridge.controller.answer(op.Position())
            assert bridge.controller.peek(op.Position()) is not NOT_CACHED
            await bridge.controller.perform(order)
            assert bridge.controller.peek(op.Position()) is NOT_CACHED

    run(program())


def test_between_two_readings_a_mount_that_moves_is_told_to_go_on() -> None:
    """Several answers in a row follow from one reading; each is another."""

    async def program() -> None:
        async with Bridge("cge", latency=0.001) as bridge:
            controller, told, readings = bridge.controller, set(), set()
            await controller.perform(op.Goto(100.0, 40.0))
            await asyncio.sleep(2.0)
            for _ in range(20):
                told.add(await controller.answer(op.Position()))
                readings.add(controller.cache.entries[op.Position].value)
                await asyncio.sleep(0.11)
            assert len(told) == 20 > 2 * len(readings)

    run(program())
