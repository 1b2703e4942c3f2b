"""One exchange on an open line: a request, its reply, and whether that reply can belong to the request.

A reply counts only if it has the exact form and nothing follows it: of two replies, one belongs to another request.
After a disturbance the line is drained, and checked until it is in step; otherwise every later reply would be taken for
the reply to the request before. Some converters between gateway and mount reorder the data. Therefore a request that
timed out stays open until its reply would be later than any ever observed: nothing is accepted that could be its reply.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Collection

from gateway.core.errors import Busy, Fault, Garbled, NoAnswer, Silence
from gateway.core.operations import Values
from gateway.core.signals import Signal
from gateway.core.waiting import TimedEvent
from gateway.core.wire_log import WireLog
from gateway.mount.link.queue import RequestQueue
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import REPLY_END_GAP, ExpectedReply, ReplyRules
from gateway.transport.wires import Transport

#: Seconds of quiet that end a disturbance.
QUIET_TIME = 0.15
#: Seconds after which draining gives up, even if the line is still not quiet.
DRAIN_TIMEOUT = 5.0
#: If a line duplicates a reply, the copy follows within COPY_GAP seconds. Until then the gateway sends no request to
#: which the copy could be the reply, if the copy is an acknowledgement only or if stray bytes came within the last
#: STRAY_BYTES_TIME seconds.
COPY_GAP, STRAY_BYTES_TIME = 0.05, 300.0
#: Seconds after a request from which arriving bytes are no reply to it: the gateway no longer waits for them to end.
BABBLE_TIME = 3.0
#: A reply that is an acknowledgement only counts when nothing has followed it for this many seconds.
SETTLE_TIME = 0.02
#: A stop waits for the exchange on the wire until that lasts this much longer than usual, seconds.
STOP_WAIT = 0.3
#: Seconds after a stop was written without waiting for replies at which it is written again: the mount may have taken
#: it for the end of another command, or not have listened.
STOP_RETRY_DELAYS = (0.5, 1.5, 2.5, 3.5)
#: Seconds beyond the usual reply time that the first reply after a stop may take, if stops get no reply: that first
#: reply shows whether the mount is listening.
AFTER_STOP_GRACE = 1.0
#: Seconds that a long operation of the mount may take before the requests that wait behind it are refused.
BUSY_DELAY = 1.0
#: Seconds after its timeout within which the reply to a request may still arrive.
LATE_REPLY_TIME = 2.5
#: The timeout of a position read is TIMEOUT_FACTOR times the typical reply time, at least SHORTEST_TIMEOUT seconds.
#: The protocol's timeout applies until MIN_REPLY_COUNT replies have come.
TIMEOUT_FACTOR, SHORTEST_TIMEOUT, MIN_REPLY_COUNT = 8.0, 1.2, 20
#: A late reply raises the timeouts to LATE_FACTOR times its time, unless it took over MAX_COUNTED_LATE seconds.
LATE_FACTOR, MAX_COUNTED_LATE = 1.5, 6.0
#: The first reply sets the typical time, up to this many seconds.
MAX_FIRST_REPLY_TIME = 1.0
#: Smoothing of the typical time: weight of the newest, which is cut to MAX_GROWTH averages plus RTT_MARGIN seconds.
RTT_WEIGHT, MAX_GROWTH, RTT_MARGIN = 0.2, 3.0, 0.01

#: The fields of a reply, or the fault that it reports; and the same together with the reply's length in bytes.
Answer = Values | Fault
Taken = tuple[Answer, int]


class ReplyTimes:
    """The mount's reply times: ``typical_rtt`` is the average round-trip time in seconds, ``last_rtt`` that of the last
    reply (or the time until the gateway gave up), ``reply_count`` the number of replies.
    """

    def __init__(self) -> None:
        self.typical_rtt, self.last_rtt, self.reply_count = 0.02, 0.0, 0
        #: Seconds that the last late reply took; 0 if there was none.
        self._last_late_time = 0.0

    def add_reply(self, reply_time: float, elapsed: float, in_average: bool) -> None:
        """Record a reply: the seconds from the request to its last byte (``reply_time``) and to its acceptance
        (``elapsed``). ``in_average`` is False for long operations and empty replies, which do not count in the average.
        """
        self.last_rtt = reply_time
        self.reply_count += 1
        if not in_average:
            return
        self.typical_rtt += RTT_WEIGHT * (min(elapsed, MAX_GROWTH * self.typical_rtt + RTT_MARGIN) - self.typical_rtt)
        if self.reply_count == 1:
            self.typical_rtt = max(self.typical_rtt, min(elapsed, MAX_FIRST_REPLY_TIME))

    def record_late_reply(self, reply_time: float) -> None:
        """Record a reply that arrived after its timeout; after more than ``MAX_COUNTED_LATE`` seconds it is ignored."""
        self._last_late_time = reply_time if reply_time <= MAX_COUNTED_LATE else self._last_late_time

    def timeout(self, protocol_timeout: float, is_position: bool) -> float:
        """Return the timeout of a reply in seconds: the protocol's, or longer after late replies. That of a position is
        shorter, because positions are polled: a lost reply is then noticed early and requested again.
        """
        protocol_timeout = max(protocol_timeout, LATE_FACTOR * self._last_late_time)
        if not is_position or self.reply_count < MIN_REPLY_COUNT:
            return protocol_timeout
        return min(protocol_timeout, max(SHORTEST_TIMEOUT, TIMEOUT_FACTOR * self.typical_rtt))


class LateReplies:
    """Requests that timed out and may still be answered. ``ambiguous_with`` returns whether the reply to
    one of two commands could be taken for the reply to the other.
    """

    def __init__(self, ambiguous_with: Callable[[Send, Send], bool]) -> None:
        self._ambiguous_with = ambiguous_with
        self._open_requests: list[tuple[float, Send]] = []

    def add(self, command: Send, expires_at: float) -> None:
        """Expect the late reply to a request that timed out, until this loop time in seconds."""
        self._open_requests.append((expires_at, command))

    def unambiguous_from(self, command: Send, now: float) -> float:
        """Return the loop time from which no late reply can be mistaken for the reply to this command."""
        return max([end for end, _ in self._ambiguous_requests(command, now)], default=now)

    def count(self, command: Send, now: float) -> int:
        """Return how many late replies could be taken for the reply to this command; the one after these is right."""
        return len(self._ambiguous_requests(command, now))

    def _ambiguous_requests(self, command: Send, now: float) -> list[tuple[float, Send]]:
        if not self._open_requests:
            return []
        self._open_requests = [(end, other) for end, other in self._open_requests if end > now]
        return [(end, other) for end, other in self._open_requests if self._ambiguous_with(command, other)]


class GaveWayToStop(NoAnswer):
    """The gateway gave up waiting for a reply because a stop is due, on a wire that drops replies to old requests."""


class Transaction:
    """Carries out exchanges over a wire until the wire is ``lost``.

    A stop that waits in the ``queue`` may be sent during a long operation of the mount, shortens the pause that some
    mounts need after a command, and cuts off any other exchange that lasts too long.
    """

    def __init__(self, wire: Transport, queue: RequestQueue, reply_rules: ReplyRules, wire_log: WireLog) -> None:
        self.wire, self._queue = wire, queue
        self.reply_rules, self.wire_log = reply_rules, wire_log
        self.lost = False
        self.wire_lost: Signal[None] = Signal()
        #: Whether the line was lost during an exchange, so that the mount may have received half a command.
        self.half_command_sent = False
        self.last_request = b""
        #: Whether a long operation is under way, whether it takes so long that other requests are refused, and the loop
        #: time at which the last one ended.
        self.is_long_op, self.refuses_others, self.long_op_ended_at = False, False, -1e9
        #: Loop time of the last write; long ago if there was none.
        self.written_at = -1e9
        self.times = ReplyTimes()
        self.late_replies = LateReplies(reply_rules.ambiguous_with)
        self._clock = asyncio.get_running_loop().time
        #: Whether any byte ever arrived; the last request without a proper reply, and the bytes that came instead.
        self.ever_answered = False
        self.last_failed_exchange = b"", b""
        self._buffer, self._bytes_event = b"", TimedEvent()
        #: Loop times of the last byte, and of the last byte that belonged to no reply.
        self.heard_at = self._stray_at = -1e9
        self._last_command: Send | None = None
        self._stops_sent = 0
        #: Loop time of the last request whose reply is still missing.
        self._unanswered_since: float | None = None
        self._stop_is_waiting = self._pause_cut_short = False
        #: Whether the last exchange was a stop that gets no reply, so that the mount may not be listening.
        self._stop_unanswered = False
        #: Loop time from which the exchange under way is cut off for a stop that is due.
        self._gives_way_at = math.inf
        #: Loop time at which a stop is to be written, whatever else happens on the line.
        self._stop_due_at = math.inf
        #: The stop commands that were written without waiting for replies, cleared by the next exchange (not by checks
        #: of the line); and the loop time at which the newest of them was first written.
        self.written_stops: set[bytes] = set()
        self._stop_first_written_at = -1e9
        self._opening_count = 0

    def open_callbacks(self) -> tuple[Callable[[bytes], None], Callable[[str], None]]:
        """Return the callbacks (on_data, on_lost) for opening the wire; those of earlier openings become inactive."""
        self._opening_count += 1
        opening, self.lost = self._opening_count, False

        def on_data(data: bytes) -> None:
            if opening == self._opening_count:
                self._receive(data)

        def on_lost(reason: str) -> None:
            if opening == self._opening_count:
                self.connection_lost(reason)

        return on_data, on_lost

    def _receive(self, data: bytes) -> None:
        self.wire_log.put("mount", "raw", data)
        self._buffer = (self._buffer + data)[-4096:]
        self.ever_answered = True
        self.heard_at = self._clock()
        self._bytes_event.set()

    def connection_lost(self, reason: str) -> None:
        """Note that the wire is lost, and end the exchange under way; further calls change nothing."""
        if not self.lost:
            self.wire_log.put("mount", "v", note=reason)
            self.wire_lost.emit(None)
        self.lost = True
        self._bytes_event.set()
        self._queue.wake()

    def wake(self, for_stop: bool) -> None:
        """Wake the exchange under way if a stop waits (``for_stop``), or if it is a long operation of the mount."""
        self._stop_is_waiting |= for_stop
        if for_stop:
            self._stop_due_at = min(self._stop_due_at, self._clock())
        if self.is_long_op or for_stop:
            self._bytes_event.set()

    @property
    def stop_is_due(self) -> bool:
        """Whether a stop is to be written now, without waiting for replies of the mount."""
        return self._clock() >= self._stop_due_at and not self.lost

    def note_stop_written(self, commands: Collection[bytes]) -> None:
        """Note that these commands of the due stop were written, and calculate when they must be written again."""
        now, self._stop_due_at = self._clock(), math.inf
        if not self.written_stops.issuperset(commands):
            self._stop_first_written_at = now
        self.written_stops.update(commands)
        if commands:
            again = (self._stop_first_written_at + after for after in STOP_RETRY_DELAYS)
            self._stop_due_at = next((at for at in again if at > now), math.inf)

    @property
    def _must_give_way(self) -> bool:
        return self.stop_is_due and self._clock() >= self._gives_way_at

    def send(self, request: bytes) -> bool:
        """Write to the wire; return False if it was lost."""
        self.wire_log.put("mount", ">", request)
        self.last_request = request
        try:
            self.wire.write(request)
        except Exception as error:  # the port was lost during the write; drivers raise various exceptions
            self.connection_lost(str(error))
            return False
        return True

    # --- one exchange -----------------------------------------------------------------------------------------------

    def remaining_quiet(self, command: Send) -> float:
        """Return for how many more seconds the line must be quiet, so that no late bytes pass for a command's reply."""
        now = self._clock()
        left = self.heard_at + COPY_GAP - now
        if left <= 1e-6 or now > self.written_at + BABBLE_TIME:
            return 0.0
        if not self._unknown_bytes:
            if self._last_command is None or not self.reply_rules.ambiguous_with(self._last_command, command):
                return 0.0
            if now > self._stray_at + STRAY_BYTES_TIME and not self.reply_rules.expected_reply(command).unterminated:
                return 0.0
        return left

    async def carry_out(self, command: Send, is_stop: bool) -> Answer:
        """Carry out an exchange. If the pause before it was cut short, a stop is sent twice: the first may be lost."""
        hurried, self._pause_cut_short = self._pause_cut_short, False
        if not is_stop:
            self.written_stops.clear()
        # A stop is cut off, too, so that all of it is written; but not when it is sent again after that.
        self._stop_due_at = self._clock() if is_stop and not self.written_stops else math.inf
        try:
            outcome = await self.exchange(command, full_pause=hurried, is_stop=is_stop)
            if not isinstance(outcome, NoAnswer):
                self.written_stops.clear()
            if hurried and is_stop and self.reply_rules.expected_reply(command).delay_after:
                outcome = await self.exchange(
                    command, is_stop=True
                )  # without the pause the mount may have missed the first
            return outcome
        finally:
            self.refuses_others = False

    async def exchange(
        self, command: Send, full_pause: bool = False, is_resync: bool = False, is_stop: bool = False
    ) -> Answer:
        """Send a request and return the fields of its reply, or the Fault that came instead. ``full_pause``: a stop
        does not cut short the pause after the exchange. ``is_resync``: the reply gets the protocol's full timeout.
        ``is_stop``: the request is a stop, and does not wait until the line is quiet.
        """
        try:
            request = self.reply_rules.encode(command)
        except Fault as fault:
            return fault
        expected = self.reply_rules.expected_reply(command)
        settle = (
            COPY_GAP if is_stop and self.remaining_quiet(command) else SETTLE_TIME
        )  # a request that skipped the quiet must wait after the reply
        self.discard("unsolicited")
        self._bytes_event.clear()
        self._last_command = command
        began = self.written_at = self._clock()
        self.is_long_op, self._stops_sent, self._stop_is_waiting = command.long, 0, False
        newest_only = getattr(self.wire, "newest_only", False)
        waits = expected.max_stop_wait if newest_only else self.times.typical_rtt + STOP_WAIT
        self._gives_way_at = math.inf if command.long or (newest_only and is_stop) else began + waits
        taken = await self._await_reply(command, expected, began, settle, is_resync) if self.send(request) else None
        self._stop_unanswered = is_stop and expected.silent
        self.is_long_op, self.long_op_ended_at = False, self._clock() if command.long else self.long_op_ended_at
        if taken is None:
            gave_way = newest_only and self._must_give_way
            return GaveWayToStop() if gave_way else self._no_reply_fault(command, expected, began)
        outcome, length = taken
        if len(self._buffer) > length + self._stops_sent:  # each stop sent meanwhile may have been refused with a byte
            outcome = Garbled()
        if isinstance(outcome, Garbled):
            self._expect_late_reply(command, expected, began)
            self.discard("garbled")
            return outcome
        if command.include_raw and isinstance(outcome, dict):
            outcome = {**outcome, "raw": self._buffer[:length].rstrip(self.reply_rules.ignored_bytes)}
        self._consume(length)
        self.times.add_reply(self.heard_at - began, self._clock() - began, in_average=bool(length) and not command.long)
        if expected.delay_after and await self._pause(expected.delay_after, full_pause):
            outcome = self._objection(command) or outcome
        return outcome

    def _send_unanswered(self, command: Send) -> bool | None:
        """Send a command if it needs no reply, and return whether it was sent; return None if it needs a reply."""
        return self.send(self.reply_rules.encode(command)) if self.reply_rules.expected_reply(command).silent else None

    async def _pause(self, seconds: float, in_full: bool) -> bool:
        """Pause after a command without a reply. Return False if a stop cuts it short, which ``in_full`` prevents."""
        until = self._clock() + seconds
        while not self.lost and (left := until - self._clock()) > 0:
            if not in_full and self._queue.has_waiting_stop:
                self._pause_cut_short = True
                return False
            await self._queue.wait_for_change_within(left)
        return True

    async def _await_reply(
        self, command: Send, expected: ExpectedReply, started_at: float, settle_time: float, is_resync: bool
    ) -> Taken | None:
        """Return the reply and its length when it is complete; None if it is late, a stop is due, or the wire was lost.

        A reply without a terminator is complete when nothing follows it for ``settle_time`` seconds.
        """
        position = expected.answer_kind == "position" and not is_resync
        longest = command.timeout or self.times.timeout(expected.timeout, position)
        if self._stop_unanswered and command.timeout is None:
            longest = min(longest, self.times.typical_rtt + AFTER_STOP_GRACE)
        deadline, busy_at = started_at + longest, started_at + BUSY_DELAY
        while not self.lost:
            now = self._clock()
            self._bytes_event.clear()
            if command.long:
                self.refuses_others = self.refuses_others or now >= busy_at
                self._stops_sent += self._queue.send_stops_while_busy(self.refuses_others, self._send_unanswered)
            taken = self._parsed_reply(command) if self._buffer or expected.silent else None
            if taken is not None and self._stops_sent and isinstance(taken[0], Busy):
                self._stops_sent -= 1  # the busy reply to a stop; nothing moves during a long operation
                self._consume(taken[1], "busy: the mount refused the stop")
                self._bytes_event.set()
            elif taken is not None:
                if taken[1] and expected.unterminated and not self._stop_is_waiting:
                    alone = max(REPLY_END_GAP, 2.0 * self.times.typical_rtt)
                    ambiguous = self._buffer[: taken[1]] in expected.ambiguous_replies
                    if await self._bytes_event.wait_within(max(settle_time, alone if ambiguous else 0.0)):
                        taken = self._parsed_reply(command)
                if taken is not None:  # else it was the beginning of a longer reply
                    return taken
            elif now >= deadline or self._must_give_way:
                return None
            nearer = [busy_at] if command.long else []
            cut = max(self._gives_way_at, self._stop_due_at)
            await self._bytes_event.wait_within(min(at for at in (deadline, cut, *nearer) if at > now) - now)
        return None

    def _no_reply_fault(self, command: Send, expected: ExpectedReply, started_at: float) -> Fault:
        self.times.last_rtt = self._clock() - started_at
        if self.lost:
            self.half_command_sent = True
        elif command.timeout is not None and not command.long and not self._unknown_bytes and not self._must_give_way:
            return Silence()
        self._expect_late_reply(command, expected, started_at)
        half = bool(self._unknown_bytes)
        self.discard("no complete answer")
        return Garbled() if half and command.timeout is not None else NoAnswer()

    def _expect_late_reply(self, command: Send, expected: ExpectedReply, started_at: float) -> None:
        """Note that the reply to a request may still arrive."""
        self.late_replies.add(command, started_at + max(expected.timeout, command.timeout or 0.0) + LATE_REPLY_TIME)
        self._unanswered_since = started_at
        self.last_failed_exchange = self.last_request, self._buffer

    def _objection(self, command: Send) -> Fault | None:
        """Return the Fault with which the mount objected to a command that has no reply; None if it did not."""
        taken = self._parsed_reply(command) if self._buffer else None
        if taken is None or not isinstance(taken[0], Fault):
            return None
        self._consume(taken[1])
        return taken[0]

    def _parsed_reply(self, command: Send) -> Taken | None:
        """Return the reply, None if it is incomplete. Bytes on which the parser fails count as a garbled reply."""
        try:
            return self.reply_rules.parse_reply(command, self._buffer)
        except Exception:  # a parser's defect must not end the line
            return Garbled(), len(self._buffer)

    def _consume(self, length: int, note: str = "") -> None:
        self.wire_log.put("mount", "<", self._buffer[:length], note)
        self._buffer = self._buffer[length:]

    def discard(self, reason: str) -> None:
        if self._unknown_bytes:
            self._stray_at = self._clock()
            self._consume(len(self._buffer), f"dropped: {reason}")
        self._buffer = b""

    @property
    def _unknown_bytes(self) -> bytes:
        """The received bytes that belong to no reply, without the padding that some mounts send around replies."""
        return self._buffer.strip(self.reply_rules.ignored_bytes)

    async def idle(self, seconds: float) -> None:
        """Wait for some seconds, but not longer than until a stop is due."""
        until = self._clock() + seconds
        while not self.lost and not self.stop_is_due and (left := until - self._clock()) > 1e-6:
            self._bytes_event.clear()
            await self._bytes_event.wait_within(min(left, self._stop_due_at - self._clock()))

    async def wait_for_any_byte(self, seconds: float) -> None:
        """Wait until any byte arrives, but no longer than ``seconds``."""
        heard, until = self.heard_at, self._clock() + seconds
        while not self.lost and self.heard_at == heard and (left := until - self._clock()) > 1e-6:
            self._bytes_event.clear()
            await self._bytes_event.wait_within(left)

    async def drain(self, quiet_time: float) -> bool:
        """Wait until the wire is quiet for ``quiet_time`` seconds, a stop is due, the wire is lost, or `DRAIN_TIMEOUT`
        is over. Drop the received bytes; return whether there were any besides ``ignored_bytes``.
        """
        give_up = self._clock() + DRAIN_TIMEOUT
        while not self.lost and not self.stop_is_due and self._clock() < give_up:
            left = max(self.heard_at, self.written_at) + quiet_time - self._clock()
            self._bytes_event.clear()
            if left <= 1e-6:
                break
            await self._bytes_event.wait_within(min(left, self._stop_due_at - self._clock()))
        anything = bool(self._unknown_bytes)
        if anything and self._unanswered_since is not None:
            self.times.record_late_reply(self.heard_at - self._unanswered_since)
        self._unanswered_since = None
        self.discard("drained")
        return anything
