"""A bell: what has happened, for tasks that wait for it, as a rule for a limited time.

It is an ``asyncio.Event`` that can be waited for with a limit at a third of the cost of ``asyncio.timeout``, which
cancels its task and takes that back: the line waits so several times in every exchange.
"""

from __future__ import annotations

import asyncio


class Bell:
    """``set`` rings it, ``clear`` silences it; whoever waits goes on once it rings, and at once while it does."""

    __slots__ = ("_rings", "_waiting")

    def __init__(self) -> None:
        self._rings = False
        self._waiting: list[asyncio.Future[bool]] = []

    def set(self) -> None:
        self._rings = True
        for waiter in self._waiting:
            _tell(waiter, True)

    def clear(self) -> None:
        self._rings = False

    async def wait(self) -> None:
        """Until it rings."""
        if not self._rings:
            await self._heard(asyncio.get_running_loop().create_future())

    async def within(self, seconds: float) -> bool:
        """Until it rings, for so long at most -> whether it did."""
        if self._rings:
            return True
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[bool] = loop.create_future()
        limit = loop.call_later(max(0.0, seconds), _tell, waiter, False)
        try:
            return await self._heard(waiter)
        finally:
            limit.cancel()

    async def _heard(self, waiter: asyncio.Future[bool]) -> bool:
        self._waiting.append(waiter)
        try:
            return await waiter
        finally:
            self._waiting.remove(waiter)


def _tell(waiter: asyncio.Future[bool], rang: bool) -> None:
    if not waiter.done():
        waiter.set_result(rang)
