"""Carrying out what a driver yields: its exchanges, its pauses, what it wants done later, and what it has to say."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import TypeVar

from gateway.core.errors import Fault
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps, Wait

_T = TypeVar("_T")


async def carry_out(
    steps: Steps[_T],
    exchange: Callable[[Send], Awaitable[Mapping[str, object]]],
    plan: Callable[[Schedule], object],
    remark: Callable[[str], object] = lambda text: None,
) -> _T:
    """Run a driver's generator to its end -> its value. A Fault of an exchange is thrown into it. Raises Fault."""
    answer: Mapping[str, object] | None = None
    fault: Fault | None = None
    try:
        while True:
            step = steps.send(answer) if fault is None else steps.throw(fault)
            answer, fault = None, None
            if isinstance(step, Send):
                try:
                    answer = await exchange(step)
                except Fault as error:
                    fault = error
            elif isinstance(step, Wait):
                await asyncio.sleep(step.seconds)
            elif isinstance(step, Remark):
                remark(step.text)
            else:
                plan(step)
    except StopIteration as end:
        value: _T = end.value
        return value
    finally:
        steps.close()
