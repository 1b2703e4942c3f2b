"""The line to the mount: one exchange at a time, in order of rank.

Stop goes first, then motion, then settings, then reads. A mount that is busy with itself for long is left alone, but
for a stop. After a silence the line is drained and proven to be in step before anything else is sent, or every later
answer would belong to an earlier question. A lost port is opened again with growing pauses, for ever.
"""

from __future__ import annotations

import asyncio
import contextlib
import heapq
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, Protocol

from gateway.driver import Ask
from gateway.errors import Busy, Fault, NoAnswer, Refused, Silence
from gateway.transcript import Transcript
from gateway.wires import Wire

STOP, MOTION, WAITED, SETTING, POSITION, READ = range(6)
QUIET = 0.15
PROOFS = 3
#: Seconds after which a read has WAITED and goes before settings: clients that set without end must not blind the hub.
AGED = {POSITION: 0.25, READ: 0.6}
BACK_OFF = (0.5, 1.0, 2.0, 5.0)
#: Turns of the loop that a halt may take from the end of what ran before it until it is in the queue.
TURNS = 5
#: A long piece of work of the mount may take that many seconds before what waits behind it is refused.
BUSY_AFTER = 1.0


class Dialogue(Protocol):
    """How a protocol's requests and replies look on the wire."""

    def timeout(self, ask: Ask) -> float: ...
    def pace(self, ask: Ask) -> float: ...
    def encode(self, ask: Ask) -> bytes: ...
    def take(self, ask: Ask, buffer: bytes) -> tuple[dict[str, Any] | Fault, int] | None: ...
    def proof(self, attempt: int) -> Iterator[Ask]: ...
    def proven(self, ask: Ask, values: dict[str, Any]) -> bool: ...


class Job:
    """An exchange that waits for its turn."""

    __slots__ = ("ask", "asked", "future", "rank")

    def __init__(self, ask: Ask, rank: int, future: asyncio.Future[dict[str, Any]]) -> None:
        self.ask, self.rank, self.future, self.asked = ask, rank, future, future.get_loop().time()


class Line:
    """Owns the wire. ``state`` is ``opening``, ``up``, ``busy`` or ``down``; ``on_up`` is called when it is opened."""

    def __init__(self, wire: Wire, dialogue: Dialogue, transcript: Transcript) -> None:
        self.wire, self.dialogue, self.transcript = wire, dialogue, transcript
        self.state = "opening"
        self.on_up: Callable[[], None] = lambda: None
        #: Whether something that ranks as a stop waits for its turn and is not in the queue yet.
        self.halts: Callable[[], bool] = lambda: False
        self.reason = ""
        self.typical = 0.02
        self.answers = 0
        self._order = count()
        self._queue: list[tuple[int, int, Job]] = []
        self._wake = asyncio.Event()
        self._buffer = b""
        self._arrived = asyncio.Event()
        self._lost = False
        self._long = False
        self._urgent: list[float] = []
        self._hurried = False
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to open the wire and to serve exchanges."""
        self._task = asyncio.get_running_loop().create_task(self._run())

    @property
    def served(self) -> bool:
        """Whether exchanges are carried out at all: not before the start, nor once the worker has ended."""
        return self._task is not None and not self._task.done()

    async def close(self) -> None:
        """End the worker and close the wire."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await self.wire.close()

    def expect_urgent(self, when: float) -> None:
        """Something urgent will be due at this loop time: reads that would delay it are held back."""
        heapq.heappush(self._urgent, when)

    async def exchange(self, ask: Ask, rank: int = READ) -> dict[str, Any]:
        """Send a command when its turn comes and return the reply's fields. Raises Fault."""
        if self.state == "down":
            raise NoAnswer
        if self.state == "busy" and rank != STOP:
            raise Busy
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._queue, (rank, next(self._order), Job(ask, rank, future)))
        self._wake.set()
        if self._long:
            self._arrived.set()
        return await future

    # --- the worker -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failures = 0
        while True:
            try:
                await self.wire.open(self._on_data, self._on_lost)
            except Exception as error:  # pyserial has more kinds of failure than OSError
                reason = str(getattr(error, "strerror", None) or error)
                self.transcript.put("mount", "v", note=reason)
                self._down(f"cannot open {self.wire.name}: {reason}")
                await asyncio.sleep(BACK_OFF[min(failures, len(BACK_OFF) - 1)])
                failures += 1
                continue
            self.transcript.put("mount", "^")
            failures, self._lost, self._buffer, self.state, self.reason = 0, False, b"", "up", ""
            self.on_up()
            await self._serve()
            await self.wire.close()

    async def _serve(self) -> None:
        """Serve jobs until the wire is lost."""
        while not self._lost:
            job = await self._next()
            if job is None:
                continue
            hurried, self._hurried = self._hurried, False
            outcome = await self._exchange(job.ask, firm=hurried)
            if hurried and job.rank == STOP and self.dialogue.pace(job.ask):
                outcome = await self._exchange(job.ask)  # a scope that needs its pause may have missed it
            if not job.future.done():
                if isinstance(outcome, Fault):
                    job.future.set_exception(outcome)
                else:
                    job.future.set_result(outcome)
                await self._what_follows()
            if isinstance(outcome, NoAnswer) and not self._lost and not await self._prove():
                self._down("the mount does not answer")
                while not self._lost and not await self._prove():
                    await asyncio.sleep(1.0)
                if not self._lost:
                    self.state = "up"
                    self.on_up()
        self._down(f"{self.wire.name} was lost")

    async def _what_follows(self) -> None:
        """Let the second half of a position come before reads of a lower rank, and a halt that is coming before all."""
        if self._queue:
            await asyncio.sleep(0)
        for _ in range(TURNS):
            if not self._queue or self._stop_waits() or not self.halts():
                return
            await asyncio.sleep(0)

    def _stop_waits(self) -> bool:
        """Whether a stop is in the queue that is still wanted."""
        return any(rank == STOP and not job.future.done() for rank, _, job in self._queue)

    async def _next(self) -> Job | None:
        """The next job in order of rank; a read waits where it would delay something urgent."""
        while self._queue and self._queue[0][2].future.done():
            heapq.heappop(self._queue)
        if not self._queue:
            self._wake.clear()
            await self._wake.wait()
            return None
        now = asyncio.get_running_loop().time()
        while self._urgent and self._urgent[0] < now - 0.05:
            heapq.heappop(self._urgent)
        if any(now - job.asked > AGED.get(rank, 1e9) for rank, _, job in self._queue):
            self._queue = [(WAITED if now - job.asked > AGED.get(rank, 1e9) else rank, order, job)
                           for rank, order, job in self._queue]
            heapq.heapify(self._queue)
        if self._urgent and self._queue[0][2].rank >= POSITION and self._urgent[0] - now < 1.5 * self.typical:
            self._wake.clear()
            try:
                await asyncio.wait_for(self._wake.wait(), max(0.0, self._urgent[0] - now) + 0.05)
            except TimeoutError:
                heapq.heappop(self._urgent)
            return None
        return heapq.heappop(self._queue)[2]

    async def _exchange(self, ask: Ask, firm: bool = False) -> dict[str, Any] | Fault:
        """One request and its reply, or the Fault that came instead. A ``firm`` pause after it is kept to its end."""
        try:
            request = self.dialogue.encode(ask)
        except Fault as fault:
            return fault
        if self._buffer:
            self.transcript.put("mount", "<", self._buffer, "dropped: nobody asked")
            self._buffer = b""
        self._arrived.clear()
        loop = asyncio.get_running_loop()
        began = loop.time()
        if not self._send(request):
            return NoAnswer()
        self._long = ask.long
        taken = await self._reply(ask, began)
        self._free()
        if isinstance(taken, Fault):
            return taken
        outcome, length = taken
        self.transcript.put("mount", "<", self._buffer[:length])
        self._buffer = self._buffer[length:]
        self.answers += 1
        if not ask.long:
            self.typical += 0.2 * (loop.time() - began - self.typical)
        pace = self.dialogue.pace(ask)
        if pace and await self._pause(pace, firm):
            outcome = self._objection(ask) or outcome
        return outcome

    async def _pause(self, seconds: float, firm: bool) -> bool:
        """Give a scope time after a command without a reply. A stop cuts it short, unless ``firm``: then False."""
        until = asyncio.get_running_loop().time() + seconds
        while not self._lost and (left := until - asyncio.get_running_loop().time()) > 0:
            if not firm and self._stop_waits():
                self._hurried = True
                return False
            self._wake.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await self._wake.wait()
        return True

    async def _reply(self, ask: Ask, began: float) -> tuple[dict[str, Any] | Fault, int] | Fault:
        """Wait for the reply -> it and its length, or the Fault that it did not come."""
        loop = asyncio.get_running_loop()
        deadline, busy_at, stops = began + (ask.patience or self.dialogue.timeout(ask)), began + BUSY_AFTER, 0
        while True:
            now = loop.time()
            if ask.long:
                stops += self._meanwhile(now >= busy_at)
            taken = self._take(ask)
            if taken is not None and not (stops and isinstance(taken[0], Busy)):
                return taken
            if taken is not None:  # said to a stop, while nothing moves anyway
                self._buffer, stops = self._buffer[taken[1] :], stops - 1
                self.transcript.note("mount", "busy: the stop was not heard")
                continue
            if now >= deadline or self._lost:
                self.transcript.put("mount", "<", self._buffer, "no complete answer")
                quiet = not self._buffer and not self._lost
                return Silence() if ask.patience is not None and not ask.long and quiet else NoAnswer()
            self._arrived.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(busy_at if ask.long and now < busy_at else deadline):
                    await self._arrived.wait()

    def _send(self, request: bytes) -> bool:
        """Write to the wire -> whether it was there."""
        self.transcript.put("mount", ">", request)
        try:
            self.wire.write(request)
        except OSError as error:
            self._on_lost(str(error))
            return False
        return True

    def _free(self) -> None:
        """The long work of the mount is over."""
        self._long = False
        if self.state == "busy":
            self.state = "up"

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
                sent += self._send(self.dialogue.encode(job.ask))
                job.future.set_result({})
            elif self.state == "busy":
                job.future.set_exception(Busy())
            else:
                heapq.heappush(self._queue, (rank, order, job))
        return sent

    def _objection(self, ask: Ask) -> Fault | None:
        """What a command without a reply was answered with all the same: that the mount is busy."""
        taken = self._take(ask) if self._buffer and self.dialogue.take(ask, b"") is not None else None
        if taken is None or not isinstance(taken[0], Fault):
            return None
        self.transcript.put("mount", "<", self._buffer[: taken[1]])
        self._buffer = self._buffer[taken[1] :]
        return taken[0]

    def _take(self, ask: Ask) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply, when it is complete; one that cannot be read at all is garbled, never the end of the line."""
        try:
            return self.dialogue.take(ask, self._buffer)
        except Exception as error:  # whatever it is, the line goes on
            return Refused(f"Garbled answer from the mount: {error}"), len(self._buffer)

    async def _prove(self) -> bool:
        """Drain, then exchange echoes until the line is in step again."""
        for attempt in range(PROOFS):
            await self._drain()
            proven = True
            for ask in self.dialogue.proof(attempt):
                outcome = await self._exchange(ask)
                if isinstance(outcome, Fault) or not self.dialogue.proven(ask, outcome):
                    proven = False
                    break
            if proven:
                return True
            if self._lost:
                return False
            if self.state == "up":
                self._down("the mount does not answer")
        return False

    async def _drain(self) -> None:
        """Wait until the wire has been quiet for a moment, and forget what came."""
        while True:
            self._arrived.clear()
            try:
                async with asyncio.timeout(QUIET):
                    await self._arrived.wait()
            except TimeoutError:
                break
        self._buffer = b""

    def _down(self, reason: str) -> None:
        """Fail everything that waits; from now on every exchange fails at once."""
        self.state, self.reason = "down", reason
        self.transcript.note("mount", reason)
        for _, _, job in self._queue:
            if not job.future.done():
                job.future.set_exception(NoAnswer())
        self._queue.clear()

    def _on_data(self, data: bytes) -> None:
        self.transcript.put("mount", "raw", data)
        self._buffer = (self._buffer + data)[-4096:]
        self._arrived.set()

    def _on_lost(self, reason: str) -> None:
        self.transcript.put("mount", "v", note=reason)
        self._lost = True
        self._arrived.set()
        self._wake.set()
