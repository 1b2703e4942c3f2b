"""The operations of one connection that nobody waits for: a limited number, plus whatever ends a motion.

A halt that is still under way also serves an equal one that comes later, whoever asked for either.
"""

from __future__ import annotations

import asyncio

from gateway.core.motion_kinds import MOVING, ends_focus
from gateway.core.operations import AbortSlew, Operation, StopAxis
from gateway.core.wire_log import ClientLog
from gateway.mount.controller import MountController
from gateway.mount.safety.rules.dead_man import HostActivity

#: Operations of one connection that may be under way without anybody waiting for them; only an end is begun beyond.
BEGUN = 16


class Begun:
    """The operations of a client that are under way without anybody waiting for them. True while there are any."""

    def __init__(self, controller: MountController, log: ClientLog, life: HostActivity) -> None:
        self._controller, self._log, self._life = controller, log, life
        self._operations: dict[asyncio.Future[None], Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def begin(self, operation: Operation, stops: int) -> None:
        """An operation nobody is told the outcome of: a failure goes to the wire log."""
        controller, name = self._controller, type(operation).__name__
        if isinstance(operation, MOVING) and stops != controller.stops:  # a stop came since, or nobody is there
            return
        halts = isinstance(operation, StopAxis | AbortSlew)
        if halts and controller.orders.again(operation):
            return
        ends = halts or ends_focus(operation)
        if len(self._operations) >= BEGUN and (not ends or operation in self._operations.values()):
            self._log.note_once(f"commands arrive faster than the mount accepts them: {name} is not carried out")
            return
        task = controller.begin(operation, stops, lambda fault: self._log.refused(f"{name}: {fault}"), self._life)
        self._operations[task] = operation
        task.add_done_callback(lambda done: self._operations.pop(done, None))
