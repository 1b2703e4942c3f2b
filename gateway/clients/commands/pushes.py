"""Runs the subscriptions of one connection: readings are sent to the client without a request.

Each subscription has its own timer, so that a slow reading does not delay the others. A reading that the mount cannot
give now is skipped, and so is one that falls due while earlier bytes are unread: then the newest follows.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Sequence

from gateway.core.errors import Fault
from gateway.core.operations import Operation
from gateway.protocols.base.wants import Subscription


class Pushes:
    """``read`` takes a reading in this client's form, ``send`` writes bytes, ``unsent`` counts pending bytes."""

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
        """Run until cancelled. Times that were missed are skipped."""
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
        """Send one reading. Return the bytes that were sent last."""
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
