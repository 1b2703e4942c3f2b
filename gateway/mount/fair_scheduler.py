"""A turnstile: of many who want to go on at once, a few do in each turn of the event loop.

Hundreds of programs that poll ask in step, and wait for the same position. Were they all to go on at once, a stop that
comes meanwhile would be heard after them; so between a few and the next few the event loop looks at what has come in,
and while a stop makes its way to the line nobody of a crowd goes on.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from gateway.core.errors import NoAnswer

#: How many go on in one turn of the event loop: together they take a quarter of a millisecond.
FEW = 2
#: Turns of the event loop in which a stop comes to the line from anywhere; more than that nobody is held up for it.
WAY = 20


class FairScheduler:
    """``open`` and ``enter`` are for whoever comes, ``outcome`` for who waits for an answer.

    ``stopping`` says whether a motion is being ended.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, stopping: Callable[[], bool]) -> None:
        self._loop, self._stopping = loop, stopping
        self._left, self._held, self._turning = FEW, 0, False
        self._waiting: deque[Callable[[], object]] = deque()

    def open(self) -> bool:
        """Whether somebody may go on at once, who then counts as one of this turn."""
        if self._left <= 0:
            return False
        self._left -= 1
        self._turn_later()
        return True

    def enter(self, go_on: Callable[[], object]) -> None:
        """Have it called: at once, or in its turn."""
        if self.open():
            go_on()
        else:
            self._waiting.append(go_on)

    async def outcome(self, task: asyncio.Task[Any]) -> Any:
        """What the task returns. Raises what it raises, NoAnswer if it was cancelled; who gives up does not end it."""
        if not task.done():
            place = self._loop.create_future()

            def go_on() -> None:
                if not place.done():
                    place.set_result(None)

            task.add_done_callback(lambda _: self.enter(go_on))
            await place
        if task.cancelled():  # that must not look as if whoever waits had been
            raise NoAnswer
        return task.result()

    def _turn_later(self) -> None:
        if not self._turning:
            self._turning = True
            self._loop.call_soon(self._turn)

    def _turn(self) -> None:
        """The next turn of the event loop: those who wait go first."""
        self._turning = False
        crowd = len(self._waiting) > FEW
        self._held = self._held + 1 if crowd and self._stopping() else 0
        held = 0 < self._held <= WAY
        try:
            for _ in range(0 if held else min(FEW, len(self._waiting))):
                self._waiting.popleft()()
        finally:  # whatever one of them comes to grief about, the others go on
            self._left = 0 if self._waiting else FEW
            if self._waiting:
                self._turn_later()
