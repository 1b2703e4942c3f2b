"""Carries out one command: each operation is answered from the cache, started, refused, or waited for.

``advance`` runs until the command must wait, ``finish`` runs the rest. Operations that the client may not request, or
requests too late, are refused here for every protocol. The number of operations that run without a reply is limited,
except for those that end a motion.
"""

from __future__ import annotations

import asyncio

from gateway.clients.access import Rights
from gateway.clients.commands.turn import NO_IN_TIME, WAIT_FOR_MOUNT, ReplyCache, Turn
from gateway.clients.profiles import J2000
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import BY_HAND, MOVING, begins_motion, ends_focus
from gateway.core.operations import AbortSlew, ClockFromGps, Operation, Own, Read, StopAxis, Sync
from gateway.core.wire_log import ClientLog
from gateway.mount.controller import MountController
from gateway.mount.link.queue import AT_ONCE, LATE
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import FRESH, MISSING
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import Surface
from gateway.protocols.base.wants import Defer, FireAndForget, Possible, ReuseLastReading, Speed

#: Operations of one connection that may run without a reply; beyond that only those that end a motion are started.
BEGUN = 16


class Begun:
    """The operations of one client that run without a reply. True while there are any."""

    def __init__(self, controller: MountController, log: ClientLog, life: HostActivity) -> None:
        self._controller, self._log, self._life = controller, log, life
        self._operations: dict[asyncio.Future[None], Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def begin(self, operation: Operation, stops: int) -> None:
        """Start an operation without a reply; a failure goes to the wire log."""
        controller, name = self._controller, type(operation).__name__
        if isinstance(operation, MOVING) and stops != controller.stops:  # a stop came since, or the client is gone
            return
        halts = isinstance(operation, StopAxis | AbortSlew)
        if halts and controller.orders.again(operation):
            return
        ends = halts or ends_focus(operation)
        if len(self._operations) >= BEGUN and (not ends or operation in self._operations.values()):
            self._log.note_once(f"commands arrive faster than the mount accepts them: {name} is not carried out")
            return
        task = controller.begin(operation, stops, lambda fault: self._log.refused(f"{name}: {fault}"), self._life)
        self._operations[task] = operation
        task.add_done_callback(lambda done: self._operations.pop(done, None))


#: An operation that takes minutes by its manual and ends with the next command: its reply may take until then.
LASTING = ClockFromGps


class TurnRunner:
    """Runs the commands of one client. ``rights`` are its rights, ``equinox`` converts its coordinates."""

    def __init__(
        self, controller: MountController, surface: Surface, session: Session, life: HostActivity, log: ClientLog
    ) -> None:
        self._controller, self._surface, self._session = controller, surface, session
        self._life, self._log, self.cache = life, log, ReplyCache()
        self.rights = Rights()
        self.equinox: J2000 | None = None
        self.begun = Begun(controller, log, life)
        self._deferred: dict[str, asyncio.TimerHandle] = {}

    def advance(self, turn: Turn, answer: object, fault: Fault | None = None) -> Operation:
        """Continue a command until it must wait. Return the operation to wait for; StopIteration carries the reply."""
        while True:
            wanted = turn.steps.send(answer) if fault is None else turn.steps.throw(fault)
            answer, fault, turn.lasting = None, None, isinstance(wanted, LASTING)
            if isinstance(wanted, FireAndForget):
                self._begin(turn, wanted.operation)
            elif isinstance(wanted, Possible):
                turn.plain = False
                fault = self._refused(wanted.operation, turn.came) or self._impossible(wanted.operation)
            elif isinstance(wanted, Defer):
                turn.plain = False
                self._defer(wanted)
            elif isinstance(wanted, Speed):
                turn.plain, turn.baud = False, wanted.baud
            else:
                if isinstance(wanted, ReuseLastReading):
                    wanted = wanted.operation
                    answer = self._again(wanted, turn)
                    if answer is not None:
                        continue
                fault = self._refused(wanted, turn.came)
                if fault is not None:
                    turn.plain = False
                    continue
                value = self._controller.peek(wanted) if isinstance(wanted, Read) else MISSING
                if value is MISSING:
                    return wanted
                if type(wanted) in FRESH:
                    turn.spent.append(type(wanted))
                elif not (isinstance(wanted, Own) and wanted.keep == "fixed"):
                    turn.plain = False
                answer = self._tell(wanted, value)

    async def finish(self, turn: Turn, wanted: Operation) -> bytes | None:
        """Wait for one operation after the other until the command is done. Return its reply."""
        while True:
            answer, fault = None, None
            try:
                patience = turn.came + NO_IN_TIME - self._controller.now()
                told = await self._controller.perform(self._inward(wanted), turn.stops, self._life, patience)
                answer = self._tell(wanted, told)
            except Fault as error:
                words = f"{type(wanted).__name__}: {error}"
                (self._log.note if isinstance(wanted, Read) else self._log.refused)(words)
                fault = error
            try:
                wanted = self.advance(turn, answer, fault)
            except StopIteration as end:
                reply: bytes | None = end.value
                return reply

    # --- requested operations ----------------------------------------------------------------------------------------

    def _begin(self, turn: Turn, operation: Operation) -> None:
        """Start an operation without waiting. One that was started when the bytes arrived is not started again."""
        turn.plain = False
        if self._refused(operation, turn.came):
            return
        turn.halting = isinstance(operation, StopAxis | AbortSlew)
        if turn.ending is None or operation != turn.ending.operation:
            self.begun.begin(self._inward(operation), turn.stops)

    def _refused(self, operation: Operation, came: float) -> Fault | None:
        """Return the fault if the client may not request this or it is too late, and log it."""
        late = self._controller.now() - came
        if late > AT_ONCE and (isinstance(operation, BY_HAND) or (late > WAIT_FOR_MOUNT and _never_late(operation))):
            self._log.refused(f"{type(operation).__name__}: {LATE}")
            return Busy(LATE)
        refusal = self.rights.refusal(operation)
        if refusal is not None:
            self._log.refused_once(f"{type(operation).__name__} refused: {refusal.why}")
        return None if refusal is None else refusal.fault

    def _impossible(self, operation: Operation) -> Fault | None:
        """Return the fault if the operation is impossible now, and log it."""
        fault = self._controller.impossible(operation)
        if fault is not None:
            self._log.refused(f"{type(operation).__name__}: {fault}")
        return fault

    # --- answers -----------------------------------------------------------------------------------------------------

    def _again(self, operation: Operation, turn: Turn) -> object:
        """Return the reading that the client was sent a moment ago; None if that is too long ago."""
        told = self.cache.again(operation, self._controller.now())
        if told is None:
            return None
        value, version = told
        if version == self._controller.version:
            turn.spent.append(type(operation))
        else:
            turn.plain = False
        return value

    def _tell(self, operation: Operation, value: object) -> object:
        if self.equinox is not None:
            value = self.equinox.outward(operation, value)
        if type(operation) in FRESH:
            self.cache.told(operation, value, self._controller.now(), self._controller.version)
        return value

    async def reading(self, operation: Operation) -> object:
        """Return a reading in this client's form, for a subscription. Raises Fault."""
        value = self._controller.peek(operation)
        if value is MISSING:
            value = await self._controller.perform(self._inward(operation), self._controller.stops, self._life)
        return value if self.equinox is None else self.equinox.outward(operation, value)

    def _inward(self, operation: Operation) -> Operation:
        return operation if self.equinox is None else self.equinox.inward(operation)

    # --- deferred commands -------------------------------------------------------------------------------------------

    def _defer(self, wanted: Defer) -> None:
        old = self._deferred.pop(wanted.handler, None)
        if old is not None:
            old.cancel()
        self._deferred[wanted.handler] = self._controller.loop.call_later(
            wanted.seconds, lambda: self._controller.spawn(self._deferred_handler(wanted.handler))
        )

    async def _deferred_handler(self, handler: str) -> None:
        """Run a deferred handler. It has no reply, so it may outlive its connection."""
        steps = self._surface.call(handler, self._session, None, {})
        turn = Turn(handler.encode(), steps, self._controller.stops, None, self._controller.now())
        try:
            await self.finish(turn, self.advance(turn, None))
        except StopIteration:
            return
        except Fault as fault:
            self._log.note(f"{handler}: {fault}")
        except Exception as error:
            self.defect(turn.frame, error)

    def defect(self, frame: bytes, error: Exception) -> None:
        """Log an internal error, and stop a moving mount: the failed command may have been meant to end the motion."""
        self._log.note(f"internal error at {frame!r}, please report it: {error!r}")
        if self._controller.reconciler.busy:
            self._controller.begin_stop()


def _never_late(operation: Operation) -> bool:
    """Whether the operation must not be carried out after its reply is too late: a motion or a sync."""
    return begins_motion(operation) or isinstance(operation, Sync)
