"""Carries out what a driver's generators yield: their exchanges with the mount, as far as they can be believed.

What a driver schedules for later, and a defect in it, is told by signals: who must act on that stands above. A mount
that hibernates is left alone: what it would not answer in its sleep is refused without asking.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Generator, Mapping
from typing import Any, TypeVar

from gateway.core.errors import Asleep, Busy, Fault, Refused
from gateway.core.operations import Operation
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.queue import AT_ONCE, LATE, MOTION, POSITION, STOP
from gateway.mount.link.verification import ReplyVerifier
from gateway.protocols.base.driver import Remark, Schedule, Send, Step, Steps, Wait

#: Seconds from one position that is tried to the next: no longer than where nobody asks a mount that is awake.
TRY_AGAIN = 5.0


class HibernationGate:
    """Asks the driver whether its mount sleeps, and tells it when the mount is heard to be awake.

    Stops are sent all the same, and the position is asked for now and then: somebody may have woken it at its keys, and
    the first answer that no sleeper gives ends this. What a sleeper does not hear costs the line seconds, each time.
    Where it is being woken, what is asked for after that is asked of a mount that is awake.
    """

    def __init__(self, context: Context) -> None:
        self._driver, self._now, self._wanted = context.driver, context.now, context.wanted
        self._next = 0.0

    def begun(self) -> None:
        """The mount has just been sent to sleep."""
        self._next = self._now() + TRY_AGAIN

    def doubt(self) -> None:
        """The line was lost, and the mount perhaps switched off: the next read is tried."""
        self._next = 0.0

    @property
    def deep(self) -> bool:
        """Whether nothing would come of a read now."""
        return self._driver.asleep and self._now() < self._next and not self._wanted.waking

    def admit(self, ask: Send, rank: int) -> None:
        """Whether to ask this of a mount that sleeps, now. Raises Asleep."""
        if rank == STOP or self._heard(ask) or self._wanted.waking:
            return
        if self.deep or rank != POSITION:
            raise Asleep
        self._next = self._now() + TRY_AGAIN

    def _heard(self, ask: Send) -> bool:
        return bool(self._driver.protocol.commands[ask.command].while_asleep)

    def answered(self, ask: Send) -> None:
        """A mount that sleeps has answered."""
        if not self._heard(ask):
            self._driver.asleep = False


_T = TypeVar("_T")


class DriverRunner:
    """``perform`` carries out an operation at a rank of the line, ``drive`` any generator of the driver's.

    ``stirs`` is emitted before something goes to the mount that may set it moving, ``scheduled`` with what the driver
    wants done later, ``broken`` when a defect leaves it open what moves now.
    """

    def __init__(self, context: Context, verifier: ReplyVerifier, gate: HibernationGate) -> None:
        self._context, self._verifier, self._gate = context, verifier, gate
        self.stirs: Signal[None] = Signal()
        self.scheduled: Signal[Schedule] = Signal()
        self.broken: Signal[None] = Signal()
        #: How many exchanges the operation took that was carried out last, and when the questions were asked whose
        #: answers it ended with, as many as a place takes.
        self.exchanges, self.asked_at = 0, 0.0

    async def perform(self, operation: Operation, rank: int) -> Any:
        """Have the driver carry out an operation -> its answer. Raises Fault."""
        return await self.drive(self._context.driver.perform(operation), rank)

    async def drive(self, steps: Steps, rank: int, since: float | None = None) -> Any:
        """Exchanges and pauses -> the generator's value. What was asked for (``since``) too long ago is not begun.

        Raises Fault.
        """
        now, driver = self._context.now, self._context.driver
        self.exchanges = exchanges = 0
        asked: list[float] = []
        late = since is not None and now() - since > AT_ONCE
        if rank == MOTION:
            self.stirs.emit(None)

        async def exchange(ask: Send) -> Mapping[str, Any]:
            nonlocal exchanges, late
            if late and (ask.prompt or not exchanges):
                raise Busy(LATE)
            began = now()
            if driver.asleep:
                self._gate.admit(ask, rank)
            heard, times = await self._verifier.exchange(ask, rank)
            late = late or now() - began > AT_ONCE
            if driver.asleep:
                self._gate.answered(ask)
            exchanges += times
            asked.append(heard.asked)
            return heard.values

        try:
            value = await carry_out(steps, exchange, self.scheduled.emit, self._context.note_once)
            self.exchanges, self.asked_at = exchanges, min(asked[-driver.position_reads :], default=math.inf)
            return value
        except (Fault, asyncio.CancelledError):
            raise
        except Exception as error:  # a defect in a driver must cost one operation, never the gateway
            self._context.note(f"internal error, please report it: {error!r}")
            if rank != STOP:  # a stop that fails is tried again by itself
                self.broken.emit(None)
            raise Refused(f"Internal error: {error!r}") from error


async def carry_out(
    steps: Generator[Step, Any, _T],
    exchange: Callable[[Send], Awaitable[Mapping[str, object]]],
    plan: Callable[[Schedule], object],
    remark: Callable[[str], object] = lambda text: None,
) -> _T:
    """Run a driver's generator to its end -> its value. A Fault of an exchange is thrown into it. Raises Fault."""
    answer: Mapping[str, object] | None = None
    fault: Fault | None = None
    try:
        while True:
            step = steps.send(answer) if fault is None else steps.throw(fault)
            answer, fault = None, None
            if isinstance(step, Send):
                try:
                    answer = await exchange(step)
                except Fault as error:
                    fault = error
            elif isinstance(step, Wait):
                await asyncio.sleep(step.seconds)
            elif isinstance(step, Remark):
                remark(step.text)
            else:
                plan(step)
    except StopIteration as end:
        value: _T = end.value
        return value
    finally:
        steps.close()
