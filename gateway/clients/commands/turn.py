"""Carries out the commands of a connection: answers from cached readings, starts operations, or waits for the mount.

A command is answered within ``REPLY_TIMEOUT`` or never, except ``LONG_OPERATION``. A reply made only of cached readings
stays valid until one of them expires or is renewed, which increments the controller's ``answer_version``. For every
protocol, this module refuses operations that the client may not request, and motions and syncs whose command has waited
too long. It limits the number of operations that run without a reply, except those that end a motion.
"""

from __future__ import annotations

import asyncio
from collections import deque
from functools import partial
from math import inf

from msgspec import Struct

from gateway.clients.access import Rights
from gateway.clients.profiles import SurfaceBinding
from gateway.core import operations as op
from gateway.core.errors import Busy, Fault
from gateway.core.motion_kinds import HAND_MOTIONS, MOVERS, begins_motion, stops_focuser
from gateway.core.wire_log import ClientLog, printable
from gateway.mount.controller import MountController
from gateway.mount.link.queue import MAX_START_DELAY, START_TOO_LATE_MESSAGE
from gateway.mount.motion.taps import MAX_TAP_TIME
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import MAX_AGE, NOT_CACHED
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import UrgentEnd
from gateway.protocols.base.wants import (
    ChangeBaudRate,
    CheckPossible,
    Defer,
    FireAndForget,
    Handling,
    Note,
    ReuseLastReading,
)

#: A ``stop_count`` for commands that count as sent before every stop, so that they neither begin nor prolong a motion.
STALE_STOP_COUNT = -1
#: Seconds after which a reply is no longer sent: clients have given up by then and would take it for the reply to the
#: next command (NexStar protocol: the hand control answers within 3.5 s). The mount gets a little less time, so that
#: commands which arrived together with an unanswered command are still answered.
REPLY_TIMEOUT, MOUNT_TIMEOUT = 3.5, 3.4
#: Seconds after which a motion that has not begun is refused; shorter than ``REPLY_TIMEOUT``, to allow a reply.
START_TIMEOUT = 3.0
#: Maximum number of waiting commands of a connection; beyond that the oldest are dropped.
MAX_WAITING_COMMANDS = 256


class PendingCommand(Struct, eq=False):
    """A received command, and the generator ``steps`` that carries it out.

    ``arrived_at``: loop time. ``stop_count``: number of stops before it. ``ending``: the motion that it ended on
    arrival. ``is_reusable``: its reply depends only on cached readings, of the kinds ``reading_kinds``.
    ``has_ended_motion``: its last operation ended a motion. ``is_long_operation``: it waits until the next command,
    without a timeout. ``is_late``: its reply is no longer sent. ``new_baud``: the baud rate after its reply.
    ``press_duration``: seconds from the press of an arrow to its release.
    """

    frame: bytes
    steps: Handling
    stop_count: int
    ending: UrgentEnd | None
    arrived_at: float
    reading_kinds: list[type[op.Operation]] = []
    is_reusable: bool = True
    has_ended_motion: bool = False
    is_long_operation: bool = False
    is_late: bool = False
    new_baud: int | None = None
    press_duration: float | None = None
    timeout_timer: asyncio.TimerHandle | None = None


class Inbox(deque[PendingCommand]):
    """The commands that wait, in the order of arrival. Commands that are taken, dropped or cancelled are logged."""

    def __init__(self, log: ClientLog) -> None:
        super().__init__(maxlen=MAX_WAITING_COMMANDS)
        self._log = log

    def add(self, pending: PendingCommand) -> None:
        """Add a command; if the inbox is full, the oldest is dropped."""
        if len(self) == MAX_WAITING_COMMANDS:
            self._log.put("x", self[0].frame, f"more than {MAX_WAITING_COMMANDS} commands wait")
        self.append(pending)

    def take(self) -> PendingCommand:
        """Remove and return the oldest command; there must be a command."""
        pending = self.popleft()
        self._log.put(">", pending.frame)
        return pending

    def take_repeated(self, frame: bytes) -> int:
        """Remove the repetitions of this command that follow directly, and return their number."""
        count = 0
        while self and self[0].frame == frame:
            self.take()
            count += 1
        return count

    def note_release(self, presses: frozenset[bytes], now: float) -> bool:
        """Record how long the newest waiting press of an arrow was held, and remove earlier presses without a release.

        ``presses``: the arrow's commands. Return False and do nothing if none waits, or the newest is too old.
        """
        waiting = [pending for pending in self if pending.frame in presses]
        if not waiting or now - waiting[-1].arrived_at > MAX_TAP_TIME:
            return False
        for pending in waiting[:-1]:
            if pending.press_duration is None:
                self.remove(pending)
        if waiting[-1].press_duration is None:
            waiting[-1].press_duration = now - waiting[-1].arrived_at
        return True

    def cancel(self, frames: frozenset[bytes], cause: bytes) -> None:
        """Remove the waiting commands ``frames``, which would begin the motion that the command ``cause`` ends."""
        for pending in [pending for pending in self if pending.frame in frames]:
            self.remove(pending)
            self._log.put("x", pending.frame, f"cancelled by {cause!r}, which arrived before its turn")


#: The kinds of readings of which a reply is made.
ReadingKinds = list[type[op.Operation]]

#: Maximum number of commands whose replies are cached.
MAX_CACHED_REPLIES = 32
#: If a client requests two coordinates separately within this many seconds, both come from the same reading.
COORDINATE_PAIR_WINDOW = 1.0


class ReplyCache:
    """Caches replies by command. Times are those of the event loop, seconds."""

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        self._replies: dict[bytes, tuple[bytes, ReadingKinds]] = {}
        self._readings_version, self._valid_until = -1, 0.0

    def look_up(self, command: bytes, now: float) -> tuple[bytes, ReadingKinds] | None:
        """Return the cached reply to this command, and the kinds of readings it was made of; None if none is valid."""
        current = now < self._valid_until and self._readings_version == self._controller.answer_version
        return self._replies.get(command) if current else None

    def store(self, command: bytes, reply: bytes, reading_kinds: ReadingKinds, now: float) -> None:
        """Cache a reply that is valid until one of these readings expires."""
        version, until = self._controller.answer_version, self._controller.fresh_until(reading_kinds)
        if self._readings_version != version or now >= self._valid_until or len(self._replies) >= MAX_CACHED_REPLIES:
            self._replies.clear()
            self._readings_version, self._valid_until = version, float("inf")
        self._replies[command] = reply, reading_kinds
        self._valid_until = min(self._valid_until, until)

    def clear(self) -> None:
        """Forget all replies, because a command has changed something or may have."""
        self._replies.clear()


#: Maximum number of operations of a connection without a reply; beyond that only ends of motions are started.
MAX_BACKGROUND_OPERATIONS = 16


class BackgroundOperations:
    """Runs the operations of a client that have no reply; true as a condition while any of them runs."""

    def __init__(self, controller: MountController, log: ClientLog, activity: HostActivity) -> None:
        self._controller, self._log, self._activity = controller, log, activity
        self._operations: dict[asyncio.Future[None], op.Operation] = {}

    def __bool__(self) -> bool:
        return bool(self._operations)

    def start(self, operation: op.Operation, stop_count: int, requested_at: float) -> None:
        """Start an operation requested at loop time ``requested_at``; drop a motion if a stop followed. Log faults."""
        controller = self._controller
        if isinstance(operation, MOVERS) and stop_count != controller.stop_count:  # a stop came, or the client is gone
            return
        halts = isinstance(operation, op.StopAxis | op.AbortSlew)
        if halts and controller.reconciler.merge_halt(operation):
            return
        ends = halts or stops_focuser(operation)
        if len(self._operations) >= MAX_BACKGROUND_OPERATIONS and (not ends or operation in self._operations.values()):
            what = operation.title()
            self._log.note_once(f"commands arrive faster than the mount accepts them: {what}: not carried out")
            return
        failed = partial(self._log_failure, operation)
        task = controller.begin(operation, stop_count, failed, self._activity, requested_at)
        self._operations[task] = operation
        task.add_done_callback(lambda done: self._operations.pop(done, None))

    def _log_failure(self, operation: op.Operation, fault: Fault) -> None:
        self._log.log_refusal(fault.with_summary(operation.title()))


#: The operation that may take minutes; its reply has no timeout, but the next command ends the wait.
LONG_OPERATION = op.ClockFromGps


class CommandRunner:
    """Runs the commands of a client. ``rights``: what the client may do; ``equinox_converter``: for its coordinates."""

    def __init__(
        self,
        controller: MountController,
        binding: SurfaceBinding,
        session: Session,
        activity: HostActivity,
        log: ClientLog,
        rights: Rights,
    ) -> None:
        self._controller, self._surface, self._session = controller, binding.surface, session
        self._activity, self._log, self.reply_cache = activity, log, ReplyCache(controller)
        self.rights, self.equinox_converter = rights, binding.converter
        self.background = BackgroundOperations(controller, log, activity)
        self._deferral_timers: dict[str, asyncio.TimerHandle] = {}
        #: Kind of reading -> the last reading sent to the client, its loop time, the ``answer_version`` at that time.
        self._sent_readings: dict[type[op.Operation], tuple[object, float, int]] = {}

    def advance(self, pending: PendingCommand, answer: object, fault: Fault | None = None) -> op.Operation:
        """Continue a command, with the answer or fault of its last operation, until it must wait for another operation.
        Return that operation. Raises StopIteration with the reply when the command is done.
        """
        while True:
            if fault is not None:
                fault.is_logged = True  # it is in the log already
            wanted = pending.steps.send(answer) if fault is None else pending.steps.throw(fault)
            answer, fault, pending.is_long_operation = None, None, isinstance(wanted, LONG_OPERATION)
            if isinstance(wanted, FireAndForget):
                self._start(pending, wanted.operation)
            elif isinstance(wanted, CheckPossible):
                pending.is_reusable = False
                fault = self._refusal_fault(wanted.operation, pending.arrived_at) or self._find_fault(wanted.operation)
            elif isinstance(wanted, Defer):
                pending.is_reusable = False
                self._defer(wanted)
            elif isinstance(wanted, Note):
                self._controller.context.note_once(wanted.text)
            elif isinstance(wanted, ChangeBaudRate):
                pending.is_reusable, pending.new_baud = False, wanted.baud
            else:
                if isinstance(wanted, ReuseLastReading):
                    wanted = wanted.operation
                    answer = self._recently_sent_reading(wanted, pending)
                    if answer is not None:
                        continue
                if not isinstance(wanted, op.Read):
                    fault = self._refusal_fault(wanted, pending.arrived_at)
                    if fault is None:
                        return wanted
                    pending.is_reusable = False
                    continue
                value = self._controller.peek(wanted, self._activity.program)
                if value is NOT_CACHED:
                    return wanted
                if type(wanted) in MAX_AGE:
                    pending.reading_kinds.append(type(wanted))
                elif not (isinstance(wanted, op.NativeRequest) and wanted.keep == "fixed"):
                    pending.is_reusable = False
                answer = self._to_client_equinox(wanted, value)

    async def finish(self, pending: PendingCommand, operation: op.Operation) -> bytes | None:
        """Wait for each operation of the command until the command is done. Return its reply."""
        while True:
            answer, fault = None, None
            try:
                patience = (
                    pending.arrived_at + START_TIMEOUT - self._controller.now() if self._surface.has_replies else inf
                )
                value = await self._controller.perform(
                    self._to_jnow(operation), pending.stop_count, self._activity, patience, pending.arrived_at
                )
                answer = self._to_client_equinox(operation, value)
            except Fault as error:
                text = error.with_summary(operation.title())
                (self._log.note if isinstance(operation, op.Read) else self._log.log_refusal)(text)
                fault = error
            try:
                operation = self.advance(pending, answer, fault)
            except StopIteration as end:
                reply: bytes | None = end.value
                return reply

    # --- requested operations ----------------------------------------------------------------------------------------

    def _start(self, pending: PendingCommand, operation: op.Operation) -> None:
        """Start an operation without waiting, unless it was already started when the bytes of its command arrived."""
        pending.is_reusable = False
        if self._refusal_fault(operation, pending.arrived_at):
            return
        pending.has_ended_motion = isinstance(operation, op.StopAxis | op.AbortSlew)
        if pending.ending is None or operation != pending.ending.operation:
            self.background.start(self._to_jnow(operation), pending.stop_count, pending.arrived_at)
        if pending.press_duration is not None and isinstance(operation, op.Move | op.MoveAxis):
            self.background.start(
                op.StopAxis(operation.axis), pending.stop_count, pending.arrived_at + pending.press_duration
            )

    def _refusal_fault(self, operation: op.Operation, arrived_at: float) -> Fault | None:
        """Return a fault if the client may not request an operation, or requested it too long ago. Log the refusal."""
        late = self._controller.now() - arrived_at
        if late > MAX_START_DELAY and (
            isinstance(operation, HAND_MOTIONS)  # a motion or a sync is not done after its reply is too late
            or (late > MOUNT_TIMEOUT and (begins_motion(operation) or isinstance(operation, op.Sync)))
        ):
            self._log.log_refusal(f"{operation.title()}: {START_TOO_LATE_MESSAGE}")
            return Busy(START_TOO_LATE_MESSAGE)
        refusal = self.rights.refusal(operation)
        if refusal is not None:
            self._log.log_refusal_once(f"{operation.title()} refused: {refusal.reason}")
        return None if refusal is None else refusal.fault

    def _find_fault(self, operation: op.Operation) -> Fault | None:
        """Return and log the fault with which the operation would surely fail now; None if there is none."""
        fault = self._controller.certain_fault(operation)
        if fault is not None:
            self._log.log_refusal(fault.with_summary(operation.title()))
        return fault

    # --- answers -----------------------------------------------------------------------------------------------------

    def _recently_sent_reading(self, operation: op.Operation, pending: PendingCommand) -> object:
        """Return the reading sent to the client in the last ``COORDINATE_PAIR_WINDOW`` seconds; None if none was."""
        value, at, version = self._sent_readings.get(type(operation), (None, -inf, 0))
        if self._controller.now() - at >= COORDINATE_PAIR_WINDOW:
            return None
        if version == self._controller.answer_version:
            pending.reading_kinds.append(type(operation))
        else:
            pending.is_reusable = False
        return value

    def _to_client_equinox(self, operation: op.Operation, value: object) -> object:
        """Return an answer in the client's equinox; record a reading as the last one sent to the client."""
        if self.equinox_converter is not None:
            value = self.equinox_converter.to_client(operation, value)
        if type(operation) in MAX_AGE:
            self._sent_readings[type(operation)] = value, self._controller.now(), self._controller.answer_version
        return value

    async def read_for_client(self, operation: op.Operation) -> object:
        """Return a reading in the client's equinox, for a subscription. Raises Fault."""
        value: object = await self._controller.answer(self._to_jnow(operation), self._activity)
        return value if self.equinox_converter is None else self.equinox_converter.to_client(operation, value)

    def _to_jnow(self, operation: op.Operation) -> op.Operation:
        return operation if self.equinox_converter is None else self.equinox_converter.to_equinox_of_date(operation)

    # --- deferred commands -------------------------------------------------------------------------------------------

    def _defer(self, deferral: Defer) -> None:
        controller = self._controller
        controller.context.incoming_settings.expect_rest(self._activity.program, controller.now() + deferral.seconds)
        old = self._deferral_timers.pop(deferral.handler, None)
        if old is not None:
            old.cancel()
        self._deferral_timers[deferral.handler] = controller.loop.call_later(
            deferral.seconds, lambda: controller.spawn(self._run_deferred_handler(deferral.handler))
        )

    async def _run_deferred_handler(self, handler_name: str) -> None:
        """Run a deferred handler. It has no reply, so it may run after its connection has closed."""
        steps = self._surface.call(handler_name, self._session, None, {})
        pending = PendingCommand(
            handler_name.encode(), steps, self._controller.stop_count, None, self._controller.now()
        )
        try:
            await self.finish(pending, self.advance(pending, None))
        except StopIteration:
            return
        except Fault as fault:
            self._log.note(f"{handler_name}: {fault}")
        except Exception as error:
            self.handle_defect(pending.frame, error)
        finally:
            self._controller.context.incoming_settings.note_complete(self._activity.program)

    def handle_defect(self, frame: bytes, error: Exception) -> None:
        """Log an internal error, and stop a moving mount: the failed command may have been meant to end the motion."""
        self._log.note(f"internal error at {printable(frame)}, please report it: {error!r}")
        if self._controller.reconciler.busy:
            self._controller.begin_stop()
