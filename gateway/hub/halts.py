"""Halts that are not done: equal ones are one, and one that is hammered leaves room for others.

A halt that waits or is under way does for every equal one that is asked for meanwhile: what that one is to end is taken
back, or has been asked for after the first and is behind both. Once it is done an equal one goes to the mount at once,
because the first may have been lost. Only one that comes again and again, while nothing is asked for that it could end,
waits for its turn, and for who reads where the mount is.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from msgspec import Struct

from gateway.operations import Operation

#: So many repetitions of a halt in a row go before everything else; of these each comes within so many seconds.
AT_ONCE, AGAIN = 1, 1.0


class Halting(Struct, frozen=True):
    """A halt that is not done: how much had been asked for before it, and how many equal ones were done since."""

    task: asyncio.Task[Any]
    asked: int
    repeats: int
    overtakes: bool

    @property
    def hammered(self) -> bool:
        """Whether it has been done so often that it can wait for its turn."""
        return self.repeats > AT_ONCE

    @property
    def first(self) -> bool:
        """Whether it goes before all that waits."""
        return self.overtakes and not self.hammered


class Halted(Struct, frozen=True):
    """A halt that is done: the loop time, how much had been asked for, how many equal ones were done before it."""

    at: float
    asked: int
    repeats: int


class Halts:
    """``now`` is the event loop's clock. ``asked`` counts what was asked for that is no halt."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.asked = 0
        #: By the operation, and whether it overtakes: the other one waits behind a goto.
        self._halting: dict[tuple[Operation, bool], Halting] = {}
        self._halted: dict[Operation, Halted] = {}

    def __bool__(self) -> bool:
        """Whether any is not done yet."""
        return bool(self._halting)

    def same(self, operation: Operation, overtakes: bool) -> Halting | None:
        """The equal halt that is not done and does for this one as well; None when there is none.

        One that is behind a goto does only for those between which nothing else was asked for.
        """
        one = self._halting.get((operation, overtakes))
        if one is None or one.task.cancelling() or not (overtakes or one.asked == self.asked):
            return None
        return one

    def begun(self, operation: Operation, overtakes: bool, task: asyncio.Task[Any]) -> Halting:
        """A halt was asked for; it counts as not done until ``ended``."""
        before = self._halted.get(operation)
        again = before is not None and before.asked == self.asked and self._now() - before.at <= AGAIN
        repeats = before.repeats + 1 if before is not None and again else 0
        one = self._halting[operation, overtakes] = Halting(task, self.asked, repeats, overtakes)
        return one

    def ended(self, operation: Operation, task: asyncio.Task[Any]) -> None:
        """A task has come to its end, which may be that of a halt."""
        one = self.find(operation, task)
        if one is None:
            return
        del self._halting[operation, one.overtakes]
        if task.cancelled() or task.exception() is not None:
            self._halted.pop(operation, None)
        else:
            self._halted[operation] = Halted(self._now(), one.asked, one.repeats)

    def find(self, operation: Operation, task: asyncio.Task[Any]) -> Halting | None:
        """What is known of a task that may be a halt's."""
        return next((one for overtakes in (True, False)
                     if (one := self._halting.get((operation, overtakes))) is not None and one.task is task), None)
