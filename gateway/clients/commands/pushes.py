"""Carrying out the subscriptions of one connection: readings are taken, and their bytes sent, without being asked for.

Each subscription has its own clock, so that a slow reading keeps no other one back. What the mount cannot tell now is
passed over until the next time. A program that does not read gets nothing on top of what waits for it: when it reads
again, it gets the newest.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Sequence

from gateway.core.errors import Fault
from gateway.core.operations import Operation
from gateway.protocols.base.wants import Subscription


class Pushes:
    """``read`` takes a reading as this client is told it, ``send`` writes bytes, ``unsent`` tells how many wait."""

    def __init__(
        self,
        subscriptions: Sequence[Subscription],
        read: Callable[[Operation], Awaitable[object]],
        send: Callable[[bytes], None],
        unsent: Callable[[], int],
        spawn: Callable[[Coroutine[object, object, None]], asyncio.Task[None]],
    ) -> None:
        self._read, self._send, self._unsent = read, send, unsent
        self._tasks = [spawn(self._serve(subscription)) for subscription in subscriptions]

    async def _serve(self, subscription: Subscription) -> None:
        """Until it is cancelled. A time that has passed meanwhile is not made up for."""
        now = asyncio.get_running_loop().time
        last, due = b"", now() + subscription.after
        if subscription.after:
            await asyncio.sleep(subscription.after)
        while True:
            if not self._unsent():
                last = await self._push(subscription, last)
            due = max(due + subscription.every, now())
            await asyncio.sleep(due - now())

    async def _push(self, subscription: Subscription, last: bytes) -> bytes:
        """One reading -> the bytes that were sent last."""
        try:
            data = subscription.encode(await self._read(subscription.operation))
        except Fault:
            return last
        if not data or (subscription.changes and data == last):
            return last
        self._send(data)
        return data

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()
