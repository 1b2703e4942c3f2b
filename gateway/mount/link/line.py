"""The line to the mount: one exchange at a time; a stop goes first, then motions, then settings, then reads.

After a timeout or a garbled reply, and during a long operation of the mount, nothing but a stop is sent. A port that is
lost, or on which the mount does not reply, is reopened with growing pauses, for ever. A stop waits for one exchange at
most, which is cut off if it lasts longer than usual. Then the stop is written without waiting for replies. It is
repeated until the line is in step (every reply belongs to the latest request): the mount may not have received it.
"""

from __future__ import annotations

import asyncio

from gateway.core.errors import Busy, Fault, NoAnswer, Silence
from gateway.core.operations import Values
from gateway.core.signals import Signal
from gateway.core.wire_log import WireLog
from gateway.mount.link.queue import READ, STOP, RequestQueue
from gateway.mount.link.transaction import QUIET_TIME, GaveWayToStop, Transaction
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import Transport

#: Seconds of silence after half a command: a hand control takes whatever arrives sooner for the other half.
HALF_COMMAND_SILENCE = 3.5
#: Seconds between two commands of a stop that is written without waiting for replies, unless a reply comes sooner.
STOP_COMMAND_GAP = 0.2
#: Seconds without a reply after which the port is closed and reopened.
REOPEN_SILENCE = 20.0
#: Seconds after which a reply is overdue: from then on the mount may not be listening at all.
OVERDUE_TIME = 2.0
#: Seconds before each further attempt to open the port; the last pause repeats.
REOPEN_DELAYS = (0.5, 1.0, 2.0, 5.0)
#: The beginning of ``MountLink.down_cause`` if the port cannot be opened.
CANNOT_OPEN_MESSAGE = "cannot open"
#: How often the gateway checks whether the line is in step before it counts as down, and the factor by which the quiet
#: time before each check grows.
MAX_CHECKS, QUIET_FACTOR = 3, 3.0


class MountLink:
    """Owns the wire and carries out the requests that wait for it. ``came_up`` is emitted when the line comes up,
    ``exchanged`` with the outcome of every exchange.
    """

    def __init__(
        self, wire: Transport, reply_rules: ReplyRules, wire_log: WireLog, queue: RequestQueue | None = None
    ) -> None:
        self.reply_rules, self.wire_log = reply_rules, wire_log
        self.queue = RequestQueue() if queue is None else queue  # `or` would replace an empty queue
        self.transaction = Transaction(wire, self.queue, reply_rules, wire_log)
        #: Emitted when the port is lost, perhaps in the middle of an exchange.
        self.port_lost = self.transaction.wire_lost
        #: How long the mount takes to reply, and how often it has replied.
        self.times = self.transaction.times
        self._state = "opening"
        self.came_up: Signal[None] = Signal()
        self.exchanged: Signal[Values | Fault] = Signal()
        #: Emitted when the port is open again.
        self.reopened: Signal[None] = Signal()
        #: Emitted before a stop is written: a listener adds to the list the commands of a stop not acknowledged yet.
        self.writing_stop: Signal[list[bytes]] = Signal()
        self.down_cause = ""
        self._clock = asyncio.get_running_loop().time
        self._wire_used_by_others = False
        self._check_count = 0
        #: Loop time of the first request since the last reply; None if every request was answered.
        self._silent_since: float | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._run())

    @property
    def wire(self) -> Transport:
        """The transport to the mount; it may be replaced until the line is started."""
        return self.transaction.wire

    @wire.setter
    def wire(self, wire: Transport) -> None:
        self.transaction.wire = wire

    @property
    def state(self) -> str:
        """``opening``, ``up``, ``down``, or ``busy``: up, but a long operation of the mount lets only stops through."""
        return "busy" if self._state == "up" and self.transaction.refuses_others else self._state

    @property
    def is_running(self) -> bool:
        """Whether the worker task runs: exchanges are carried out only after the start and before its end."""
        return self._task is not None and not self._task.done()

    @property
    def usable(self) -> bool:
        return self.state == "up" and self.is_running

    @property
    def open_error(self) -> str:
        """Why the port cannot be opened; empty unless the last attempt has failed."""
        return self.down_cause if self.down_cause.startswith(CANNOT_OPEN_MESSAGE) else ""

    @property
    def occupied(self) -> bool:
        """Whether the mount works on a long operation and accepts nothing but a stop."""
        return self.state == "busy" or self.transaction.is_long_op

    @property
    def reply_is_overdue(self) -> bool:
        """Whether a reply is missing for so long that the mount may not be listening."""
        if self._silent_since is None or self.occupied:
            return False
        return self._clock() - self._silent_since > max(OVERDUE_TIME, 2.5 * self.times.typical_rtt)

    def was_busy_after(self, loop_time: float) -> bool:
        """Whether the mount has worked on a long operation since this loop time."""
        return self.occupied or self.transaction.long_op_ended_at >= loop_time

    async def close(self) -> None:
        """End the worker and close the wire; waiting and later requests fail with NoAnswer."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await self.wire.close()
        self._state = "down"
        self.queue.fail_all()

    def check_line_again(self) -> None:
        """Have the line brought into step before the next exchange, because another process has written to the wire."""
        self._wire_used_by_others = True
        self.queue.wake()

    async def exchange(self, command: Send, priority: int = READ) -> Values:
        """Send a command when its turn comes and return the reply's fields. Raises Fault."""
        return (await self.timed_exchange(command, priority))[0]

    async def timed_exchange(self, command: Send, priority: int) -> tuple[Values, float]:
        """Like `exchange`, but also return the seconds that the reply took. Raises Fault, with ``reply_seconds``."""
        if self.state == "down":
            self._wake_exchange(priority)
            unheard = NoAnswer()
            unheard.is_sent = False
            raise unheard
        if self.state == "busy" and priority != STOP:
            raise Busy
        outcome = self.queue.add(command, priority)
        self._wake_exchange(priority)
        return await outcome

    def _wake_exchange(self, priority: int) -> None:
        """Wake the exchange under way for a stop that is not written yet; during a long operation, for any request."""
        stop = priority == STOP and not (
            self.transaction.written_stops and self.transaction.written_stops.issuperset(self._stop_commands())
        )
        if stop or self.transaction.is_long_op:
            self.transaction.wake(stop)

    def _stop_commands(self) -> list[bytes]:
        """Return the commands of the stop that the mount has not acknowledged, else those of the queued stops."""
        commands: list[bytes] = []
        self.writing_stop.emit(commands)
        return commands or self.queue.encoded_stops(self.reply_rules.encode)

    # --- the worker -----------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failures = 0
        while True:
            try:
                await self.wire.open(*self.transaction.open_callbacks())
            except Exception as error:  # pyserial raises more than OSError
                reason = str(getattr(error, "strerror", None) or error)
                self.wire_log.put("mount", "v", note=reason)
                self._mark_down(f"{CANNOT_OPEN_MESSAGE} {self.wire.name}: {reason}")
                await asyncio.sleep(REOPEN_DELAYS[min(failures, len(REOPEN_DELAYS) - 1)])
                failures += 1
                continue
            failures = 0
            self.wire_log.put("mount", "^")
            self.transaction.discard("came before the line was lost")
            if self.transaction.written_at > 0:  # a request was sent before the loss: its reply may still arrive
                await self._resync_reopened_line()
            else:
                self._mark_up()
            try:
                await self._serve_requests()
            except Exception as error:  # a defect here must not end the worker, and with it the line
                self.wire_log.note("mount", f"internal error, please report it: {error!r}")
                self._mark_down("internal error")
                await asyncio.sleep(REOPEN_DELAYS[0])
            await self.wire.close()

    async def _resync_reopened_line(self) -> None:
        """Bring a reopened line into step. If half a command was sent before, first wait until the mount drops it."""
        self.reopened.emit(None)
        half, self.transaction.half_command_sent = self.transaction.half_command_sent, False
        stopped = await self._write_stop()
        if half and not stopped:
            await self.transaction.idle(self.transaction.written_at + HALF_COMMAND_SILENCE - self._clock())
        await self._recover()

    async def _write_stop(self) -> bool:
        """Write the commands of `_stop_commands` without waiting for replies; return whether there were any."""
        commands, before = self._stop_commands(), self.reply_rules.half_command_end
        self.transaction.note_stop_written(commands)
        for command in commands:
            if not self.transaction.send(before + command):
                break
            before = b""
            await self.transaction.wait_for_any_byte(STOP_COMMAND_GAP)
        return bool(commands)

    async def _serve_requests(self) -> None:
        answered = False
        while not self.transaction.lost:
            if self._wire_used_by_others:
                self._wire_used_by_others = False
                await self._recover()
            request = await self.queue.next(self.times.typical_rtt, self.transaction.remaining_quiet, answered)
            answered = False
            if request is None:
                continue
            self._silent_since = self._silent_since or self._clock()
            try:
                outcome = await self.transaction.carry_out(request.command, request.priority == STOP)
            except BaseException:  # the worker is ending: let the caller not wait for ever
                request.fail(NoAnswer())
                raise
            self.exchanged.emit(outcome)
            if not isinstance(outcome, NoAnswer | Silence):
                self._silent_since = None
            if not request.future.done():
                if isinstance(outcome, Fault):
                    outcome.reply_seconds = self.times.last_rtt
                    request.future.set_exception(outcome)
                else:
                    request.future.set_result((outcome, self.times.last_rtt))
                answered = True
            if isinstance(outcome, Silence) and self.reply_rules.expected_reply(request.command).needs_command_end:
                self.transaction.send(self.reply_rules.half_command_end)
                await self.transaction.drain(max(QUIET_TIME, 2.0 * self.times.typical_rtt))
            if isinstance(outcome, NoAnswer | Silence) and not isinstance(outcome, GaveWayToStop):
                await self._write_stop()  # one that waits: the check of a slow mount takes seconds
                await self._recover()
        self._mark_down(f"{self.wire.name} was lost")

    async def _recover(self) -> None:
        """Bring the line into step again; treat the wire as lost after ``REOPEN_SILENCE`` seconds without success."""
        began = self._clock()
        while not self.transaction.lost:
            if await self._resync():
                self._mark_up()
                return
            self._mark_down("the mount does not answer")
            if self._clock() - began > REOPEN_SILENCE:
                self.transaction.connection_lost("mute")
            else:
                await self.transaction.idle(1.0)

    async def _resync(self) -> bool:
        """Drain the wire, then check that the line is in step, several times if need be; return whether it is."""
        attempt = 0
        while attempt < MAX_CHECKS and not self.transaction.lost:
            if self.transaction.stop_is_due:
                await self._write_stop()
            await self.transaction.drain(QUIET_TIME * QUIET_FACTOR**attempt)
            if self.transaction.stop_is_due:
                continue
            if await self.is_in_step():
                return True
            if self.transaction.lost or self.transaction.stop_is_due:
                continue  # a stop has cut off the check
            attempt += 1
            if self.state == "up":
                self._mark_down("the mount does not answer")
            await self._write_stop()  # a mount that is not heard may hear all the same
        return False

    async def is_in_step(self) -> bool:
        """Send the check commands; return whether each gets the right reply, and nothing follows the last reply."""
        self._check_count += 1
        for command in self.reply_rules.resync_commands(self._check_count):
            await asyncio.sleep(self.transaction.remaining_quiet(command))
            outcome = await self.transaction.exchange(command, is_resync=True)
            if isinstance(outcome, GaveWayToStop):
                return True  # the reply to the stop will show whether it is
            if isinstance(outcome, Busy):
                continue  # this is a reply as well
            if isinstance(outcome, Fault) or not self.reply_rules.is_resync_reply(command, outcome):
                return False
        return not await self.transaction.drain(QUIET_TIME) and not self.transaction.stop_is_due

    def _mark_up(self) -> None:
        """Note that the line is in step, and emit ``came_up`` if it was not up before."""
        self._silent_since = None
        if self.state != "up":
            self._state, self.down_cause = "up", ""
            self.came_up.emit(None)

    def _mark_down(self, reason: str) -> None:
        """Fail all waiting requests; until the line is up again, every exchange fails at once."""
        if (self.state, self.down_cause) != ("down", reason):
            self.wire_log.note("mount", reason)
        self._state, self.down_cause = "down", reason
        self.queue.fail_all()
