"""The line to the mount: one exchange at a time, in order of rank.

Stop goes first, then motion, then settings, then reads. A mount that is busy with itself for long is left alone, but
for a stop. After a silence, or an answer of the wrong form, nothing is sent before the line has been proven to be in
step. A lost port is opened again with growing pauses, for ever; one that stays mute is closed and opened anew.
"""

from __future__ import annotations

import asyncio
import contextlib
import heapq
import types
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

from gateway.core.errors import Busy, Fault, NoAnswer, Silence
from gateway.core.wire_log import Transcript
from gateway.mount.link.transaction import QUIET, Transaction
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import Transport

STOP, MOTION, POSITION, WAITED, SETTING, READ = range(6)
#: How often the line is proven before it counts as down; after a proof that failed, so many times more quiet is wanted.
PROOFS, QUIETER = 3, 3.0
#: After half a command nothing is sent for this long: a hand control would take it for the other half.
HALF_COMMAND = 3.5
#: What begins a motion by hand is refused when it could not be sent within so many seconds: whoever pressed the key has
#: let it go by then, or pressed another.
AT_ONCE = 2.0
#: Between two commands whose answers nobody waits for.
BLIND = 0.2
#: A port that nobody has answered on for this long is opened anew.
MUTE = 20.0
#: Seconds after which a read has WAITED and goes before settings: clients that set without end must not blind the hub.
#: The position always does, and before other reads: its halves must be of one instant.
AGED = {POSITION: 0.25, READ: 0.6, SETTING: 2.0}
READS = (POSITION, READ)
#: After so many exchanges for motions in a row one such read goes first: no flood of arrows may hide the mount.
IN_A_ROW = 1
#: After so many exchanges for others an aged setting goes first: reads of a mount that is slow or asleep never end.
PASSED_OVER = 4
#: Turns of the event loop in which whoever had an answer may ask on: the second half of a position, a motion that
#: waited for one, and a halt that is coming go before reads of a lower rank.
TURNS = 8
#: Timers come up to so much too early: who waits for the rest of it waits at least so long.
TICK = 0.001
#: What is said of it.
LATE = "The line to the mount was busy for too long: this motion is not begun any more."
#: Seconds after which an answer is overdue: whether the mount hears at all is not known from then on.
OVERDUE = 2.0
BACK_OFF = (0.5, 1.0, 2.0, 5.0)


class Request:
    """An exchange that waits for its turn."""

    __slots__ = ("ask", "asked", "chosen", "future", "rank")

    def __init__(self, ask: Send, rank: int, future: asyncio.Future[tuple[dict[str, Any], float]]) -> None:
        self.ask, self.rank, self.future, self.asked = ask, rank, future, future.get_loop().time()
        #: It was this one's turn, and only quiet was waited for: a read that comes meanwhile does not go before it.
        self.chosen = False


class MountLink:
    """Owns the wire. ``state`` is ``opening``, ``up``, ``busy`` or ``down``; ``on_up`` is called when it comes up."""

    def __init__(self, wire: Transport, dialogue: ReplyRules, transcript: Transcript) -> None:
        self.wire, self.dialogue, self.transcript = wire, dialogue, transcript
        self.talk = Transaction(lambda data: self.wire.write(data), self._meanwhile, self._pause, dialogue, transcript)
        self.state = "opening"
        self.on_up: Callable[[], None] = lambda: None
        #: Called when the port is open again -> the requests that go out before anything else, a stop that is owed.
        self.first_words: Callable[[], list[bytes]] = list
        self.reason = ""
        self._now = asyncio.get_running_loop().time
        self._order = count()
        self._queue: list[tuple[int, int, Request]] = []
        self._wake = asyncio.Event()
        self._opened = self._motions = self._passed_over = 0
        self._urgent: list[float] = []
        self._hurried = self._spoken_on = False
        #: Since when what was sent has not been answered; None while all is well.
        self._silent_since: float | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to open the wire and to serve exchanges."""
        self._task = asyncio.get_running_loop().create_task(self._run())

    @property
    def served(self) -> bool:
        """Whether exchanges are carried out at all: not before the start, nor once the worker has ended."""
        return self._task is not None and not self._task.done()

    @property
    def typical(self) -> float:
        """How long an answer takes, seconds."""
        return self.talk.typical

    @property
    def occupied(self) -> bool:
        """Whether the mount is at a long piece of work and hears nothing but a stop."""
        return self.state == "busy" or self.talk.long

    @property
    def overdue(self) -> bool:
        """Whether an answer has not come for so long that the mount seems not to hear."""
        if self._silent_since is None or self.occupied:
            return False
        return self._now() - self._silent_since > max(OVERDUE, 2.5 * self.typical)

    def worked_after(self, when: float) -> bool:
        """Whether it has been at a long piece of work since this loop time."""
        return self.occupied or self.talk.long_until >= when

    @property
    def answers(self) -> int:
        """How many the mount has given."""
        return self.talk.answers

    async def close(self) -> None:
        """End the worker and close the wire; whatever waits, and whatever comes, gets no answer."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await self.wire.close()
        self.state = "down"
        self._fail_all()

    def expect_urgent(self, when: float) -> None:
        """Something urgent will be due at this loop time: reads that would delay it are held back."""
        heapq.heappush(self._urgent, when)

    def distrust(self) -> None:
        """Another process has spoken on the wire: the line is proven to be in step before it is used again."""
        self._spoken_on = True
        self._wake.set()

    async def exchange(self, ask: Send, rank: int = READ) -> dict[str, Any]:
        """Send a command when its turn comes and return the reply's fields. Raises Fault."""
        return (await self.timed(ask, rank))[0]

    async def timed(self, ask: Send, rank: int) -> tuple[dict[str, Any], float]:
        """The same, and the seconds the reply took. Raises Fault, which knows them, too."""
        if self.state == "down":
            unheard = NoAnswer()
            unheard.sent = False
            raise unheard
        if self.state == "busy" and rank != STOP:
            raise Busy
        future: asyncio.Future[tuple[dict[str, Any], float]] = asyncio.get_running_loop().create_future()
        self._queue.append((rank, next(self._order), Request(ask, rank, future)))
        self._wake.set()
        self.talk.nudge(rank == STOP)
        return await future

    def doubt(self, ask: Send) -> int:
        """How many answers to older questions may still come that could be taken for the answer to this one."""
        return self.talk.doubt.count(ask, self._now())

    async def clear_of_doubt(self, ask: Send) -> None:
        """Wait until there is none."""
        while (left := self.talk.doubt.until(ask, self._now()) - self._now()) > 0:
            await asyncio.sleep(max(left, TICK))

    # --- the worker -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failures = 0
        while True:
            self._opened += 1
            self.talk.lost = False
            try:
                await self.wire.open(*self._callbacks(self._opened))
            except Exception as error:  # pyserial has more kinds of failure than OSError
                reason = str(getattr(error, "strerror", None) or error)
                self.transcript.put("mount", "v", note=reason)
                self._down(f"cannot open {self.wire.name}: {reason}")
                await asyncio.sleep(BACK_OFF[min(failures, len(BACK_OFF) - 1)])
                failures += 1
                continue
            failures = 0
            self.transcript.put("mount", "^")
            self.talk.drop("came before the line was lost")
            if self.talk.wrote > 0:  # something was said on this line before: it may still be answered
                await self._reopened()
            else:
                self._up()
            try:
                await self._serve()
            except Exception as error:  # a defect here must not leave the mount without a line for ever
                self.transcript.note("mount", f"internal error, please report it: {error!r}")
                self._down("internal error")
                await asyncio.sleep(BACK_OFF[0])
            await self.wire.close()

    def _callbacks(self, opening: int) -> tuple[Callable[[bytes], None], Callable[[str], None]]:
        """What a wire calls; a reader that outlived its opening is not listened to."""

        def on_data(data: bytes) -> None:
            if opening == self._opened:
                self.talk.hear(data)

        def on_lost(reason: str) -> None:
            if opening == self._opened:
                self.talk.lose(reason)
                self._wake.set()

        return on_data, on_lost

    async def _reopened(self) -> None:
        """The wire is back: what is owed goes first, and nothing is taken for granted of what is on it."""
        words, half = self.first_words(), self.talk.half
        self.talk.half = False
        if half and not (words and (self.dialogue.closing or len(self.talk.request) == 1)):
            await asyncio.sleep(max(0.0, self.talk.wrote + HALF_COMMAND - self._now()))
        for number, word in enumerate(words):
            if not self.talk.send((self.dialogue.closing if half and not number else b"") + word):
                return
            await asyncio.sleep(BLIND)
        await self._recover()

    async def _serve(self) -> None:
        """Serve jobs until the wire is lost."""
        while not self.talk.lost:
            if self._spoken_on:
                self._spoken_on = False
                await self._recover()
            job = await self._next()
            if job is None:
                continue
            hurried, self._hurried = self._hurried, False
            self._motions = self._motions + 1 if job.rank == MOTION else 0
            self._passed_over = 0 if job.rank == SETTING else self._passed_over + 1
            self._silent_since = self._silent_since or self._now()
            outcome = await self._carry_out(job, hurried)
            if not isinstance(outcome, NoAnswer | Silence):
                self._silent_since = None
            if self.state == "busy":
                self.state = "up"
            if not job.future.done():
                if isinstance(outcome, Fault):
                    outcome.took = self.talk.took
                    job.future.set_exception(outcome)
                else:
                    job.future.set_result((outcome, self.talk.took))
                await self._what_follows()
            if isinstance(outcome, Silence) and self.dialogue.leaves_open(job.ask):
                self.talk.send(self.dialogue.closing)
                await self.talk.drain(max(QUIET, 2.0 * self.talk.typical))
            if isinstance(outcome, NoAnswer | Silence):
                await self._recover()
        self._down(f"{self.wire.name} was lost")

    async def _carry_out(self, job: Request, hurried: bool) -> dict[str, Any] | Fault:
        """The exchange; when it does not come to an end, nobody waits for that."""
        try:
            outcome = await self.talk.exchange(job.ask, firm=hurried)
            if hurried and job.rank == STOP and self.dialogue.pace(job.ask):
                outcome = await self.talk.exchange(job.ask)  # a scope that needs its pause may have missed it
            return outcome
        except BaseException:
            if not job.future.done():
                job.future.set_exception(NoAnswer())
            raise

    @types.coroutine
    def _what_follows(self) -> Iterator[None]:
        """Give whoever had an answer its turns, unless nothing or a stop waits."""
        for _ in range(TURNS):
            if not self._queue or self._stop_waits():
                return
            yield  # a turn, as asyncio.sleep(0) is one; there are eight to an exchange

    def _stop_waits(self) -> bool:
        """Whether a stop is in the queue that is still wanted."""
        for rank, _, job in self._queue:  # noqa: SIM110  # asked in every turn: a generator costs more than the rest
            if rank == STOP and not job.future.done():
                return True
        return False

    async def _pause(self, seconds: float, firm: bool) -> bool:
        """Give a scope time after a command without a reply. A stop cuts it short, unless ``firm``: then False."""
        until = self._now() + seconds
        while not self.talk.lost and (left := until - self._now()) > 0:
            if not firm and self._stop_waits():
                self._hurried = True
                return False
            self._wake.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await self._wake.wait()
        return True

    async def _recover(self) -> None:
        """Bring the line into step again, however long that takes, unless the wire is lost meanwhile."""
        began = self._now()
        while not self.talk.lost:
            if await self._prove():
                self._up()
                return
            self._down("the mount does not answer")
            if self._now() - began > MUTE:
                self.talk.lose("mute")
            else:
                await asyncio.sleep(1.0)

    async def _prove(self) -> bool:
        """Drain, then exchange proofs until the line is in step again -> whether it is."""
        for attempt in range(PROOFS):
            await self.talk.drain(QUIET * QUIETER**attempt)
            if not self.talk.lost and await self.talk.in_step():
                return True
            if self.talk.lost:
                return False
            if self.state == "up":
                self._down("the mount does not answer")
        return False

    async def _next(self) -> Request | None:
        """The next job in order of rank; a read waits where it would delay something urgent."""
        self._queue = [item for item in self._queue if not self._over(item[2])]
        if not self._queue:
            self._wake.clear()
            await self._wake.wait()
            await self._what_follows()  # what woke a read may have brought a stop as well
            return None
        now = self._now()
        while self._urgent and self._urgent[0] < now - 0.05:
            heapq.heappop(self._urgent)
        first = self._waiting()[0]
        if self._urgent and first[2].rank in READS and self._urgent[0] - now < 1.5 * self.typical:
            self._wake.clear()
            try:
                await asyncio.wait_for(self._wake.wait(), max(0.0, self._urgent[0] - now) + 0.05)
            except TimeoutError:
                heapq.heappop(self._urgent)
            return None
        job = first[2]
        gap = 0.0 if job.rank == STOP else self.talk.gap(job.ask)
        if gap > 0:
            job.chosen = True
            self._wake.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), gap)
            return None
        self._queue.remove(first)
        return job

    def _over(self, job: Request) -> bool:
        """Whether nobody waits for it, or it has waited too long."""
        if job.ask.prompt and not job.future.done() and self._now() - job.asked > AT_ONCE:
            job.future.set_exception(Busy(LATE))
        return job.future.done()

    def _waiting(self) -> list[tuple[int, int, Request]]:
        """Whatever waits, in the order in which its turn comes; what has waited long rises in rank."""
        now, before_all = self._now(), STOP + 0.5
        waited = before_all if self._motions >= IN_A_ROW else WAITED
        risen = {POSITION: waited, READ: waited, SETTING: before_all if self._passed_over >= PASSED_OVER else SETTING}

        def turn(item: tuple[int, int, Request]) -> tuple[float, int, int]:
            rank, order, job = item
            if job.chosen and rank in READS:
                return POSITION - 0.5, rank, order
            return min(rank, risen[rank]) if now - job.asked > AGED.get(rank, 1e9) else rank, rank, order

        return sorted(self._queue, key=turn)

    def _meanwhile(self, busy: bool) -> int:
        """While the mount works: send the stops that need no answer; refuse all else once it is busy -> stops sent."""
        if busy and self.state == "up":
            self.state = "busy"
        sent, waiting = 0, sorted(self._queue)
        self._queue = []
        for rank, order, job in waiting:
            if job.future.done():
                continue
            if rank == STOP and self.dialogue.take(job.ask, b"") is not None:
                sent += self.talk.send(self.dialogue.encode(job.ask))
                job.future.set_result(({}, 0.0))
            elif self.state == "busy":
                job.future.set_exception(Busy())
            else:
                self._queue.append((rank, order, job))
        return sent

    def _up(self) -> None:
        """The line is in step; when it was not so before, whoever waits for it is told."""
        self._silent_since = None
        if self.state != "up":
            self.state, self.reason = "up", ""
            self.on_up()

    def _down(self, reason: str) -> None:
        """Fail everything that waits; from now on every exchange fails at once."""
        if (self.state, self.reason) != ("down", reason):
            self.transcript.note("mount", reason)
        self.state, self.reason = "down", reason
        self._fail_all()

    def _fail_all(self) -> None:
        for _, _, job in sorted(self._queue):
            if not job.future.done():
                job.future.set_exception(NoAnswer())
        self._queue.clear()
