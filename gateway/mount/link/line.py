"""The line to the mount: one exchange at a time, in order of rank.

Stop goes first, then motion, then settings, then reads. A mount that is busy with itself for long is left alone, but
for a stop. After a silence, or an answer of the wrong form, nothing is sent before the line has been proven to be in
step. A lost port is opened again with growing pauses, for ever; one that stays mute is closed and opened anew.
"""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.core.errors import Busy, Fault, NoAnswer, Silence
from gateway.core.signals import Signal
from gateway.core.wire_log import WireLog
from gateway.mount.link.queue import READ, STOP, RequestQueue
from gateway.mount.link.transaction import QUIET, Transaction
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import Transport

#: After half a command nothing is sent for this long: a hand control would take it for the other half.
HALF_COMMAND = 3.5
#: Between two commands whose answers nobody waits for.
BLIND = 0.2
#: A port that nobody has answered on for this long is opened anew.
MUTE = 20.0
#: Seconds after which an answer is overdue: whether the mount hears at all is not known from then on.
OVERDUE = 2.0
BACK_OFF = (0.5, 1.0, 2.0, 5.0)
#: How often the line is proven before it counts as down; after a proof that failed, so many times more quiet is wanted.
PROOFS, QUIETER = 3, 3.0


class MountLink:
    """Owns the wire, and serves the exchanges that wait for it. ``came_up`` tells when it comes up,
    ``exchanged`` what has come of every exchange."""

    def __init__(
        self, wire: Transport, dialogue: ReplyRules, wire_log: WireLog, queue: RequestQueue | None = None
    ) -> None:
        self.dialogue, self.wire_log = dialogue, wire_log
        self.queue = RequestQueue() if queue is None else queue  # an empty one counts as false
        self.talk = Transaction(wire, self.queue, dialogue, wire_log)
        #: The port was lost, perhaps in the middle of an exchange.
        self.lost = self.talk.wire_lost
        self._state = "opening"
        self.came_up: Signal[None] = Signal()
        self.exchanged: Signal[dict[str, Any] | Fault] = Signal()
        #: The port is open again: listeners add the requests that go out before anything else, a stop that is owed.
        self.reopened: Signal[list[bytes]] = Signal()
        self.reason = ""
        self._now = asyncio.get_running_loop().time
        self._spoken_on = False
        self._proofs = 0
        #: Since when what was sent has not been answered; None while all is well.
        self._silent_since: float | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._run())

    @property
    def wire(self) -> Transport:
        """The way to the mount; until the line is started another may take its place."""
        return self.talk.wire

    @wire.setter
    def wire(self, wire: Transport) -> None:
        self.talk.wire = wire

    @property
    def state(self) -> str:
        """``opening``, ``up``, ``busy`` or ``down``."""
        return "busy" if self._state == "up" and self.talk.busy else self._state

    @property
    def served(self) -> bool:
        """Whether exchanges are carried out at all: not before the start, nor once the worker has ended."""
        return self._task is not None and not self._task.done()

    @property
    def usable(self) -> bool:
        return self.state == "up" and self.served

    @property
    def typical(self) -> float:
        """How long an answer takes, seconds."""
        return self.talk.times.typical

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
        return self.talk.times.answers

    async def close(self) -> None:
        """End the worker and close the wire; whatever waits, and whatever comes, gets no answer."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await self.wire.close()
        self._state = "down"
        self.queue.fail_all()

    def distrust(self) -> None:
        """Another process has spoken on the wire: the line is proven to be in step before it is used again."""
        self._spoken_on = True
        self.queue.wake()

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
        outcome = self.queue.add(ask, rank)
        if rank == STOP or self.talk.long:
            self.talk.nudge(rank == STOP)
        return await outcome

    # --- the worker -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failures = 0
        while True:
            try:
                await self.wire.open(*self.talk.opening())
            except Exception as error:  # pyserial has more kinds of failure than OSError
                reason = str(getattr(error, "strerror", None) or error)
                self.wire_log.put("mount", "v", note=reason)
                self._down(f"cannot open {self.wire.name}: {reason}")
                await asyncio.sleep(BACK_OFF[min(failures, len(BACK_OFF) - 1)])
                failures += 1
                continue
            failures = 0
            self.wire_log.put("mount", "^")
            self.talk.drop("came before the line was lost")
            if self.talk.wrote > 0:  # something was said on this line before: it may still be answered
                await self._reopened()
            else:
                self._up()
            try:
                await self._serve()
            except Exception as error:  # a defect here must not leave the mount without a line for ever
                self.wire_log.note("mount", f"internal error, please report it: {error!r}")
                self._down("internal error")
                await asyncio.sleep(BACK_OFF[0])
            await self.wire.close()

    async def _reopened(self) -> None:
        """The wire is back: what is owed goes first, and nothing is taken for granted of what is on it."""
        words: list[bytes] = []
        self.reopened.emit(words)
        half, self.talk.half = self.talk.half, False
        if half and not (words and (self.dialogue.closing or len(self.talk.request) == 1)):
            await asyncio.sleep(max(0.0, self.talk.wrote + HALF_COMMAND - self._now()))
        for number, word in enumerate(words):
            if not self.talk.send((self.dialogue.closing if half and not number else b"") + word):
                return
            await asyncio.sleep(BLIND)
        await self._recover()

    async def _serve(self) -> None:
        answered = False
        while not self.talk.lost:
            if self._spoken_on:
                self._spoken_on = False
                await self._recover()
            request = await self.queue.next(self.typical, self.talk.gap, answered)
            answered = False
            if request is None:
                continue
            self._silent_since = self._silent_since or self._now()
            try:
                outcome = await self.talk.carry_out(request.ask, request.rank == STOP)
            except BaseException:  # it does not come to an end, and nobody waits for that
                request.fail(NoAnswer())
                raise
            self.exchanged.emit(outcome)
            if not isinstance(outcome, NoAnswer | Silence):
                self._silent_since = None
            if not request.future.done():
                if isinstance(outcome, Fault):
                    outcome.took = self.talk.times.took
                    request.future.set_exception(outcome)
                else:
                    request.future.set_result((outcome, self.talk.times.took))
                answered = True
            if isinstance(outcome, Silence) and self.dialogue.expected(request.ask).leaves_open:
                self.talk.send(self.dialogue.closing)
                await self.talk.drain(max(QUIET, 2.0 * self.talk.times.typical))
            if isinstance(outcome, NoAnswer | Silence):
                await self._recover()
        self._down(f"{self.wire.name} was lost")

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
        """Drain what is on the wire, then exchange proofs until the line is in step again -> whether it is."""
        for attempt in range(PROOFS):
            await self.talk.drain(QUIET * QUIETER**attempt)
            if not self.talk.lost and await self.in_step():
                return True
            if self.talk.lost:
                return False
            if self.state == "up":
                self._down("the mount does not answer")
        return False

    async def in_step(self) -> bool:
        """Whether every proof is answered as it should be, and nothing follows."""
        self._proofs += 1
        for ask in self.dialogue.proof(self._proofs):
            await asyncio.sleep(self.talk.gap(ask))
            outcome = await self.talk.exchange(ask, proof=True)
            if isinstance(outcome, Busy):
                continue  # that is an answer, too
            if isinstance(outcome, Fault) or not self.dialogue.proven(ask, outcome):
                return False
        return not await self.talk.drain(QUIET)

    def _up(self) -> None:
        """The line is in step; when it was not so before, whoever waits for it is told."""
        self._silent_since = None
        if self.state != "up":
            self._state, self.reason = "up", ""
            self.came_up.emit(None)

    def _down(self, reason: str) -> None:
        """Fail everything that waits; from now on every exchange fails at once."""
        if (self.state, self.reason) != ("down", reason):
            self.wire_log.note("mount", reason)
        self._state, self.reason = "down", reason
        self.queue.fail_all()
