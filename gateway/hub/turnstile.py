"""A turnstile: whoever waits for the same answer goes on a few at a time.

Hundreds of programs that poll a moving mount wait for one position. Were they all to go on at once, a stop that comes
meanwhile would be heard after them; so between a few and the next few the event loop looks at what has come in, and
while a stop makes its way to the line nobody of a crowd goes on.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

#: How many go on in one turn of the event loop: together they take half a millisecond.
FEW = 4
#: Turns of the event loop in which a stop comes to the line from anywhere; more than that nobody is held up for it.
WAY = 20


class Turnstile:
    """``outcome`` waits for a task and for one's turn after it. ``stopping`` says whether a motion is being ended."""

    def __init__(self, stopping: Callable[[], bool]) -> None:
        self._stopping, self._held = stopping, 0
        self._waiting: dict[asyncio.Task[Any], deque[asyncio.Future[None]]] = {}

    async def outcome(self, task: asyncio.Task[Any]) -> Any:
        """What the task returns. Raises what it raises; who gives up waiting does not end it."""
        if not task.done():
            place = task.get_loop().create_future()
            if task not in self._waiting:
                self._waiting[task] = deque()
                task.add_done_callback(self._let_through)
            self._waiting[task].append(place)
            await place
        return task.result()

    def _let_through(self, task: asyncio.Task[Any]) -> None:
        waiting = self._waiting[task]
        self._held = self._held + 1 if len(waiting) > FEW and self._stopping() else 0
        for _ in range(0 if 0 < self._held <= WAY else min(FEW, len(waiting))):
            place = waiting.popleft()
            if not place.done():
                place.set_result(None)
        if waiting:
            task.get_loop().call_soon(self._let_through, task)
        else:
            del self._waiting[task]
