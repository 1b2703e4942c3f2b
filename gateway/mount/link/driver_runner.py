"""Runs the generators of a driver: sends the commands that they yield and gives the verified replies back to them.

A corrupted byte can leave the form of a reply intact. So only a reply that resembles the previous reply to the same
request is accepted at once. Otherwise the request is repeated until several replies in a row agree: two if the mount
can have moved that far, three if the value seldom changes, and five (three on a slow line) for a position that no motor
can have reached since the last one. If late replies may still arrive, more replies than these must agree. Until then
neither clients nor limits get the new value. A reply that took unusually long does not count.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Generator, Mapping
from typing import Any, TypeVar

from msgspec import Struct

from gateway.astro.spherical import wrap180
from gateway.core.errors import Asleep, Busy, Fault, Garbled, NoAnswer, Refused, Silence
from gateway.core.operations import Operation, Read, Values
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.line import MountLink
from gateway.mount.link.queue import MAX_START_DELAY, MOTION, POSITION, START_TOO_LATE_MESSAGE, STOP
from gateway.mount.link.transaction import COPY_GAP
from gateway.protocols.base.driver import Remark, Schedule, Send, Step, Wait

#: Degrees by which a position may differ from the last position and be accepted at once.
ACCEPTED_STEP = 0.05
#: The highest speed of any mount in degrees a second: 8 on one axis, both axes combined.
MAX_SPEED = 8.0 * math.sqrt(2.0)
#: Degrees by which a latitude (such as the declination) grows at most between two replies in a row.
MAX_LATITUDE_STEP = 2.0
#: Seconds by which a clock may differ from its last reading: it has whole seconds, and replies take time.
CLOCK_TOLERANCE = 1.6
#: A reply after over SLOW_SECONDS on a usually quick line may be old: it is skipped up to SLOW_TRIES times.
SLOW_SECONDS, SLOW_TRIES = 0.5, 3
#: How often a request is sent at most to verify its reply, and how often if the reply was garbled.
MAX_TRIES, GARBLED_TRIES = 9, 3
#: How many replies in a row must agree on a position that no motor can have reached: on a line whose round trips take
#: at most QUICK_REPLY_TIME seconds, and on a slower line.
JUMP_REPLIES, QUICK_REPLY_TIME, SLOW_LINE_JUMP_REPLIES = 5, 0.25, 3
#: Shortest sleep in seconds: timers may fire this much too early.
MIN_SLEEP = 0.001
#: The longest time in seconds that a command waits until no late reply to an earlier, similar command can arrive.
LATE_REPLY_WAIT = 12.0
#: How many late replies to earlier requests are assumed at most: if more replies than that agree, one of them must
#: belong to the present request.
MAX_LATE_REPLIES = 4
#: For how many requests the last reply is stored: limited, because clients may ask for any number of devices.
MAX_LAST_REPLIES = 100
DAY_SECONDS = 86400.0
#: Fields that describe the form of a reply, not its meaning.
_FORM_FIELDS = ("length", "raw")
#: Fields that change with the time of the day.
_TIME_FIELDS = ("time", "sidereal", "hour", "minute", "second")
#: The fields of a reply that are angles on a sphere: each longitude with its latitude.
_LATITUDE_OF = {"ra": "dec", "az": "alt", "longitude": "latitude"}
#: Seconds between two position reads that test whether a hibernating mount was woken: as for an awake mount at rest.
WAKE_TEST_PERIOD = 5.0
_T = TypeVar("_T")


class ReceivedReply(Struct):
    """A reply or a fault that counts as one (silence, no such device), with the loop times of request and arrival."""

    values: Values
    fault: Fault | None
    requested_at: float
    arrived_at: float


class ReplyVerifier:
    """Repeats a request until its replies agree, because a corrupted reply may look valid. ``speed_factor`` is how many
    times faster a simulated mount slews.
    """

    def __init__(self, line: MountLink, clock: Callable[[], float], speed_factor: float = 1.0) -> None:
        self._line, self._clock, self._max_speed = line, clock, MAX_SPEED * speed_factor
        self._late_replies = line.transaction.late_replies
        self._last_replies: dict[tuple[object, ...], ReceivedReply] = {}
        self._latitudes: dict[str, float] = {}

    async def exchange(self, command: Send, priority: int) -> tuple[ReceivedReply, int]:
        """Send a command, and return its verified reply and the number of exchanges needed. Raises Fault."""
        kind = self._line.reply_rules.expected_reply(command).answer_kind
        if kind is None:
            asked = self._clock()
            return ReceivedReply(await self._send_change(command, priority), None, asked, self._clock()), 1
        key = (
            command.command,
            command.include_raw,
            *sorted((name, value) for name, value in command.values.items() if name != "low"),
        )
        agreeing: list[ReceivedReply] = []
        longest = slow = late_count = needed = 0
        times = 0
        while times < MAX_TRIES:
            times += 1
            late_count = max(late_count, self._late_replies.count(command, self._clock()))
            reply = await self._get_reply(command, priority)
            mute = isinstance(reply.fault, Silence)  # which always takes its whole timeout
            if mute and not command.include_raw:
                break  # the driver asked for this answer by ``patience``
            if command.unverified_ok(reply.values) if callable(command.unverified_ok) else command.unverified_ok:
                break
            took = reply.arrived_at - reply.requested_at
            if slow < SLOW_TRIES and not mute and took > SLOW_SECONDS and took > 2.5 * self._line.times.typical_rtt:
                slow += 1
                continue
            if not (agreeing and self._agree(kind, agreeing[-1], reply)):
                agreeing.clear()
            agreeing.append(reply)
            longest = max(longest, len(agreeing))
            needed = self._replies_needed(kind, self._last_replies.get(key), reply, late_count)
            if len(agreeing) >= needed:
                break
        else:
            moves = kind == "position" and longest == 1 and needed <= 2  # only a position may change so fast
            if len(agreeing) < (2 if needed < JUMP_REPLIES else SLOW_LINE_JUMP_REPLIES) and not moves:
                raise Garbled
        self._remember_reply(key, reply)
        self._latitudes |= {name: reply.values[name] for name in _LATITUDE_OF.values() if name in reply.values}
        if reply.fault is not None:
            raise type(reply.fault)(str(reply.fault))  # a copy: a raised exception keeps its callers' frames alive
        return reply, times

    def _remember_reply(self, key: tuple[object, ...], reply: ReceivedReply) -> None:
        """Remember the last reply; if there are too many, forget the oldest."""
        self._last_replies.pop(key, None)
        self._last_replies[key] = reply
        if len(self._last_replies) > MAX_LAST_REPLIES:
            del self._last_replies[next(iter(self._last_replies))]

    async def _send_change(self, command: Send, priority: int) -> Values:
        """Send a command with an unverified reply as soon as no late reply can be taken for its own. Raises Fault.

        A stop never waits: it is repeated until an acknowledgement can only belong to it.
        """
        if priority != STOP:
            try:
                async with asyncio.timeout(MAX_START_DELAY if command.at_once_or_never else LATE_REPLY_WAIT):
                    while (left := self._late_replies.unambiguous_from(command, self._clock()) - self._clock()) > 0:
                        await asyncio.sleep(max(left, MIN_SLEEP))
            except TimeoutError:  # commands like it keep timing out: do not make the client wait for the end of that
                raise NoAnswer from None
            return await self._line.exchange(command, priority)
        times = 0
        while True:
            late_count = self._late_replies.count(command, self._clock())
            answer = await self._line.exchange(command, priority)
            times += 1
            if times > min(late_count, MAX_LATE_REPLIES):
                return answer

    async def _get_reply(self, command: Send, priority: int) -> ReceivedReply:
        """Return a reply; ask again if it is garbled. Raises Garbled if it stays so, NoAnswer if none comes, Busy."""
        for attempt in range(GARBLED_TRIES):
            values: Values = {}
            fault: Fault | None = None
            try:
                values, took = await self._line.timed_exchange(command, priority)
            except Garbled:
                if attempt == GARBLED_TRIES - 1:
                    raise
                continue
            except (NoAnswer, Busy):  # neither is an answer to the request
                raise
            except Fault as fault_reply:
                fault, took = fault_reply.with_traceback(None), fault_reply.reply_seconds
            came = self._clock()
            return ReceivedReply(values, fault, came - took, came)
        raise NoAnswer

    def _replies_needed(self, kind: str, previous: ReceivedReply | None, reply: ReceivedReply, late_count: int) -> int:
        """Return how many replies in a row must agree, including this reply, for it to be accepted."""
        least = min(late_count, MAX_LATE_REPLIES) + 1
        if previous is None:
            return max(2, least)
        if kind != "position":
            return least if self._agree(kind, previous, reply) else max(3, least)
        if previous.values.get("length") != reply.values.get("length"):  # the precision was switched
            return max(2, least)
        moved = self._distance(previous, reply)
        if moved <= ACCEPTED_STEP:
            return least
        if moved <= self._possible_motion(previous, reply):
            return max(2, least)
        return max(JUMP_REPLIES if self._line.times.typical_rtt <= QUICK_REPLY_TIME else SLOW_LINE_JUMP_REPLIES, least)

    def _agree(self, answer_kind: str, before: ReceivedReply, after: ReceivedReply) -> bool:
        """Whether both replies can be correct."""
        if before.fault is not None or after.fault is not None:
            return type(before.fault) is type(after.fault)
        if answer_kind == "position":
            possible = self._possible_motion(before, after)
            return self._distance(before, after, min(MAX_LATITUDE_STEP, possible)) <= possible
        if answer_kind == "clock":
            return _clock_agrees(before, after)
        return before.values == after.values

    def _possible_motion(self, before: ReceivedReply, after: ReceivedReply) -> float:
        """Return the degrees that the mount can have moved between two replies and while the first one arrived."""
        took = min(before.arrived_at - before.requested_at, 2.5 * self._line.times.typical_rtt)
        return ACCEPTED_STEP + self._max_speed * (after.arrived_at - before.arrived_at + took)

    def _distance(self, before: ReceivedReply, after: ReceivedReply, latitude_growth: float = 0.0) -> float:
        """Return the degrees between two replies; infinite if they differ in form. If a reply holds only a
        longitude, the last latitude is assumed to be up to ``latitude_growth`` degrees higher by now.
        """
        if before.fault is not None or after.fault is not None or before.values.keys() != after.values.keys():
            return math.inf
        if before.values.get("length") != after.values.get("length"):
            return math.inf
        total = 0.0
        for name, value in after.values.items():
            if name in _FORM_FIELDS:
                continue
            apart = wrap180(value - before.values[name])
            if name in _LATITUDE_OF:
                latitude = after.values.get(_LATITUDE_OF[name])
                if latitude is None:
                    latitude = min(90.0, abs(self._latitudes.get(_LATITUDE_OF[name], 0.0)) + latitude_growth)
                apart *= math.cos(math.radians(latitude))
            total += apart * apart
        return math.sqrt(total)


def _time_of_day(values: Values) -> float:
    """Return the time of day in a reply, seconds; replies give sidereal time in degrees."""
    if "time" in values:
        return float(values["time"])
    if "sidereal" in values:
        return float(values["sidereal"] * 240.0)
    return float(values["hour"] * 3600 + values["minute"] * 60 + values["second"])


def _clock_agrees(before: ReceivedReply, after: ReceivedReply) -> bool:
    """Whether two readings of a clock fit together; its date may change at midnight only."""
    then, now = _time_of_day(before.values), _time_of_day(after.values)
    drift = (now - then - (after.arrived_at - before.arrived_at) + DAY_SECONDS / 2) % DAY_SECONDS - DAY_SECONDS / 2
    slack = CLOCK_TOLERANCE + (before.arrived_at - before.requested_at) + (after.arrived_at - after.requested_at)
    others = [name for name in after.values if name not in (*_TIME_FIELDS, *_FORM_FIELDS)]
    return abs(drift) <= slack and (now < then or all(before.values.get(n) == after.values[n] for n in others))


class HibernationGate:
    """Decides which commands are sent to a hibernating mount, and marks it as awake when its replies show that.

    Each command that a hibernating mount ignores costs a timeout of seconds. Stops are sent anyway. The position is
    read now and then, because a person may have woken the mount at its keys: a reply that no hibernating mount gives
    ends hibernation. While a wake-up order is pending, every command is sent.
    """

    def __init__(self, context: Context) -> None:
        self._driver, self._clock, self._wanted = context.driver, context.now, context.wanted
        self._next_read_at = 0.0

    def note_hibernation(self) -> None:
        """Note that the mount was ordered to hibernate: its position is not read for ``WAKE_TEST_PERIOD`` seconds."""
        self._next_read_at = self._clock() + WAKE_TEST_PERIOD

    def allow_next_read(self) -> None:
        """Allow the next read of the position: the line was lost, and the mount may have been switched off and on."""
        self._next_read_at = 0.0

    @property
    def refuses_reads(self) -> bool:
        """Whether a read would be refused now."""
        return self._driver.asleep and self._clock() < self._next_read_at and not self._wanted.wake_up_pending

    def admit(self, command: Send, priority: int) -> None:
        """Check that a hibernating mount may be sent a command; a position read holds back the next. Raises Asleep."""
        if priority == STOP or self._answers_while_asleep(command) or self._wanted.wake_up_pending:
            return
        if self.refuses_reads or priority != POSITION:
            raise Asleep
        self._next_read_at = self._clock() + WAKE_TEST_PERIOD

    def _answers_while_asleep(self, command: Send) -> bool:
        return bool(self._driver.protocol.commands[command.command].allowed_while_asleep)

    def note_reply(self, command: Send) -> None:
        """Note a reply of a mount that was thought to hibernate; most replies show that it is awake."""
        if not self._answers_while_asleep(command):
            self._driver.asleep = False


class DriverRunner:
    """Runs the generators of the driver: ``perform`` for an operation with a priority, ``drive`` for any generator.

    ``may_move`` is emitted before a command that may set the mount moving, ``scheduled`` with an operation that the
    driver requests for later, ``driver_failed`` when a defect of the driver leaves it unknown what moves now.
    """

    def __init__(self, context: Context, verifier: ReplyVerifier, gate: HibernationGate) -> None:
        self._context, self._verifier, self._gate = context, verifier, gate
        self.may_move: Signal[None] = Signal()
        self.scheduled: Signal[Schedule] = Signal()
        self.driver_failed: Signal[None] = Signal()
        #: How many exchanges the last operation needed. If it read a position, the loop time of the first request for
        #: that position: the position is no older.
        self.exchange_count, self.requested_at = 0, 0.0
        #: The loop time at which the last operation's first command was written.
        self.first_sent_at = 0.0

    async def perform(self, operation: Operation[_T], priority: int) -> _T:
        """Have the driver carry out an operation and return its answer. Raises Fault."""
        steps = self._context.driver.perform(operation)
        return await self.drive(steps, priority, changes_mount=not isinstance(operation, Read))

    async def drive(
        self,
        steps: Generator[Step, Any, _T],
        priority: int,
        ordered_at: float | None = None,
        check_start: Callable[[], None] = lambda: None,
        changes_mount: bool = True,
    ) -> _T:
        """Run a generator of the driver and return its value. Raises Fault; Busy if it starts more than
        ``MAX_START_DELAY`` seconds after ``ordered_at`` (loop time), or if one exchange delays the start of a motion by
        hand by more than that. ``check_start`` is called before a motion by hand starts, and may raise a Fault.
        ``changes_mount``: readings from before the end of the operation are outdated.
        """
        now, driver, line = self._context.now, self._context.driver, self._context.link.transaction
        self.exchange_count = exchanges = 0
        self._context.cache.order_count += changes_mount
        asked, sent = list[float](), list[float]()
        late = ordered_at is not None and now() - ordered_at > MAX_START_DELAY
        if priority == MOTION:
            self.may_move.emit(None)

        async def exchange(command: Send) -> Values:
            nonlocal exchanges, late
            if late and (command.at_once_or_never or not exchanges):
                raise Busy(START_TOO_LATE_MESSAGE)
            if command.at_once_or_never:
                check_start()
            began = now()
            if driver.asleep:
                self._gate.admit(command, priority)
            reply, times = await self._verifier.exchange(command, priority)
            driver.sent_at, driver.next_send_at = line.written_at, line.heard_at + COPY_GAP
            sent.append(driver.sent_at)
            late = late or now() - began > MAX_START_DELAY
            if driver.asleep:
                self._gate.note_reply(command)
            exchanges += times
            asked.append(reply.requested_at)
            return reply.values

        try:
            value = await run_driver(steps, exchange, self.scheduled.emit, self._context.remark)
            self.exchange_count, self.requested_at = exchanges, min(asked[-driver.position_reads :], default=math.inf)
            self.first_sent_at = sent[0] if sent else now()
            return value
        except (Fault, asyncio.CancelledError):
            raise
        except Exception as error:  # a defect in a driver may fail an operation, but never the gateway
            self._context.note(f"internal error, please report it: {error!r}")
            if priority != STOP:  # a failed stop is retried anyway
                self.driver_failed.emit(None)
            raise Refused(f"Internal error: {error!r}") from error
        finally:
            self._context.cache.order_count += changes_mount


async def run_driver(
    steps: Generator[Step, Any, _T],
    exchange: Callable[[Send], Awaitable[Mapping[str, object]]],
    on_schedule: Callable[[Schedule], object],
    on_remark: Callable[[Remark], object] = lambda said: None,
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
                on_remark(step)
            else:
                on_schedule(step)
    except StopIteration as end:
        value: _T = end.value
        return value
    finally:
        steps.close()
