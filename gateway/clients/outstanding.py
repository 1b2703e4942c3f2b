"""What one connection has asked for without waiting for it: so much at a time, and whatever ends a motion besides.

A halt that another one does for, whoever asked for that, is no new one.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from gateway.core.motion_kinds import MOVING, ends_focus
from gateway.core.operations import CancelGoto, Halt, Operation

if TYPE_CHECKING:
    from gateway.clients.command_processor import CommandProcessor

#: Operations of one connection that may be under way without anybody waiting for them; only an end is begun beyond.
BEGUN = 16


class Begun:
    """The operations of a client that are under way without anybody waiting for them. True while there are any."""

    def __init__(self, client: CommandProcessor) -> None:
        self._client = client
        self._operations: dict[asyncio.Future[None], Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def begin(self, operation: Operation, stops: int) -> None:
        """An operation nobody is told the outcome of: a failure goes to the transcript."""
        client, name = self._client, type(operation).__name__
        if isinstance(operation, MOVING) and stops != client.controller.stops:  # a stop came since, or nobody is there
            return
        halts = isinstance(operation, Halt | CancelGoto)
        if halts and client.controller.orders.again(operation):
            return
        ends = halts or ends_focus(operation)
        if len(self._operations) >= BEGUN and (not ends or operation in self._operations.values()):
            client.transcript.note_once(
                client.name,
                f"commands come faster than the mount takes them: {name} not done",
                client.name.rpartition(":")[0],
            )
            return
        task = client.controller.begin(
            client.inward(operation),
            stops,
            lambda fault: client.transcript.refused(client.name, f"{name}: {fault}"),
            client.life,
        )
        self._operations[task] = operation
        task.add_done_callback(lambda done: self._operations.pop(done, None))
