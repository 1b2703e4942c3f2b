"""Whose turn it is to move the mount: one motion after the other, and what ends one before all that wait."""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import count

#: What ends a motion, what was interrupted for it, everything else.
FIRST, RESUMED, IN_ORDER = range(3)


class Turn:
    """A lock that is passed on by rank, and in the order of asking among equals."""

    def __init__(self) -> None:
        self._held = False
        self._order = count()
        self._waiting: list[tuple[int, int, asyncio.Future[None]]] = []

    @asynccontextmanager
    async def taken(self, rank: int = IN_ORDER) -> AsyncIterator[None]:
        """Wait for the turn, and have it meanwhile."""
        if self._held:
            mine: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            heapq.heappush(self._waiting, (rank, next(self._order), mine))
            try:
                await mine
            except asyncio.CancelledError:
                if mine.done() and not mine.cancelled():
                    self._pass_on()
                raise
        self._held = True
        try:
            yield
        finally:
            self._pass_on()

    def _pass_on(self) -> None:
        """Give the turn to whoever is next; it is never free in between."""
        while self._waiting:
            following = heapq.heappop(self._waiting)[2]
            if not following.done():
                following.set_result(None)
                return
        self._held = False
