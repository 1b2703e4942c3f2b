"""Tasks that run in the background: the loop holds on to none of them, and at the end all must be over."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class BackgroundTasks:
    """``spawn`` begins one, ``cancel`` and ``close`` end them all."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def spawn(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Run something in the background and hold on to it."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def cancel(self) -> None:
        """End what still runs, and wait for none of it."""
        for task in self._tasks:
            task.cancel()

    async def close(self) -> None:
        """End what still runs, and wait until it is over."""
        self.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
