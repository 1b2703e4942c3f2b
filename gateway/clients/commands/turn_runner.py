"""Carries out one command: each operation is answered from the cache, started, refused, or waited for.

``advance`` runs until the command must wait, ``finish`` runs the rest. Operations that the client may not request, or
requests too late, are refused here for every protocol. The number of operations that run without a reply is limited,
except for those that end a motion.
"""

from __future__ import annotations

import asyncio
from functools import partial
from math import inf

from gateway.clients.access import Rights
from gateway.clients.commands.turn import REFUSE_AFTER, WAIT_FOR_MOUNT, ReplyCache, Turn
from gateway.clients.profiles import EquinoxConverter
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import BY_HAND, MOVING, begins_motion, ends_focus
from gateway.core.operations import AbortSlew, ClockFromGps, Move, MoveAxis, Operation, Own, Read, StopAxis, Sync
from gateway.core.wire_log import ClientLog
from gateway.mount.controller import MountController
from gateway.mount.link.queue import MAX_START_DELAY, STARTED_TOO_LATE
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import MAX_AGE, NOT_CACHED
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import Surface
from gateway.protocols.base.wants import ChangeBaudRate, CheckPossible, Defer, FireAndForget, Note, ReuseLastReading

#: Operations of one connection that may run without a reply; beyond that only those that end a motion are started.
MAX_BACKGROUND = 16


class BackgroundOperations:
    """The operations of one client that run without a reply. True while there are any."""

    def __init__(self, controller: MountController, log: ClientLog, activity: HostActivity) -> None:
        self._controller, self._log, self._activity = controller, log, activity
        self._operations: dict[asyncio.Future[None], Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def start(self, operation: Operation, stops: int, asked: float) -> None:
        """Start an operation without a reply, which the client ``asked`` for then; a failure goes to the wire log."""
        controller = self._controller
        if isinstance(operation, MOVING) and stops != controller.stops:  # a stop came since, or the client is gone
            return
        halts = isinstance(operation, StopAxis | AbortSlew)
        if halts and controller.orders.halt_is_pending(operation):
            return
        ends = halts or ends_focus(operation)
        if len(self._operations) >= MAX_BACKGROUND and (not ends or operation in self._operations.values()):
            what = operation.title()
            self._log.note_once(f"commands arrive faster than the mount accepts them: {what}: not carried out")
            return
        failed = partial(self._failed, operation)
        task = controller.begin(operation, stops, failed, self._activity, asked)
        self._operations[task] = operation
        task.add_done_callback(lambda done: self._operations.pop(done, None))

    def _failed(self, operation: Operation, fault: Fault) -> None:
        self._log.refused(f"{operation.title()}: {fault}")


#: An operation that takes minutes by its manual and ends with the next command: its reply may take until then.
LASTING = ClockFromGps


class TurnRunner:
    """Runs the commands of one client. ``rights`` are its rights, ``equinox`` converts its coordinates."""

    def __init__(
        self, controller: MountController, surface: Surface, session: Session, activity: HostActivity, log: ClientLog
    ) -> None:
        self._controller, self._surface, self._session = controller, surface, session
        self._activity, self._log, self.cache = activity, log, ReplyCache()
        self.rights = Rights()
        self.equinox: EquinoxConverter | None = None
        self.background = BackgroundOperations(controller, log, activity)
        self._deferred: dict[str, asyncio.TimerHandle] = {}

    def advance(self, turn: Turn, answer: object, fault: Fault | None = None) -> Operation:
        """Continue a command until it must wait. Return the operation to wait for; StopIteration carries the reply."""
        while True:
            wanted = turn.steps.send(answer) if fault is None else turn.steps.throw(fault)
            answer, fault, turn.lasting = None, None, isinstance(wanted, LASTING)
            if isinstance(wanted, FireAndForget):
                self._start(turn, wanted.operation)
            elif isinstance(wanted, CheckPossible):
                turn.reusable = False
                fault = self._refused(wanted.operation, turn.arrived) or self._impossible(wanted.operation)
            elif isinstance(wanted, Defer):
                turn.reusable = False
                self._defer(wanted)
            elif isinstance(wanted, Note):
                self._controller.context.note_once(wanted.text)
            elif isinstance(wanted, ChangeBaudRate):
                turn.reusable, turn.baud = False, wanted.baud
            else:
                if isinstance(wanted, ReuseLastReading):
                    wanted = wanted.operation
                    answer = self._recent_reading(wanted, turn)
                    if answer is not None:
                        continue
                fault = self._refused(wanted, turn.arrived)
                if fault is not None:
                    turn.reusable = False
                    continue
                value = (
                    self._controller.peek(wanted, self._activity.program) if isinstance(wanted, Read) else NOT_CACHED
                )
                if value is NOT_CACHED:
                    return wanted
                if type(wanted) in MAX_AGE:
                    turn.readings.append(type(wanted))
                elif not (isinstance(wanted, Own) and wanted.keep == "fixed"):
                    turn.reusable = False
                answer = self._to_client(wanted, value)

    async def finish(self, turn: Turn, wanted: Operation) -> bytes | None:
        """Wait for one operation after the other until the command is done. Return its reply."""
        while True:
            answer, fault = None, None
            try:
                patience = turn.arrived + REFUSE_AFTER - self._controller.now() if self._surface.replies else inf
                value = await self._controller.perform(
                    self._to_internal(wanted), turn.stops, self._activity, patience, turn.arrived
                )
                answer = self._to_client(wanted, value)
            except Fault as error:
                words = f"{wanted.title()}: {error}"
                (self._log.note if isinstance(wanted, Read) else self._log.refused)(words)
                fault = error
            try:
                wanted = self.advance(turn, answer, fault)
            except StopIteration as end:
                reply: bytes | None = end.value
                return reply

    # --- requested operations ----------------------------------------------------------------------------------------

    def _start(self, turn: Turn, operation: Operation) -> None:
        """Start an operation without waiting. One that was started when the bytes arrived is not started again."""
        turn.reusable = False
        if self._refused(operation, turn.arrived):
            return
        turn.ended_motion = isinstance(operation, StopAxis | AbortSlew)
        if turn.ending is None or operation != turn.ending.operation:
            self.background.start(self._to_internal(operation), turn.stops, turn.arrived)
        if turn.held is not None and isinstance(operation, Move | MoveAxis):
            self.background.start(StopAxis(operation.axis), turn.stops, turn.arrived + turn.held)

    def _refused(self, operation: Operation, arrived: float) -> Fault | None:
        """Return the fault if the client may not request this or it is too late, and log it."""
        late = self._controller.now() - arrived
        if late > MAX_START_DELAY and (
            isinstance(operation, BY_HAND) or (late > WAIT_FOR_MOUNT and _never_late(operation))
        ):
            self._log.refused(f"{operation.title()}: {STARTED_TOO_LATE}")
            return Busy(STARTED_TOO_LATE)
        refusal = self.rights.refusal(operation)
        if refusal is not None:
            self._log.refused_once(f"{operation.title()} refused: {refusal.why}")
        return None if refusal is None else refusal.fault

    def _impossible(self, operation: Operation) -> Fault | None:
        """Return the fault if the operation is impossible now, and log it."""
        fault = self._controller.impossible(operation)
        if fault is not None:
            self._log.refused(f"{operation.title()}: {fault}")
        return fault

    # --- answers -----------------------------------------------------------------------------------------------------

    def _recent_reading(self, operation: Operation, turn: Turn) -> object:
        """Return the reading that the client was sent a moment ago; None if that is too long ago."""
        sent = self.cache.recent_reading(operation, self._controller.now())
        if sent is None:
            return None
        value, version = sent
        if version == self._controller.version:
            turn.readings.append(type(operation))
        else:
            turn.reusable = False
        return value

    def _to_client(self, operation: Operation, value: object) -> object:
        if self.equinox is not None:
            value = self.equinox.to_client(operation, value)
        if type(operation) in MAX_AGE:
            self.cache.remember_reading(operation, value, self._controller.now(), self._controller.version)
        return value

    async def reading(self, operation: Operation) -> object:
        """Return a reading in this client's form, for a subscription. Raises Fault."""
        value = self._controller.peek(operation, self._activity.program)
        if value is NOT_CACHED:
            value = await self._controller.perform(self._to_internal(operation), self._controller.stops, self._activity)
        return value if self.equinox is None else self.equinox.to_client(operation, value)

    def _to_internal(self, operation: Operation) -> Operation:
        return operation if self.equinox is None else self.equinox.to_internal(operation)

    # --- deferred commands -------------------------------------------------------------------------------------------

    def _defer(self, wanted: Defer) -> None:
        controller = self._controller
        controller.context.incoming.expect(self._activity.program, controller.now() + wanted.seconds)
        old = self._deferred.pop(wanted.handler, None)
        if old is not None:
            old.cancel()
        self._deferred[wanted.handler] = controller.loop.call_later(
            wanted.seconds, lambda: controller.spawn(self._deferred_handler(wanted.handler))
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
        finally:
            self._controller.context.incoming.complete(self._activity.program)

    def defect(self, frame: bytes, error: Exception) -> None:
        """Log an internal error, and stop a moving mount: the failed command may have been meant to end the motion."""
        self._log.note(f"internal error at {frame!r}, please report it: {error!r}")
        if self._controller.reconciler.busy:
            self._controller.begin_stop()


def _never_late(operation: Operation) -> bool:
    """Whether the operation must not be carried out after its reply is too late: a motion or a sync."""
    return begins_motion(operation) or isinstance(operation, Sync)
