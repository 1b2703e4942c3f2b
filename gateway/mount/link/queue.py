"""The exchanges that wait for the line, and whose turn it is.

A stop goes first, then motion, then the position, then settings, then other reads; what has waited long rises in rank.
A read that would delay something urgent waits for that. Who goes first is decided by pure functions.
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

STOP, MOTION, POSITION, WAITED, SETTING, READ = range(6)
READS = (POSITION, READ)
#: What begins a motion by hand is refused when it could not be sent within so many seconds: whoever pressed the key has
#: let it go by then, or pressed another.
AT_ONCE = 2.0
#: What is said of it.
LATE = "The line to the mount was busy for too long: this motion is not begun any more."
#: Seconds after which a read has WAITED and goes before settings: clients that set without end must not blind the
#: gateway. The position always does, and before other reads: its halves must be of one instant.
AGED: Mapping[int, float] = {POSITION: 0.25, READ: 0.6, SETTING: 2.0}
#: After so many exchanges for motions in a row one such read goes first: no flood of arrows may hide the mount.
IN_A_ROW = 1
#: After so many exchanges for others an aged setting goes first: reads of a mount that is slow or asleep never end.
PASSED_OVER = 4
#: Something urgent is waited for that is due within so many times what an exchange takes, and this many seconds longer.
BEFORE_URGENT, AFTER_DUE = 1.5, 0.05
#: Turns of the event loop in which whoever had an answer may ask on: the second half of a position, a motion that
#: waited for one, and a halt that is coming go before reads of a lower rank. Five would do; recordings count on eight.
TURNS = 8

Outcome = asyncio.Future[tuple[dict[str, Any], float]]


class Request:
    """An exchange that waits for its turn; ``number`` counts them."""

    __slots__ = ("ask", "asked", "chosen", "future", "number", "rank")

    def __init__(self, ask: Send, rank: int, number: int, future: Outcome) -> None:
        self.ask, self.rank, self.number, self.future = ask, rank, number, future
        self.asked = future.get_loop().time()
        #: It was this one's turn, and only quiet was waited for: a read that comes meanwhile does not go before it.
        self.chosen = False

    def fail(self, fault: Fault) -> None:
        if not self.future.done():
            self.future.set_exception(fault)


class RequestQueue:
    """``add`` puts one in, ``next`` takes out the one whose turn it is."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._numbers = count()
        self._waiting: list[Request] = []
        self._urgent: list[float] = []
        self._motions = self._passed_over = 0
        self._wake = TimedEvent()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, ask: Send, rank: int) -> Outcome:
        """An exchange that is asked for now -> its outcome."""
        future: Outcome = self._loop.create_future()
        self._waiting.append(Request(ask, rank, next(self._numbers), future))
        self._wake.set()
        return future

    def wake(self) -> None:
        """Something has happened that whoever waits here must look at."""
        self._wake.set()

    def expect_urgent(self, when: float) -> None:
        """Something urgent will be due at this loop time: reads that would delay it are held back."""
        heapq.heappush(self._urgent, when)

    @property
    def stop_waits(self) -> bool:
        for request in self._waiting:  # noqa: SIM110  # asked in every turn: a generator costs more than the rest
            if request.rank == STOP and not request.future.done():
                return True
        return False

    async def news(self) -> None:
        """Wait until something comes or happens."""
        self._wake.clear()
        await self._wake.wait()

    async def woken(self, seconds: float) -> bool:
        """The same for so many seconds at most -> whether it did."""
        self._wake.clear()
        return await self._wake.within(seconds)

    async def next(self, typical: float, gap: Callable[[Send], float], answered: bool = False) -> Request | None:
        """The request whose turn it is; None when that was waited for, and must be looked at again.

        ``typical`` is how long an exchange takes, ``gap`` how much quiet a question still wants before it. Whoever
        was ``answered`` just now may ask on first.
        """
        if answered:
            await self._what_follows()
        now = self._loop.time()
        self._waiting = [request for request in self._waiting if not self._over(request, now)]
        if not self._waiting:
            await self.news()
            await self._what_follows()  # what woke a read may have brought a stop as well
            return None
        while self._urgent and self._urgent[0] < now - 0.05:
            heapq.heappop(self._urgent)
        first = self.in_turn()[0]
        pause = held_back(first, now, self._urgent[0] if self._urgent else None, typical)
        if pause is not None:
            if not await self.woken(pause):
                heapq.heappop(self._urgent)
            return None
        quiet = 0.0 if first.rank == STOP else gap(first.ask)
        if quiet > 0:
            first.chosen = True
            await self.woken(quiet)
            return None
        self.take(first)
        return first

    def in_turn(self) -> list[Request]:
        return in_turn(self._waiting, self._loop.time(), self._motions, self._passed_over)

    def take(self, first: Request) -> None:
        self._waiting.remove(first)
        self._motions = self._motions + 1 if first.rank == MOTION else 0
        self._passed_over = 0 if first.rank == SETTING else self._passed_over + 1

    @types.coroutine
    def _what_follows(self) -> Iterator[None]:
        """Give whoever had an answer its turns, unless nothing or a stop waits."""
        for _ in range(TURNS):
            if not self._waiting or self.stop_waits:
                return
            yield  # a turn, as asyncio.sleep(0) is one; there are eight to an exchange

    def while_it_works(self, busy: bool, send: Callable[[Send], bool | None]) -> int:
        """The mount is at long work: have the stops sent that need no answer -> how many were.

        ``send`` says of a stop whether it was, None where it needs an answer. Once it is ``busy`` all else is refused.
        """
        sent, waiting = 0, sorted(self._waiting, key=lambda request: (request.rank, request.number))
        self._waiting = []
        for request in waiting:
            if request.future.done():
                continue
            if request.rank == STOP and (there := send(request.ask)) is not None:
                sent += there
                request.future.set_result(({}, 0.0))
            elif busy:
                request.fail(Busy())
            else:
                self._waiting.append(request)
        return sent

    def fail_all(self) -> None:
        """The line is lost: whatever waits gets no answer."""
        for request in sorted(self._waiting, key=lambda request: (request.rank, request.number)):
            request.fail(NoAnswer())
        self._waiting.clear()

    def _over(self, request: Request, now: float) -> bool:
        """Whether nobody waits for it, or it has waited too long."""
        if not request.future.done() and too_late(request, now):
            request.future.set_exception(Busy(LATE))
        return request.future.done()


def in_turn(waiting: Iterable[Request], now: float, motions: int, passed_over: int) -> list[Request]:
    """Whatever waits, in the order in which its turn comes.

    ``motions`` is how many exchanges in a row were for motions, ``passed_over`` how many since the last setting.
    """
    before_all = STOP + 0.5
    waited = before_all if motions >= IN_A_ROW else WAITED
    risen = {POSITION: waited, READ: waited, SETTING: before_all if passed_over >= PASSED_OVER else SETTING}

    def turn(one: Request) -> tuple[float, int, int]:
        if one.chosen and one.rank in READS:
            return POSITION - 0.5, one.rank, one.number
        aged = now - one.asked > AGED.get(one.rank, 1e9)
        return min(one.rank, risen[one.rank]) if aged else one.rank, one.rank, one.number

    return sorted(waiting, key=turn)


def held_back(first: Request, now: float, urgent: float | None, typical: float) -> float | None:
    """Seconds for which a read waits for something ``urgent`` that is due then; None when it need not.

    ``typical`` is how long an exchange takes.
    """
    if urgent is None or first.rank not in READS or urgent - now >= BEFORE_URGENT * typical:
        return None
    return max(0.0, urgent - now) + AFTER_DUE


def too_late(one: Request, now: float) -> bool:
    """Whether it begins a motion by hand that is no longer meant."""
    return one.ask.prompt and now - one.asked > AT_ONCE
