"""The publisher of frames: one task makes them for all pages, at most five times a second, while a page is open.

A frame is made in steps of about 0.1 ms, and the pages are notified one after another; between any two of these there
is a millisecond in which clients are answered and stops are sent. A page that is not waiting for a frame, because its
browser has not read the last one, delays nothing and later gets the newest.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from gateway.app.gateway import Gateway
from gateway.console.shown.frame import Content, Frame, changes
from gateway.console.shown.mount import ShownMount, let_others_run
from gateway.console.shown.talk import MOST

#: Seconds between two frames, and at least between the end of one and the beginning of the next.
EVERY, PAUSE = 0.2, 0.05
#: Seconds for which rows of the conversation are made before other tasks may run.
PIECE = 0.0002


class Publisher:
    """Makes the frames. ``recordings`` returns the state of the recording of every mount."""

    def __init__(self, gateways: Sequence[Gateway], recordings: Callable[[], list[Any]]) -> None:
        self.mounts = [ShownMount(gateway, index) for index, gateway in enumerate(gateways)]
        self._recordings = recordings
        self._loop = asyncio.get_running_loop()
        self._content = Content()
        #: The newest frame; its number is 0 if there is none yet.
        self.frame = Frame(0, self._content, "")
        self._pages: set[Subscription] = set()
        self._task: asyncio.Task[None] | None = None
        self._listening = 0
        self._rows: deque[Any] = deque(maxlen=MOST)
        #: How many rows of the conversation there have been.
        self.count = 0

    def subscribe(self) -> Subscription:
        """Return a subscription for a page; the first one starts the work."""
        page = Subscription(self, self._loop)
        self._pages.add(page)
        if self._task is None:
            for mount in self.mounts:
                mount.start()
            self._task = self._loop.create_task(self._publish())
            self._task.add_done_callback(self._failed)
        return page

    def leave(self, page: Subscription) -> None:
        """Remove a subscription; after the last one, end the work and forget the frames."""
        self._pages.discard(page)
        if not self._pages and self._task is not None:
            task, self._task = self._task, None
            task.cancel()
            self._forget()

    def _forget(self) -> None:
        self._content = Content()
        self.frame = Frame(0, self._content, "")
        for mount in self.mounts:
            mount.stop()

    def listen(self, by: int) -> None:
        """Count one page more (1) or less (-1) that shows the conversation."""
        self._listening += by
        for mount in self.mounts:
            mount.talk.listen(self._listening > 0)

    def since(self, row: int) -> Sequence[Any]:
        """Return the rows of the conversation from this number on, as far as they are still stored."""
        missed = min(self.count - row, len(self._rows))
        return list(self._rows)[-missed:] if missed > 0 else []

    @property
    def at_work(self) -> bool:
        """Whether there will be another frame."""
        return self._task is not None

    async def _publish(self) -> None:
        while True:
            began = self._loop.time()
            self.frame = await self._next()
            for page in list(self._pages):
                page.deliver(self.frame)
                await let_others_run()
            await asyncio.sleep(max(began + EVERY - self._loop.time(), PAUSE))

    async def _next(self) -> Frame:
        before, states = self._content, [await mount.state() for mount in self.mounts]
        first = self.count
        if self._listening:
            await self._take_rows()
        new = {str(index): mount.answer_times.take() for index, mount in enumerate(self.mounts)}
        kept = {str(index): list(mount.answer_times.samples) for index, mount in enumerate(self.mounts)}
        self._content = after = Content(states, self._recordings(), kept)
        await let_others_run()
        changed = changes(before, after, new) if before.mounts else ""
        return Frame(self.frame.number + 1, after, changed, self.since(first), first)

    async def _take_rows(self) -> None:
        """Make the rows of the conversation since the last frame, at most as many as are stored."""
        began, end = time.perf_counter(), self.count + MOST
        for mount in self.mounts:
            for row in mount.talk.take():
                self._rows.append(row)
                self.count += 1
                if self.count >= end:
                    return
                if time.perf_counter() - began > PIECE:
                    await let_others_run()
                    began = time.perf_counter()

    def _failed(self, task: asyncio.Task[None]) -> None:
        """After a defect, end every subscription with the error; the pages reconnect, which starts the work again."""
        if task is not self._task:
            return
        self._task = None
        self._forget()
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self.mounts[0].gateway.wire_log.note("console", f"internal error, please report it: {error!r}")
        for page in list(self._pages):
            page.fail(error or ConnectionError("the console is closing"))


class Subscription:
    """The subscription of one page to the frames."""

    def __init__(self, publisher: Publisher, loop: asyncio.AbstractEventLoop) -> None:
        self._publisher, self._loop = publisher, loop
        self._waiting: asyncio.Future[Frame] | None = None

    async def next(self, seen: int) -> Frame:
        """Return the newest frame as soon as its number is not ``seen``. Raises ConnectionError after the end."""
        frame = self._publisher.frame
        if frame.number and frame.number != seen:
            return frame
        if not self._publisher.at_work:
            raise ConnectionError("the console has nothing to show")
        self._waiting = self._loop.create_future()
        return await self._waiting

    def deliver(self, frame: Frame) -> None:
        """Deliver a new frame to a waiting page."""
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(frame)

    def fail(self, error: BaseException) -> None:
        """Raise an error in a waiting page: there will be no more frames."""
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_exception(error)

    def end(self) -> None:
        """End the subscription."""
        self._publisher.leave(self)
