"""Taking one command through the surface: what it asks for is at hand, begun, refused, or must be waited for.

``advance`` goes as far as it goes without waiting, ``finish`` the rest of the way. What a client may not ask for, and
what it asks for too late, is refused here, whatever the protocol. Of what nobody waits for a limited number is under
way, plus whatever ends a motion.
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

#: Operations of one connection that may be under way without anybody waiting for them; only an end is begun beyond.
BEGUN = 16


class Begun:
    """The operations of a client that are under way without anybody waiting for them. True while there are any."""

    def __init__(self, controller: MountController, log: ClientLog, life: HostActivity) -> None:
        self._controller, self._log, self._life = controller, log, life
        self._operations: dict[asyncio.Future[None], Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def begin(self, operation: Operation, stops: int) -> None:
        """An operation nobody is told the outcome of: a failure goes to the wire log."""
        controller, name = self._controller, type(operation).__name__
        if isinstance(operation, MOVING) and stops != controller.stops:  # a stop came since, or nobody is there
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


#: What takes minutes by its manual, and ends with the next command: its answer is waited for until that comes.
LASTING = ClockFromGps


class TurnRunner:
    """Of one client. ``rights`` are what it may ask for, ``equinox`` is how it counts coordinates."""

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
        """Go on with a command as far as it goes without waiting -> the operation that must be waited for."""
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
        """Wait for one operation after the other until the command is done -> its reply."""
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

    # --- what is asked for ------------------------------------------------------------------------------------------

    def _begin(self, turn: Turn, operation: Operation) -> None:
        """Have it done without waiting for it; a stop that was begun when it came is not begun again."""
        turn.plain = False
        if self._refused(operation, turn.came):
            return
        turn.halting = isinstance(operation, StopAxis | AbortSlew)
        if turn.ending is None or operation != turn.ending.operation:
            self.begun.begin(self._inward(operation), turn.stops)

    def _refused(self, operation: Operation, came: float) -> Fault | None:
        """What this client is told no with, where it may not ask for this or it is too late; the wire log is told."""
        late = self._controller.now() - came
        if late > AT_ONCE and (isinstance(operation, BY_HAND) or (late > WAIT_FOR_MOUNT and _never_late(operation))):
            self._log.refused(f"{type(operation).__name__}: {LATE}")
            return Busy(LATE)
        refusal = self.rights.refusal(operation)
        if refusal is not None:
            self._log.refused_once(f"{type(operation).__name__} refused: {refusal.why}")
        return None if refusal is None else refusal.fault

    def _impossible(self, operation: Operation) -> Fault | None:
        """What this client is told no with where nothing can come of it; the wire log is told."""
        fault = self._controller.impossible(operation)
        if fault is not None:
            self._log.refused(f"{type(operation).__name__}: {fault}")
        return fault

    # --- what it is told --------------------------------------------------------------------------------------------

    def _again(self, operation: Operation, turn: Turn) -> object:
        """What this client was told a moment ago; None when that is too long ago."""
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
        """A reading as this client is told it, without being asked for it. Raises Fault."""
        value = self._controller.peek(operation)
        if value is MISSING:
            value = await self._controller.perform(self._inward(operation), self._controller.stops, self._life)
        return value if self.equinox is None else self.equinox.outward(operation, value)

    def _inward(self, operation: Operation) -> Operation:
        return operation if self.equinox is None else self.equinox.inward(operation)

    # --- what is done later -----------------------------------------------------------------------------------------

    def _defer(self, wanted: Defer) -> None:
        old = self._deferred.pop(wanted.handler, None)
        if old is not None:
            old.cancel()
        self._deferred[wanted.handler] = self._controller.loop.call_later(
            wanted.seconds, lambda: self._controller.spawn(self._deferred_handler(wanted.handler))
        )

    async def _deferred_handler(self, handler: str) -> None:
        """Run a deferred handler: it has no reply, so it may run after the connection has ended."""
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
        """An error of this program: what failed may have been what should have ended a motion."""
        self._log.note(f"internal error at {frame!r}, please report it: {error!r}")
        if self._controller.reconciler.busy:
            self._controller.begin_stop()


def _never_late(operation: Operation) -> bool:
    """Whether it is not to be done when whoever asked for it is not told any more: a motion, or a sync."""
    return begins_motion(operation) or isinstance(operation, Sync)
