"""Runs the generators of a driver: sends the commands that they yield and gives the verified replies back to them.

Signals report what a driver schedules for later, and a defect in a driver; the parts that act on them are in higher
layers. While the mount hibernates, a command that it would not answer is refused without sending it.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Generator, Mapping
from typing import Any, TypeVar

from gateway.core.errors import Asleep, Busy, Fault, Refused
from gateway.core.operations import Operation, Read
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.queue import MAX_START_DELAY, MOTION, POSITION, STARTED_TOO_LATE, STOP
from gateway.mount.link.transaction import GAP
from gateway.mount.link.verification import ReplyVerifier
from gateway.protocols.base.driver import Remark, Schedule, Send, Step, Steps, Wait

#: Seconds between two position reads that test whether the mount is awake: the heartbeat of a mount that is awake.
TRY_AGAIN = 5.0


class HibernationGate:
    """Decides which commands are sent to a hibernating mount, and tells the driver when its replies show it awake.

    Each command that a hibernating mount ignores costs a timeout of seconds. Stops are sent anyway. The position is
    read now and then, because a person may have woken the mount at its keys: the first reply that a hibernating mount
    does not give ends hibernation. While a wake-up order is pending, every command is let through.
    """

    def __init__(self, context: Context) -> None:
        self._driver, self._now, self._wanted = context.driver, context.now, context.wanted
        self._next = 0.0

    def hibernation_began(self) -> None:
        """Start waiting: the mount has just been sent to hibernate."""
        self._next = self._now() + TRY_AGAIN

    def try_next_read(self) -> None:
        """Let the next position read through: the line was lost, and the mount perhaps switched off and on."""
        self._next = 0.0

    @property
    def closed(self) -> bool:
        """Whether a read would be refused now."""
        return self._driver.asleep and self._now() < self._next and not self._wanted.waking

    def admit(self, command: Send, priority: int) -> None:
        """Check that a command may be sent to the hibernating mount now. Raises Asleep if not."""
        if priority == STOP or self._answered_asleep(command) or self._wanted.waking:
            return
        if self.closed or priority != POSITION:
            raise Asleep
        self._next = self._now() + TRY_AGAIN

    def _answered_asleep(self, command: Send) -> bool:
        return bool(self._driver.protocol.commands[command.command].while_asleep)

    def answered(self, command: Send) -> None:
        """Note a reply of a mount that was thought to hibernate; most replies show that it is awake."""
        if not self._answered_asleep(command):
            self._driver.asleep = False


_T = TypeVar("_T")


class DriverRunner:
    """``perform`` carries out an operation with a priority, ``drive`` runs any generator of the driver.

    ``may_move`` is emitted before a command that may set the mount moving, ``scheduled`` with an operation that the
    driver wants done later, ``broken`` when a defect leaves it unknown what moves now.
    """

    def __init__(self, context: Context, verifier: ReplyVerifier, gate: HibernationGate) -> None:
        self._context, self._verifier, self._gate = context, verifier, gate
        self.may_move: Signal[None] = Signal()
        self.scheduled: Signal[Schedule] = Signal()
        self.broken: Signal[None] = Signal()
        #: The number of exchanges of the last operation, and the loop time at which it sent the first of its last
        #: ``Driver.position_reads`` requests: a position read cannot be older than that.
        self.exchanges, self.asked_at = 0, 0.0
        #: The loop time at which the last operation's first command was written.
        self.began_at = 0.0

    async def perform(self, operation: Operation, priority: int) -> Any:
        """Have the driver carry out an operation and return its answer. Raises Fault."""
        steps = self._context.driver.perform(operation)
        return await self.drive(steps, priority, changes=not isinstance(operation, Read))

    async def drive(
        self,
        steps: Steps,
        priority: int,
        since: float | None = None,
        may_begin: Callable[[], None] = lambda: None,
        changes: bool = True,
    ) -> Any:
        """Run a generator of the driver and return its value. Raises Fault: Busy if it starts later than
        ``MAX_START_DELAY`` seconds after ``since`` (loop time), or if the line delayed a motion by hand as long.
        ``may_begin`` is called before a motion by hand begins, and may raise a Fault instead. What ``changes`` the
        mount outdates its replies of before and those that come meanwhile.
        """
        now, driver, line = self._context.now, self._context.driver, self._context.link.transaction
        self.exchanges = exchanges = 0
        self._context.cache.orders += changes
        asked, sent = list[float](), list[float]()
        late = since is not None and now() - since > MAX_START_DELAY
        if priority == MOTION:
            self.may_move.emit(None)

        async def exchange(command: Send) -> Mapping[str, Any]:
            nonlocal exchanges, late
            if late and (command.prompt or not exchanges):
                raise Busy(STARTED_TOO_LATE)
            if command.prompt:
                may_begin()
            began = now()
            if driver.asleep:
                self._gate.admit(command, priority)
            reply, times = await self._verifier.exchange(command, priority)
            driver.sent_at, driver.next_at = line.wrote, line.heard + GAP
            sent.append(driver.sent_at)
            late = late or now() - began > MAX_START_DELAY
            if driver.asleep:
                self._gate.answered(command)
            exchanges += times
            asked.append(reply.asked)
            return reply.values

        try:
            value = await run_driver(steps, exchange, self.scheduled.emit, self._context.note_once)
            self.exchanges, self.asked_at = exchanges, min(asked[-driver.position_reads :], default=math.inf)
            self.began_at = sent[0] if sent else now()
            return value
        except (Fault, asyncio.CancelledError):
            raise
        except Exception as error:  # a defect in a driver may fail one operation, but never the gateway
            self._context.note(f"internal error, please report it: {error!r}")
            if priority != STOP:  # a failed stop is retried anyway
                self.broken.emit(None)
            raise Refused(f"Internal error: {error!r}") from error
        finally:
            self._context.cache.orders += changes


async def run_driver(
    steps: Generator[Step, Any, _T],
    exchange: Callable[[Send], Awaitable[Mapping[str, object]]],
    plan: Callable[[Schedule], object],
    remark: Callable[[str], object] = lambda text: None,
) -> _T:
    """Run a driver's generator and return its value. Faults of exchanges are thrown into it. Raises Fault."""
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
