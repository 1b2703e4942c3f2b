"""The line to the mount: one exchange at a time, in order of rank.

Stop goes first, then motion, then settings, then reads. After a silence, or an answer of the wrong form, the line is
drained and proven to be in step before anything else is sent, or every later answer would belong to an earlier
question. An answer that anything follows is none: one of the two belongs to somebody else. A lost port is opened again
with growing pauses, for ever; one that stays mute is closed and opened anew.
"""

from __future__ import annotations

import asyncio
import contextlib
import heapq
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, Protocol

from gateway.doubt import LATEST, Doubt
from gateway.driver import Ask
from gateway.errors import Busy, Fault, Garbled, NoAnswer, Silence
from gateway.transcript import Transcript
from gateway.wires import Wire

STOP, MOTION, SETTING, POSITION, READ = range(5)
#: Seconds of quiet that end a disturbance; more of it is wanted after a proof that failed.
QUIET, QUIETER = 0.15, 3.0
PROOFS = 3
#: No disturbance is waited out for longer than that at a time.
DRAIN = 5.0
#: A second copy of a reply follows the first within this; what might be mistaken for it is not asked before.
GAP = 0.05
#: A reply that is an acknowledgement and no more counts when nothing has followed it for this long.
SETTLE = 0.02
#: After half a command nothing is sent for this long: a hand control would take it for the other half.
HALF_COMMAND = 3.5
#: A port that nobody has answered on for this long is opened anew.
MUTE = 20.0
BACK_OFF = (0.5, 1.0, 2.0, 5.0)


class Dialogue(Protocol):
    """How a protocol's requests and replies look on the wire."""

    def timeout(self, ask: Ask) -> float: ...
    def pace(self, ask: Ask) -> float: ...
    def bare(self, ask: Ask) -> bool: ...
    def alike(self, one: Ask, other: Ask) -> bool: ...
    def kind(self, ask: Ask) -> str | None: ...
    def encode(self, ask: Ask) -> bytes: ...
    def take(self, ask: Ask, buffer: bytes) -> tuple[dict[str, Any] | Fault, int] | None: ...
    def proof(self, attempt: int) -> Iterator[Ask]: ...
    def proven(self, ask: Ask, values: dict[str, Any]) -> bool: ...


class Job:
    """An exchange that waits for its turn."""

    __slots__ = ("ask", "future", "rank")

    def __init__(self, ask: Ask, rank: int, future: asyncio.Future[dict[str, Any]]) -> None:
        self.ask, self.rank, self.future = ask, rank, future


class Line:
    """Owns the wire. ``state`` is ``opening``, ``up`` or ``down``; ``on_up`` is called when the wire was (re)opened."""

    def __init__(self, wire: Wire, dialogue: Dialogue, transcript: Transcript) -> None:
        self.wire, self.dialogue, self.transcript = wire, dialogue, transcript
        self.state = "opening"
        self.on_up: Callable[[], None] = lambda: None
        self.reason = ""
        self.typical = 0.02
        self.answers = 0
        self._order = count()
        self._queue: list[tuple[int, int, Job]] = []
        self._wake = asyncio.Event()
        self._buffer = b""
        self._arrived = asyncio.Event()
        self._lost = False
        self._heard = self._wrote = -1e9
        self._last: Ask | None = None
        self._opened = self._proofs = 0
        self._half = False
        self._doubt = Doubt(dialogue.alike)
        self._urgent: list[float] = []
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to open the wire and to serve exchanges."""
        self._task = asyncio.get_running_loop().create_task(self._run())

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
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._queue, (rank, next(self._order), Job(ask, rank, future)))
        self._wake.set()
        return await future

    def doubt(self, ask: Ask) -> int:
        """How many answers to older questions may still come that could be taken for the answer to this one."""
        return self._doubt.count(ask, asyncio.get_running_loop().time())

    async def clear_of_doubt(self, ask: Ask) -> None:
        """Wait until there is none."""
        now = asyncio.get_running_loop().time
        while (left := self._doubt.until(ask, now()) - now()) > 0:
            await asyncio.sleep(left)

    # --- the worker -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failures = 0
        while True:
            self._opened += 1
            self._lost = False
            try:
                await self.wire.open(*self._callbacks(self._opened))
            except Exception as error:  # pyserial has more kinds of failure than OSError
                self._down(f"cannot open {self.wire.name}: {getattr(error, 'strerror', None) or error}")
                await asyncio.sleep(BACK_OFF[min(failures, len(BACK_OFF) - 1)])
                failures += 1
                continue
            failures = 0
            self._drop("came before the line was lost")
            if self._wrote > 0:  # something was said on this line before: it may still be answered
                await self._reopened()
            else:
                self._up()
            await self._serve()
            await self.wire.close()

    def _callbacks(self, opening: int) -> tuple[Callable[[bytes], None], Callable[[str], None]]:
        """What a wire calls; a reader that outlived its opening is not listened to."""

        def on_data(data: bytes) -> None:
            if opening == self._opened:
                self._on_data(data)

        def on_lost(reason: str) -> None:
            if opening == self._opened:
                self._on_lost(reason)

        return on_data, on_lost

    async def _reopened(self) -> None:
        """The wire is back: nothing is taken for granted of what is on it."""
        if self._half:
            self._half = False
            await asyncio.sleep(max(0.0, self._wrote + HALF_COMMAND - asyncio.get_running_loop().time()))
        await self._recover()

    async def _serve(self) -> None:
        """Serve jobs until the wire is lost."""
        while not self._lost:
            job = await self._next()
            if job is None:
                continue
            outcome = await self._exchange(job.ask)
            if not job.future.done():
                if isinstance(outcome, Fault):
                    job.future.set_exception(outcome)
                else:
                    job.future.set_result(outcome)
            if isinstance(outcome, NoAnswer | Silence):
                await self._recover()
        self._down(f"{self.wire.name} was lost")

    async def _recover(self) -> None:
        """Bring the line into step again, however long that takes, unless the wire is lost meanwhile."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        while not self._lost:
            if await self._prove():
                self._up()
                return
            self._down("the mount does not answer")
            if loop.time() - began > MUTE:
                self._on_lost("mute")
            else:
                await asyncio.sleep(1.0)

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
        if self._urgent and self._queue[0][0] >= POSITION and self._urgent[0] - now < 1.5 * self.typical:
            self._wake.clear()
            try:
                await asyncio.wait_for(self._wake.wait(), max(0.0, self._urgent[0] - now) + 0.05)
            except TimeoutError:
                heapq.heappop(self._urgent)
            return None
        rank, _, job = self._queue[0]
        gap = 0.0 if rank == STOP else self._gap(job.ask)
        if gap > 0:
            self._wake.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), gap)
            return None
        return heapq.heappop(self._queue)[2]

    def _gap(self, ask: Ask) -> float:
        """Seconds of quiet still wanted before a question, lest the rest of the last answer be taken for its own."""
        if not self._buffer and (self._last is None or not self.dialogue.alike(self._last, ask)):
            return 0.0
        left = self._heard + GAP - asyncio.get_running_loop().time()
        return left if left > 1e-6 else 0.0

    async def _exchange(self, ask: Ask) -> dict[str, Any] | Fault:
        """One request and its reply, or the Fault that came instead."""
        try:
            request = self.dialogue.encode(ask)
        except Fault as fault:
            return fault
        loop = asyncio.get_running_loop()
        settle = GAP if self._gap(ask) else SETTLE  # a stop does not wait before, so it must look longer after
        self._drop("nobody asked")
        self._arrived.clear()
        self._last = ask
        self.transcript.put("mount", ">", request)
        began = self._wrote = loop.time()
        try:
            self.wire.write(request)
        except Exception as error:  # the port went away in the middle of it, whatever its driver calls that
            self._half = True
            self._on_lost(str(error))
            return NoAnswer()
        timeout = self.dialogue.timeout(ask)
        taken = await self._await_reply(ask, began + (ask.patience or timeout), settle)
        if taken is None:
            if ask.patience is not None and not self._buffer and not self._lost:
                return Silence()
            self._doubt.add(ask, began + timeout + LATEST)
            self._drop("no complete answer")
            return NoAnswer()
        outcome, length = taken
        if len(self._buffer) > length:
            outcome = Garbled()
        if isinstance(outcome, Garbled):
            self._doubt.add(ask, began + timeout + LATEST)
            self._drop("garbled")
            return outcome
        self.transcript.put("mount", "<", self._buffer[:length])
        self._buffer = self._buffer[length:]
        self.answers += 1
        self.typical += 0.2 * (min(loop.time() - began, 3.0 * self.typical + 0.01) - self.typical)
        pace = self.dialogue.pace(ask)
        if pace:
            await asyncio.sleep(pace)
        return outcome

    async def _await_reply(self, ask: Ask, deadline: float, settle: float) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply and its length, once it is complete; None when it is not by then, or the wire was lost."""
        while not self._lost:
            taken = self._take(ask)
            if taken is not None:
                if taken[1] and self.dialogue.bare(ask) and await self._something_within(settle):
                    taken = self._take(ask) or taken
                return taken
            left = deadline - asyncio.get_running_loop().time()
            if left <= 0:
                return None
            await self._something_within(left)
        return None

    def _take(self, ask: Ask) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply, when it is complete; one that cannot be read at all is garbled, never the end of the line."""
        try:
            return self.dialogue.take(ask, self._buffer)
        except Exception:  # whatever it is, the line goes on
            return Garbled(), len(self._buffer)

    async def _something_within(self, seconds: float) -> bool:
        """Wait for bytes -> whether any came in time (or the wire was lost)."""
        self._arrived.clear()
        try:
            async with asyncio.timeout(seconds):
                await self._arrived.wait()
        except TimeoutError:
            return False
        return True

    async def _prove(self) -> bool:
        """Drain, then exchange proofs until the line is in step again -> whether it is."""
        for attempt in range(PROOFS):
            await self._drain(QUIET * QUIETER**attempt)
            if not self._lost and await self._in_step():
                return True
            if self._lost:
                return False
            if self.state == "up":
                self._down("the mount does not answer")
        return False

    async def _in_step(self) -> bool:
        """Whether every proof is answered as it should be, and nothing follows."""
        self._proofs += 1
        for ask in self.dialogue.proof(self._proofs):
            await asyncio.sleep(self._gap(ask))
            outcome = await self._exchange(ask)
            if isinstance(outcome, Busy):
                continue  # that is an answer, too
            if isinstance(outcome, Fault) or not self.dialogue.proven(ask, outcome):
                return False
        return not await self._drain(QUIET)

    async def _drain(self, quiet: float) -> bool:
        """Wait until the wire has been quiet for a moment, and forget what came -> whether anything did."""
        loop = asyncio.get_running_loop()
        give_up = loop.time() + DRAIN
        while not self._lost and loop.time() < give_up and await self._something_within(quiet):
            pass
        anything = bool(self._buffer)
        self._drop("drained")
        return anything

    def _drop(self, why: str) -> None:
        """Forget bytes that answer nothing."""
        if self._buffer:
            self.transcript.put("mount", "<", self._buffer, f"dropped: {why}")
            self._buffer = b""

    def _up(self) -> None:
        """The line is in step; when it was not so before, whoever waits for it is told."""
        if self.state != "up":
            self.state, self.reason = "up", ""
            self.on_up()

    def _down(self, reason: str) -> None:
        """Fail everything that waits; from now on every exchange fails at once."""
        if (self.state, self.reason) != ("down", reason):
            self.transcript.note("mount", reason)
        self.state, self.reason = "down", reason
        for _, _, job in self._queue:
            if not job.future.done():
                job.future.set_exception(NoAnswer())
        self._queue.clear()

    def _on_data(self, data: bytes) -> None:
        self._buffer = (self._buffer + data)[-4096:]
        self._heard = asyncio.get_running_loop().time()
        self._arrived.set()

    def _on_lost(self, reason: str) -> None:
        if not self._lost:
            self.transcript.note("mount", f"{self.wire.name}: {reason}")
        self._lost = True
        self._arrived.set()
        self._wake.set()
