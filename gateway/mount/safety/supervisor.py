"""Looks after the motions that need somebody at the other end, and ends those of programs that are gone."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from gateway.core.errors import Fault
from gateway.core.operations import Focus, Operation, StopAxis
from gateway.mount.context import Context
from gateway.mount.motion.wanted import ByHand, Wanted, WantedState
from gateway.mount.safety.rules.dead_man import EVERY, TRACKING, Presence, Supervised, missing


class Supervisor:
    """``perform`` carries out the operation that ends a motion."""

    def __init__(
        self,
        context: Context,
        wanted: WantedState,
        presence: Presence,
        perform: Callable[[Operation], Awaitable[object]],
    ) -> None:
        self._context, self._state, self._presence, self._perform = context, wanted, presence, perform
        self._loop = asyncio.get_running_loop()
        self._watching: asyncio.TimerHandle | None = None
        self._ended: set[Supervised] = set()

    def look_after(self, _: object = None) -> None:
        """A motion may have begun."""
        if self._watching is None and supervised(self._state.value):
            self._watching = self._loop.call_later(EVERY, self._look)

    def close(self) -> None:
        """Nothing is looked after any more."""
        if self._watching is not None:
            self._watching.cancel()

    def _look(self) -> None:
        self._watching = None
        motions, policy = supervised(self._state.value), self._context.policy
        for gone in missing(motions, self._presence, self._loop.time(), policy.silence, policy.silence_closed):
            if gone.motion not in self._ended:
                self._ended.add(gone.motion)
                what = "the focuser" if isinstance(gone.motion.ends, Focus) else "its motion"
                self._context.note(f"{gone.motion.by.who} {gone.why}: {what} is stopped")
                self._context.tasks.spawn(self._end(gone.motion.ends))
        self._ended.intersection_update(motions)
        self.look_after()

    async def _end(self, operation: Operation) -> None:
        try:
            await self._perform(operation)
        except Fault as fault:
            self._context.note(f"the motion could not be stopped: {fault}")


def supervised(wanted: Wanted) -> list[Supervised]:
    """The motions that somebody must be there for."""
    found = []
    if isinstance(wanted.motion, ByHand):
        found += [
            Supervised(StopAxis(axis), motion.by, motion.since)
            for axis, motion in wanted.motion
            if motion.by is not None and motion.speed > TRACKING
        ]
    if wanted.focus is not None and wanted.focus.by is not None:
        found.append(Supervised(Focus(0), wanted.focus.by, wanted.focus.since))
    return found
