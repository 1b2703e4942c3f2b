"""Publishes the state of all mounts: while a page is open, one task makes the same message for all pages.

The message is encoded once for all pages: ten times a second while a mount moves or something has changed, else
once a second. Collecting the state of a mount takes 0.1 ms. The mount's abilities, the connected clients with their
last commands, and Sun, Moon and planets are cached for longer.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from gateway.app.gateway import Gateway
from gateway.app.status import AverageRate
from gateway.console.shown import view
from gateway.console.shown.talk import MAX_ROWS, ConversationView, surface_of_client
from gateway.core.wire_log import MOUNT_SIDE, Entry, printable

#: How many answer times are stored for new pages.
MAX_ANSWER_TIMES = 240

#: When the mount answered (Unix seconds), and how long it took (milliseconds; None for a failed exchange).
AnswerSample = tuple[float, float | None]
#: For how many clients the last command is stored; how many bytes of it are shown.
MAX_CLIENTS, MAX_COMMAND_BYTES = 200, 40
#: Cache times in seconds: for all bodies of the solar system; while some are missing; for clients and abilities.
BODIES_CACHE_TIME, BODIES_RETRY_TIME, OTHER_CACHE_TIME = 10.0, 1.0, 1.0
#: Seconds of answer times that a message contains.
ANSWER_TIMES_WINDOW = 3.0


class AnswerTimes:
    """Collects the mount's answer times, and counts its failed exchanges, from a wire log."""

    def __init__(self) -> None:
        self.samples: deque[AnswerSample] = deque(maxlen=MAX_ANSWER_TIMES)
        self.fault_count = 0
        self._asked_at = 0.0
        #: The average number of replies of the mount per second.
        self.answer_rate = AverageRate()

    def put(self, entry: Entry) -> None:
        """Receive an entry; this is a sink of the wire log."""
        if entry.side != MOUNT_SIDE:
            return
        if entry.arrow == ">":
            self._asked_at = entry.time
        elif entry.arrow == "<":
            failed = bool(entry.note)
            self.fault_count += failed
            answer_time = None if failed else round((entry.time - self._asked_at) * 1e3, 1)
            self.samples.append((round(entry.time, 3), answer_time))

    def newest_samples(self, now: float) -> list[AnswerSample]:
        """Return the samples of the last ``ANSWER_TIMES_WINDOW``, some sent before: a page may miss a message."""
        return [sample for sample in self.samples if sample[0] > now - ANSWER_TIMES_WINDOW]


class ConnectedPrograms:
    """Collects the last command and the command rate of every client from a wire log."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._last_commands: dict[str, bytes] = {}
        self._command_count: dict[str, int] = {}
        self._command_rates: dict[str, AverageRate] = {}

    def put(self, entry: Entry) -> None:
        """Receive an entry; this is a sink of the wire log."""
        side = entry.side
        if side == MOUNT_SIDE:
            return
        if entry.arrow == "-":
            for known in (self._last_commands, self._command_count, self._command_rates):
                known.pop(side, None)
        elif entry.arrow == ">":
            if side not in self._last_commands and len(self._last_commands) >= MAX_CLIENTS:
                return
            self._last_commands[side] = entry.data
            self._command_count[side] = self._command_count.get(side, 0) + 1

    def connections(self, now: float) -> Iterator[dict[str, Any]]:
        """Yield every connection: name, surface, profile, last command, commands a second, whether it is read-only."""
        acceptors = zip(self._gateway.names(), self._gateway.acceptors, strict=False)
        visits = [(surface, visit) for surface, acceptor in acceptors for visit in acceptor.connections()]
        for surface, visit in visits:
            client, side = visit.client, visit.client.log.name
            rate = self._command_rates.setdefault(side, AverageRate()).add_sample(now, self._command_count.get(side, 0))
            yield {
                "name": printable(side.encode()), "surface": surface_of_client(surface, visit.protocol),
                "profile": visit.program_name,
                "last": printable(self._last_commands.get(side, b"")[:MAX_COMMAND_BYTES]), "rate": round(rate, 1),
                "read_only": client.command_runner.rights.read_only,
            }  # fmt: skip


class ShownMount:
    """The state of a mount for pages. It collects data between ``start`` and ``stop``, while pages are open."""

    def __init__(self, gateway: Gateway, mount_index: int) -> None:
        self.gateway, self._mount_index = gateway, mount_index
        self.answer_times, self.conversation, self._connected_programs = (
            AnswerTimes(),
            ConversationView(gateway, mount_index),
            ConnectedPrograms(gateway),
        )
        self._program_list: list[dict[str, Any]] = []
        self._bodies: list[dict[str, Any]] = []
        self._abilities: dict[str, Any] = {}
        self._programs_cached_at = self._bodies_cached_at = self._abilities_cached_at = -1e9
        self._bodies_cache_key: Any = None
        self._loop = asyncio.get_running_loop()

    def start(self) -> None:
        """Begin to collect data from the wire log."""
        self.gateway.wire_log.sinks += [self.answer_times.put, self._connected_programs.put]
        self._programs_cached_at = -1e9

    def stop(self) -> None:
        """Stop collecting data."""
        for sink in (self.answer_times.put, self._connected_programs.put):
            self.gateway.wire_log.remove_sink(sink)

    def state(self) -> dict[str, Any]:
        """Return the whole state of the mount."""
        controller, now = self.gateway.controller, self._loop.time()
        state = view.state(self.gateway, self._mount_index)
        if now - self._abilities_cached_at >= OTHER_CACHE_TIME:
            self._abilities_cached_at, self._abilities = now, view.abilities(controller)
        many = sum(len(acceptor.connections()) for acceptor in self.gateway.acceptors)
        if now - self._programs_cached_at >= OTHER_CACHE_TIME or many != len(self._program_list):
            self._programs_cached_at, self._program_list = now, list(self._connected_programs.connections(now))
        rate = self.answer_times.answer_rate.add_sample(controller.now(), controller.line.times.reply_count)
        state["line"] |= {"rate": round(rate, 1), "faults": self.answer_times.fault_count}
        times = self.answer_times.newest_samples(controller.wire_log.clock())
        return {**state, **self._abilities, "programs": self._program_list, "bodies": self._sky(now), "times": times}

    def _sky(self, now: float) -> list[dict[str, Any]]:
        """Return Sun, Moon and planets, computed again when they are old, the site changes, or an almanac arrives."""
        controller = self.gateway.controller
        cache_key = controller.sources.site(), controller.astrometry.sky.has_tables
        cache_time = BODIES_CACHE_TIME if len(self._bodies) == len(view.BODIES) else BODIES_RETRY_TIME
        if now - self._bodies_cached_at >= cache_time or cache_key != self._bodies_cache_key:
            self._bodies_cached_at, self._bodies_cache_key, self._bodies = now, cache_key, list(view.bodies(controller))
        return self._bodies


#: Seconds between two messages while something moves, and at rest.
MOTION_PERIOD, REST_PERIOD = 0.1, 1.0
#: Fields of the state that change all the time, even at rest; they alone do not cause a message.
VOLATILE = {"position", "sidereal", "hour_angle", "clock", "line", "times", "programs", "bodies", "wanted", "lately"}
#: Seconds for which rows are made without a pause, and seconds of a pause for other tasks. The pause lets an exchange
#: with the mount begin; a stop needs several iterations of the event loop to reach the line.
WORK_SLICE, SLICE_PAUSE = 0.0005, 0.001


class Publisher:
    """Makes the state messages for all pages. ``recordings`` returns the state of the recording of every mount."""

    def __init__(self, gateways: Sequence[Gateway], recordings: Callable[[], list[Any]]) -> None:
        self.mounts = [ShownMount(gateway, index) for index, gateway in enumerate(gateways)]
        self._recordings = recordings
        self._loop = asyncio.get_running_loop()
        #: The newest message; empty while there is none.
        self.message_text = ""
        self._page_count = self._listener_count = 0
        #: Done when there is a new message or row; all pages wait for it.
        self._next_message: asyncio.Future[None] = self._loop.create_future()
        self._task: asyncio.Task[None] | None = None
        self._rows: deque[Any] = deque(maxlen=MAX_ROWS)
        #: How many rows of the conversation were made, stored or dropped.
        self.row_count = 0

    def add_page(self) -> None:
        """Count one more page that waits for messages; the first starts the task that makes them."""
        self._page_count += 1
        if self._task is None:
            for mount in self.mounts:
                mount.start()
            self._task = self._loop.create_task(self._publish())
            self._task.add_done_callback(self._on_task_ended)

    def remove_page(self) -> None:
        """Count one page less; after the last page, end the task."""
        self._page_count -= 1
        if not self._page_count and self._task is not None:
            self._task.cancel()
            self._stop()

    async def wait_for_message(self) -> None:
        """Wait for the next message or more rows. Raises ConnectionError if the task has ended."""
        if self._task is None:
            raise ConnectionError("the page has nothing to show")
        await asyncio.shield(self._next_message)

    def change_listeners(self, change: int) -> None:
        """Count one more (1) or less (-1) page that shows the conversation; without any, no rows are made."""
        self._listener_count += change
        for mount in self.mounts:
            mount.conversation.listen(self._listener_count > 0)

    def rows_since(self, row: int) -> Sequence[Any]:
        """Return the rows of the conversation from this number on, as far as they are still stored."""
        missed = min(self.row_count - row, len(self._rows))
        return list(self._rows)[-missed:] if missed > 0 else []

    async def _publish(self) -> None:
        before, due = None, 0.0
        while True:
            rows = self.row_count
            await self._make_rows()
            states, recordings = [mount.state() for mount in self.mounts], self._recordings()
            steady = [{key: value for key, value in state.items() if key not in VOLATILE} for state in states]
            moves = any(state["moves"] for state in states)
            if moves or (steady, recordings) != before or self._loop.time() >= due:
                before, due = (steady, recordings), self._loop.time() + REST_PERIOD - MOTION_PERIOD / 2
                self.message_text = encode({"mounts": states, "recordings": recordings})
            elif rows == self.row_count:
                await asyncio.sleep(MOTION_PERIOD)
                continue
            shown, self._next_message = self._next_message, self._loop.create_future()
            shown.set_result(None)
            await asyncio.sleep(MOTION_PERIOD)

    async def _make_rows(self) -> None:
        """Make rows of the log entries that wait, at most ``MAX_ROWS``."""
        began, end = time.perf_counter(), self.row_count + MAX_ROWS
        for mount in self.mounts:
            for row in mount.conversation.take_rows():
                self._rows.append(row)
                self.row_count += 1
                if self.row_count >= end:
                    return
                if time.perf_counter() - began > WORK_SLICE:
                    await asyncio.sleep(SLICE_PAUSE)
                    began = time.perf_counter()

    def _stop(self) -> None:
        self._task, self.message_text = None, ""
        for mount in self.mounts:
            mount.stop()

    def _on_task_ended(self, task: asyncio.Task[None]) -> None:
        """If the task has failed, disconnect the pages; they connect again, which starts a new task."""
        if task is self._task and not task.cancelled():
            self._stop()
            error = task.exception()
            self.mounts[0].gateway.wire_log.note("console", f"internal error, please report it: {error!r}")
            shown, self._next_message = self._next_message, self._loop.create_future()
            shown.set_exception(ConnectionError("the console has a defect"))
            shown.exception()  # perhaps nobody waits for it


def encode(message: object) -> str:
    """Encode a message as JSON."""
    return msgspec.json.encode(message).decode()
