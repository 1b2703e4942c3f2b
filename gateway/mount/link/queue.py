"""The queue of requests to the mount, by priority.

A stop goes first, then motion, then the position, then settings, then other reads; the priority of a request that has
waited long rises. A read that would delay something urgent waits for it. Pure functions decide which request is next.
"""

from __future__ import annotations

import asyncio
import heapq
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count
from typing import Any

from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.waiting import TimedEvent
from gateway.protocols.base.driver import Send

#: The priorities of requests, the most urgent first; AGED_READ is that of a read which has waited long.
STOP, MOTION, POSITION, AGED_READ, SETTING, READ = range(6)
READS = (POSITION, READ)
#: Seconds after which the start of a motion by hand is refused instead of sent: by then the user has released the key
#: or pressed another.
MAX_START_DELAY = 2.0
#: The message if the start of a motion by hand is refused as too late.
START_TOO_LATE_MESSAGE = "The line to the mount was busy for too long: this motion was not started."
#: Seconds after which the priority of a request rises. A read then goes before settings, so that clients that set
#: values without pause do not hide the mount. A position goes before both: its two coordinates must be of one instant.
AGING_TIMES: Mapping[int, float] = {POSITION: 0.25, READ: 0.6, SETTING: 2.0}
#: After this many motion exchanges in a row an aged read goes first: a flood of arrow commands must not hide the mount.
MAX_MOTIONS_IN_A_ROW = 1
#: After this many exchanges an aged setting goes first: a slow or hibernating mount always has reads waiting.
MAX_SETTING_SKIPS = 4
#: Reads wait if an urgent request is due within URGENT_FACTOR reply times: until URGENT_GRACE seconds after it is due.
URGENT_FACTOR, URGENT_GRACE = 1.5, 0.05
#: Event loop iterations in which a client that got a reply may queue its next request. Then the second half of a
#: position, a motion or a stop goes before other clients' reads. Five would do; recordings rely on eight.
FOLLOW_UP_ITERATIONS = 8

#: The future of a command's reply: its fields, and the seconds that it took.
Outcome = asyncio.Future[tuple[dict[str, Any], float]]


class QueuedCommand:
    """A command that waits for its turn; ``number`` is its sequence number."""

    __slots__ = ("command", "future", "number", "priority", "queued_at")

    def __init__(self, command: Send, priority: int, number: int, future: Outcome) -> None:
        self.command, self.priority, self.number, self.future = command, priority, number, future
        self.queued_at = future.get_loop().time()

    def fail(self, fault: Fault) -> None:
        if not self.future.done():
            self.future.set_exception(fault)


class RequestQueue:
    """The waiting requests: ``add`` queues a request, ``next`` returns the request whose turn it is."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._numbers = count()
        self._waiting: list[QueuedCommand] = []
        self._urgent_times: list[float] = []
        self._motions_in_a_row = self._setting_skips = 0
        self._wake_event = TimedEvent()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, command: Send, priority: int) -> Outcome:
        """Queue a command and return the future of its reply."""
        future: Outcome = self._loop.create_future()
        self._waiting.append(QueuedCommand(command, priority, next(self._numbers), future))
        self._wake_event.set()
        return future

    def wake(self) -> None:
        """Wake the worker, because the state of the line has changed."""
        self._wake_event.set()

    def expect_urgent(self, urgent_at: float) -> None:
        """Hold back reads that would delay an urgent request that is expected at this loop time."""
        heapq.heappush(self._urgent_times, urgent_at)

    @property
    def has_waiting_stop(self) -> bool:
        for request in self._waiting:  # noqa: SIM110  # called in every iteration, and faster than a generator
            if request.priority == STOP and not request.future.done():
                return True
        return False

    async def wait_for_change(self) -> None:
        """Wait until a request is added or ``wake`` is called."""
        self._wake_event.clear()
        await self._wake_event.wait()

    async def wait_for_change_within(self, seconds: float) -> bool:
        """Like `wait_for_change`, but for so many seconds at most; return whether anything changed."""
        self._wake_event.clear()
        return await self._wake_event.wait_within(seconds)

    async def next(
        self, typical_rtt: float, remaining_quiet: Callable[[Send], float], client_answered: bool = False
    ) -> QueuedCommand | None:
        """Return the request whose turn it is, or None if this call only waited and must be repeated.

        ``typical_rtt`` is the average reply time (seconds), ``remaining_quiet`` returns the seconds of quiet due
        before a command. ``client_answered``: a client got a reply just now, and may queue its next request first.
        """
        if client_answered:
            await self._let_clients_follow_up()
        now = self._loop.time()
        self._waiting = [request for request in self._waiting if not self._is_settled(request, now)]
        if not self._waiting:
            await self.wait_for_change()
            await self._let_clients_follow_up()  # the event that queued a read may queue a stop as well
            return None
        while self._urgent_times and self._urgent_times[0] < now - 0.05:
            heapq.heappop(self._urgent_times)
        first = self.sorted_by_turn()[0]
        pause = hold_back_time(first, now, self._urgent_times[0] if self._urgent_times else None, typical_rtt)
        if pause is not None:
            if not await self.wait_for_change_within(pause):
                heapq.heappop(self._urgent_times)
            return None
        quiet = 0.0 if first.priority == STOP else remaining_quiet(first.command)
        if quiet > 0:
            await self.wait_for_change_within(quiet)
            return None
        self.dequeue(first)
        return first

    def sorted_by_turn(self) -> list[QueuedCommand]:
        return sort_queue(self._waiting, self._loop.time(), self._motions_in_a_row, self._setting_skips)

    def dequeue(self, request: QueuedCommand) -> None:
        self._waiting.remove(request)
        self._motions_in_a_row = self._motions_in_a_row + 1 if request.priority == MOTION else 0
        self._setting_skips = 0 if request.priority == SETTING else self._setting_skips + 1

    @types.coroutine
    def _let_clients_follow_up(self) -> Iterator[None]:
        """Let clients that just got a reply queue their next request, unless the queue is empty or holds a stop."""
        for _ in range(FOLLOW_UP_ITERATIONS):
            if not self._waiting or self.has_waiting_stop:
                return
            yield  # one event loop iteration, cheaper than asyncio.sleep(0)

    def send_stops_while_busy(self, refuse_others: bool, send: Callable[[Send], bool | None]) -> int:
        """During a long operation of the mount, send the stops that need no reply; return how many were sent.

        ``send`` returns whether a stop was sent, or None if it needs a reply. If ``refuse_others``, the operation lasts
        so long that all other requests are refused.
        """
        sent, waiting = 0, sorted(self._waiting, key=lambda request: (request.priority, request.number))
        self._waiting = []
        for request in waiting:
            if request.future.done():
                continue
            if request.priority == STOP and (was_sent := send(request.command)) is not None:
                sent += was_sent
                request.future.set_result(({}, 0.0))
            elif refuse_others:
                request.fail(Busy())
            else:
                self._waiting.append(request)
        return sent

    def encoded_stops(self, encode: Callable[[Send], bytes]) -> list[bytes]:
        """Return the stops that wait, as bytes; they continue to wait for their acknowledgement."""
        return [encode(each.command) for each in self._waiting if each.priority == STOP and not each.future.done()]

    def fail_all(self) -> None:
        """Fail all waiting requests with NoAnswer: the line is lost."""
        for request in sorted(self._waiting, key=lambda request: (request.priority, request.number)):
            request.fail(NoAnswer())
        self._waiting.clear()

    def _is_settled(self, request: QueuedCommand, now: float) -> bool:
        """Whether the request needs no sending: it was cancelled, or has waited too long and is refused now."""
        if not request.future.done() and is_too_late(request, now):
            request.future.set_exception(Busy(START_TOO_LATE_MESSAGE))
        return request.future.done()


def sort_queue(
    waiting: Iterable[QueuedCommand], now: float, motion_count: int, setting_skips: int
) -> list[QueuedCommand]:
    """Return the waiting requests in the order in which they will be sent, if the last ``motion_count`` exchanges were
    motions and the last ``setting_skips`` exchanges no settings.
    """
    before_all = STOP + 0.5
    waited = before_all if motion_count >= MAX_MOTIONS_IN_A_ROW else AGED_READ
    risen = {POSITION: waited, READ: waited, SETTING: before_all if setting_skips >= MAX_SETTING_SKIPS else SETTING}

    def sort_key(queued: QueuedCommand) -> tuple[float, int, int]:
        aged = now - queued.queued_at > AGING_TIMES.get(queued.priority, 1e9)
        return min(queued.priority, risen[queued.priority]) if aged else queued.priority, queued.priority, queued.number

    return sorted(waiting, key=sort_key)


def hold_back_time(request: QueuedCommand, now: float, urgent_at: float | None, typical_rtt: float) -> float | None:
    """Return the seconds that a read waits for a request due at loop time ``urgent_at``; None if it need not wait."""
    if urgent_at is None or request.priority not in READS or urgent_at - now >= URGENT_FACTOR * typical_rtt:
        return None
    return max(0.0, urgent_at - now) + URGENT_GRACE


def is_too_late(request: QueuedCommand, now: float) -> bool:
    """Whether the request begins a motion by hand that was asked for too long ago."""
    return request.command.at_once_or_never and now - request.queued_at > MAX_START_DELAY
