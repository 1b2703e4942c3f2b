"""The publisher: one task makes the message of the page's state for all pages, while a page is open.

It is encoded once, however many pages there are: ten times a second while a mount moves or something has changed, else
once a second. The state of a mount takes 0.1 ms.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from gateway.app.gateway import Gateway
from gateway.console.shown.mount import ShownMount
from gateway.console.shown.talk import MOST

#: Seconds between two messages while something moves, and at rest.
MOVING, RESTING = 0.1, 1.0
#: What changes all the time, also at rest.
VOLATILE = {"position", "sidereal", "hour_angle", "clock", "line", "times", "programs", "bodies", "wanted", "lately"}
#: Seconds for which rows of the conversation are made before other tasks run for ``TURN`` seconds: an exchange may
#: begin meanwhile, and a stop needs several iterations of the event loop to reach the line.
PIECE, TURN = 0.0005, 0.001


class Publisher:
    """Makes the messages. ``recordings`` returns the state of the recording of every mount."""

    def __init__(self, gateways: Sequence[Gateway], recordings: Callable[[], list[Any]]) -> None:
        self.mounts = [ShownMount(gateway, index) for index, gateway in enumerate(gateways)]
        self._recordings = recordings
        self._loop = asyncio.get_running_loop()
        #: The newest message; empty if there is none yet.
        self.text = ""
        self._pages = self._listening = 0
        #: What all pages wait for.
        self._next: asyncio.Future[None] = self._loop.create_future()
        self._task: asyncio.Task[None] | None = None
        self._rows: deque[Any] = deque(maxlen=MOST)
        #: How many rows of the conversation there have been.
        self.count = 0

    def subscribe(self) -> None:
        """Count a page that will wait for messages; the first one starts the work."""
        self._pages += 1
        if self._task is None:
            for mount in self.mounts:
                mount.start()
            self._task = self._loop.create_task(self._publish())
            self._task.add_done_callback(self._ended)

    def leave(self) -> None:
        """Count a page less; after the last one, end the work."""
        self._pages -= 1
        if not self._pages and self._task is not None:
            self._task.cancel()
            self._stop()

    async def next(self) -> None:
        """Wait for another message or more rows. Raises ConnectionError after the end."""
        if self._task is None:
            raise ConnectionError("the console has nothing to show")
        await asyncio.shield(self._next)

    def listen(self, by: int) -> None:
        """Count one page more (1) or less (-1) that shows the conversation."""
        self._listening += by
        for mount in self.mounts:
            mount.talk.listen(self._listening > 0)

    def since(self, row: int) -> Sequence[Any]:
        """Return the rows of the conversation from this number on, as far as they are still stored."""
        missed = min(self.count - row, len(self._rows))
        return list(self._rows)[-missed:] if missed > 0 else []

    async def _publish(self) -> None:
        before, due = None, 0.0
        while True:
            rows = self.count
            await self._take_rows()
            states, recordings = [mount.state() for mount in self.mounts], self._recordings()
            steady = [{key: value for key, value in state.items() if key not in VOLATILE} for state in states]
            moves = any(state["moves"] for state in states)
            if moves or (steady, recordings) != before or self._loop.time() >= due:
                before, due = (steady, recordings), self._loop.time() + RESTING - MOVING / 2
                self.text = encoded({"mounts": states, "recordings": recordings})
            elif rows == self.count:
                await asyncio.sleep(MOVING)
                continue
            shown, self._next = self._next, self._loop.create_future()
            shown.set_result(None)
            await asyncio.sleep(MOVING)

    async def _take_rows(self) -> None:
        """Make the rows of the conversation since the last message, at most as many as are stored."""
        began, end = time.perf_counter(), self.count + MOST
        for mount in self.mounts:
            for row in mount.talk.take():
                self._rows.append(row)
                self.count += 1
                if self.count >= end:
                    return
                if time.perf_counter() - began > PIECE:
                    await asyncio.sleep(TURN)
                    began = time.perf_counter()

    def _stop(self) -> None:
        self._task, self.text = None, ""
        for mount in self.mounts:
            mount.stop()

    def _ended(self, task: asyncio.Task[None]) -> None:
        """After a defect give the pages the error; they reconnect, which starts the work again."""
        if task is self._task and not task.cancelled():
            self._stop()
            error = task.exception()
            self.mounts[0].gateway.wire_log.note("console", f"internal error, please report it: {error!r}")
            shown, self._next = self._next, self._loop.create_future()
            shown.set_exception(ConnectionError("the console has a defect"))
            shown.exception()  # there may be nobody who waits


def encoded(message: object) -> str:
    """Encode a message."""
    return msgspec.json.encode(message).decode()
