"""Replies of the mount that clients of its own protocol get unchanged: requested once, shared by all clients.

The tables say how long a reply is shared (``KEEPS``, ``wireformat/rows.py``). If a client has set another site or clock
that the mount did not take, the gateway's value overrides the mount's reply to that client.
"""

from __future__ import annotations

import asyncio
import math

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.errors import Fault, NoDevice, Silence, Unsupported
from gateway.core.waiting import FairScheduler, mark_retrieved
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import READ
from gateway.mount.presence import Program
from gateway.mount.readings.cache import NOT_CACHED
from gateway.mount.site.readers import ReadBy

#: Seconds for which a reply is shared; others are not cached.
LASTS = {"fixed": math.inf, "state": 1.0, "site": 1.0}
#: How many requests have their reply cached: clients may ask for any number of devices.
REMEMBERED = 200


class _CachedReply(Struct, frozen=True):
    """The mount's reply, or the fault that it was, and the loop time until which it is fresh."""

    answer: bytes | Fault
    until: float


class OwnAnswers:
    """``peek`` returns a cached reply, ``read`` requests one if there is none, ``forget`` empties the cache."""

    def __init__(self, context: Context, runner: DriverRunner, fair: FairScheduler) -> None:
        self._context, self._runner, self._fair = context, runner, fair
        self._cached: dict[op.Own, _CachedReply] = {}
        self._asking: dict[op.Own, asyncio.Task[bytes]] = {}

    def forget(self, everything: bool = False) -> None:
        """Forget what may have changed after a setting, or ``everything`` after a reconnect.

        The replies to requests that are under way are not shared with clients that ask from now on, either.
        """
        self._asking = {}
        self._cached = (
            {} if everything else {key: cached for key, cached in self._cached.items() if math.isinf(cached.until)}
        )

    def peek(self, operation: op.Own, program: Program) -> bytes:
        """Return the cached reply of the mount to a program; NOT_CACHED if it must be requested."""
        cached = self._fresh(operation)
        reply: bytes = NOT_CACHED
        if cached is not None and isinstance(cached.answer, bytes) and not self._is_overridden(operation, program):
            reply = cached.answer
        return reply

    async def read(self, operation: op.Own, program: Program) -> bytes:
        """Return the mount's reply, cached or by an exchange that all waiting clients share. Raises Fault."""
        if self._is_overridden(operation, program):
            raise Unsupported
        cached = self._fresh(operation)
        if cached is None:
            task = self._asking.get(operation)
            if task is None:
                task = self._asking[operation] = self._context.tasks.spawn(self._ask(operation))
                task.add_done_callback(lambda done: self._asked(operation, done))
            answer: bytes = await self._fair.shared_result(task)
            return answer
        if isinstance(cached.answer, Fault):
            raise type(cached.answer)(str(cached.answer))
        return cached.answer

    def _asked(self, operation: op.Own, task: asyncio.Task[bytes]) -> None:
        if self._asking.get(operation) is task:
            del self._asking[operation]
        mark_retrieved(task)

    async def _ask(self, operation: op.Own) -> bytes:
        await self._context.known.wait()
        lasts = LASTS.get(operation.keep, 0.0)
        try:
            answer: bytes = await self._runner.perform(operation, READ)
        except (NoDevice, Silence) as fault:
            # A mount that does not know a request will not know it later, and each timeout takes long: keep a Silence.
            self._remember(operation, type(fault)(str(fault)), math.inf if isinstance(fault, Silence) else lasts)
            raise
        self._remember(operation, answer, lasts)
        return answer

    def _remember(self, operation: op.Own, answer: bytes | Fault, lasts: float) -> None:
        if lasts and operation in self._asking:
            self._cached.pop(operation, None)
            self._cached[operation] = _CachedReply(answer, self._context.now() + lasts)
        if len(self._cached) > REMEMBERED:
            del self._cached[next(iter(self._cached))]

    def _fresh(self, operation: op.Own) -> _CachedReply | None:
        cached = self._cached.get(operation)
        return cached if cached is not None and self._context.now() < cached.until else None

    def _is_overridden(self, operation: op.Own, program: Program) -> bool:
        """Whether a program gets another site or clock from the gateway than the mount's own."""
        if operation.keep not in ("clock", "site"):
            return False
        read = ReadBy(self._context.site_clock, program)
        return read.has_own_clock() if operation.keep == "clock" else read.has_own_site()
