"""The publisher of frames: one task makes them for all pages, at most five times a second, while a page is open.

A frame is encoded once, however many pages there are. It is made in steps of about 0.1 ms, and the pages are notified
one after another; between any two of these there is a millisecond in which clients are answered and stops are sent. A
page that is not waiting for a frame, because its browser has not read the last one, delays nothing and later gets the
newest.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import msgspec

from gateway.app.gateway import Gateway
from gateway.console.shown.mount import Sample, ShownMount, let_others_run
from gateway.console.shown.talk import MOST

#: Seconds between two frames, and at least between the end of one and the beginning of the next.
EVERY, PAUSE = 0.2, 0.05
#: Seconds for which rows of the conversation are made before other tasks may run.
PIECE = 0.0002
#: The state of a mount as sent to pages.
State = Mapping[str, Any]
#: Samples of the answer time by the mount's number.
Times = Mapping[str, Sequence[Sample]]
NONE: Times = {}


class PageFrame:
    """The messages that all pages are sent at one moment. ``number`` counts frames.

    A page that has the frame ``before`` gets the ``changes``; a new one, or one that was behind, gets the ``whole``,
    with all stored answer times instead of the ``new`` ones. ``rows`` are new rows of the conversation, the first has
    the number ``row``.
    """

    def __init__(
        self,
        before: PageFrame | None = None,
        mounts: Sequence[State] = (),
        recordings: Sequence[Any] = (),
        times: Times = NONE,
        new: Times = NONE,
        rows: Sequence[Any] = (),
        row: int = 0,
    ) -> None:
        self.number: int = 0 if before is None else before.number + 1
        self._mounts, self._recordings, self._times, self.rows, self.row = mounts, recordings, times, rows, row
        self.changes = "" if before is None or not before._mounts else self._since(before, new)

    def _since(self, before: PageFrame, new: Times) -> str:
        """Return the differences and the new answer times as a message; empty if nothing has changed."""
        mounts = {
            str(index): changed
            for index, (old, state) in enumerate(zip(before._mounts, self._mounts, strict=True))
            if (changed := {key: value for key, value in state.items() if old.get(key) != value})
        }
        diff: dict[str, Any] = {"mounts": mounts} if mounts else {}
        if before._recordings != self._recordings:
            diff["recordings"] = self._recordings
        return encoded(({"diff": diff} if diff else {}) | _line(new))

    @cached_property
    def whole(self) -> str:
        """The whole state as a message, for a new page."""
        return encoded({"state": {"mounts": self._mounts, "recordings": self._recordings}, **_line(self._times)})

    @cached_property
    def talk(self) -> str:
        """The new rows as a message; empty if there are none."""
        return talk(self.rows)


def talk(rows: Sequence[Any]) -> str:
    """Encode rows of the conversation as a message; empty if there are none."""
    return encoded({"talk": rows} if rows else {})


def encoded(message: Mapping[str, Any]) -> str:
    """Encode a message; empty if it says nothing."""
    return msgspec.json.encode(message).decode() if message else ""


def _line(times: Times) -> dict[str, Times]:
    known = {index: samples for index, samples in times.items() if samples}
    return {"line": known} if known else {}


class Publisher:
    """Makes the frames. ``recordings`` returns the state of the recording of every mount."""

    def __init__(self, gateways: Sequence[Gateway], recordings: Callable[[], list[Any]]) -> None:
        self.mounts = [ShownMount(gateway, index) for index, gateway in enumerate(gateways)]
        self._recordings = recordings
        self._loop = asyncio.get_running_loop()
        #: The newest frame; its number is 0 if there is none yet.
        self.frame = PageFrame()
        self._pages = self._listening = 0
        #: What the pages that have the newest frame wait for.
        self._waiting: list[asyncio.Future[PageFrame]] = []
        self._task: asyncio.Task[None] | None = None
        self._rows: deque[Any] = deque(maxlen=MOST)
        #: How many rows of the conversation there have been.
        self.count = 0

    def subscribe(self) -> None:
        """Count a page that will wait for frames; the first one starts the work."""
        self._pages += 1
        if self._task is None:
            for mount in self.mounts:
                mount.start()
            self._task = self._loop.create_task(self._publish())
            self._task.add_done_callback(self._failed)

    def leave(self) -> None:
        """Count a page less; after the last one, end the work and forget the frames."""
        self._pages -= 1
        if not self._pages and self._task is not None:
            task, self._task = self._task, None
            task.cancel()
            self._forget()

    def _forget(self) -> None:
        self.frame = PageFrame()
        for mount in self.mounts:
            mount.stop()

    async def next(self, seen: int) -> PageFrame:
        """Return the newest frame as soon as its number is not ``seen``. Raises ConnectionError after the end."""
        if self.frame.number and self.frame.number != seen:
            return self.frame
        if self._task is None:
            raise ConnectionError("the console has nothing to show")
        self._waiting.append(self._loop.create_future())
        return await self._waiting[-1]

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
        while True:
            began = self._loop.time()
            self.frame = await self._next()
            waiting, self._waiting = self._waiting, []
            for page in waiting:
                if not page.done():  # it is cancelled if the page was closed
                    page.set_result(self.frame)
                await let_others_run()
            await asyncio.sleep(max(began + EVERY - self._loop.time(), PAUSE))

    async def _next(self) -> PageFrame:
        states = [await mount.state() for mount in self.mounts]
        first = self.count
        if self._listening:
            await self._take_rows()
        new = {str(index): mount.answer_times.take() for index, mount in enumerate(self.mounts)}
        kept = {str(index): list(mount.answer_times.samples) for index, mount in enumerate(self.mounts)}
        await let_others_run()
        return PageFrame(self.frame, states, self._recordings(), kept, new, self.since(first), first)

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
        waiting, self._waiting = self._waiting, []
        for page in waiting:
            if not page.done():
                page.set_exception(error or ConnectionError("the console is closing"))
