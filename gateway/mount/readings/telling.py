"""What a program is told by a read when it must be waited for.

A place that was asked for before the last order is not told: the mount is asked again. In place of an answer that does
not come in time stands the last one; a state that nobody knows is told as it does no harm.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, NoAnswer
from gateway.mount.motion.wanted import Movement
from gateway.mount.readings.cache import MISSING
from gateway.mount.readings.told_position import PLACES, ToldPosition

#: How often the mount is asked again while orders come faster than it can tell what came of them.
TRIES = 3
#: Seconds that an answer is waited for where the last one may stand in for it: in motion, which makes it old, as long
#: as a reply may take.
WAITS, WAITS_MOVING = 2.5, 3.2

Asked = Callable[[op.Operation], Awaitable[Any]]


async def read_in_time(operation: op.Operation, told: ToldPosition, asked: Asked, movement: Movement) -> Any:
    """The answer to a read for a program; ``asked`` has the mount asked. Raises Fault where nothing can be told."""
    fault: Fault
    try:
        async with asyncio.timeout(WAITS_MOVING if movement.anything else WAITS):
            answer = await _read(operation, told, asked, movement)
    except Asleep:
        raise
    except (NoAnswer, Busy) as said:
        fault = said
    except TimeoutError:
        fault = NoAnswer()
    else:
        told.answered(type(operation))
        return answer
    last = told.last(type(operation))
    if last is MISSING:
        raise fault
    return last


async def _read(operation: op.Operation, told: ToldPosition, asked: Asked, movement: Movement) -> Any:
    """The mount's answer, at hand or waited for. Raises Fault."""
    kind = type(operation)
    value = told.tell(operation)
    answer: Any = MISSING
    for _ in range(TRIES):
        if value is MISSING and (source := told.source(kind)) is not None:
            await read_in_time(source(), told, asked, movement)
            value = told.tell(operation)
        if value is not MISSING:
            return value
        answer = await asked(operation)
        if kind not in PLACES:
            return answer
        value = told.tell(operation)
    return answer if value is MISSING else value
