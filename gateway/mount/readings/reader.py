"""All reads of the mount: fresh answers come from the cache, and simultaneous requests share one exchange.

The limits are checked with every reading before any client gets it. A position that the mount does not report is
calculated from another. Clients get positions extrapolated to the moment of the reply, which is the same for both
angles and for all replies within 50 ms. A position that was requested before the mount acknowledged the last motion
order or stop is not used. Clients of the mount's own protocol get the mount's replies unchanged, unless they have set
another site or clock.
"""

from __future__ import annotations

import asyncio
from math import inf
from typing import TypeVar, cast

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, NoAnswer, NoDevice, Silence, Unsupported
from gateway.core.motion_kinds import GOTOS
from gateway.core.signals import Signal
from gateway.core.waiting import mark_exception_retrieved, result_of, shared_result
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import POSITION, READ
from gateway.mount.motion.run_on import TimedPosition
from gateway.mount.motion.wanted import Slew
from gateway.mount.presence import ProgramId
from gateway.mount.readings.cache import MAX_STALE_AGE, NATIVE_AGE, NOT_CACHED, CachedAnswer, Kind, Reading, angles_of
from gateway.mount.readings.extrapolation import MAX_BACKWARD_TIME, MIN_GAP, extrapolation_of, is_equatorial, predict
from gateway.mount.site.readers import SiteView

_T = TypeVar("_T")
#: The reads of a position.
POSITION_READS: tuple[Kind, ...] = (op.Position, op.HorizontalPosition, op.AxisPosition)
#: Seconds for which replies to clients use the same extrapolated position.
POSITION_REUSE_TIME = MAX_BACKWARD_TIME
#: The status that clients get if the mount has never reported its status.
UNKNOWN_STATUS = op.Status(tracking=op.Tracking.OFF, aligned=False, equatorial=False)
#: Seconds between two checks whether the mount has begun to move.
MOTION_CHECK_PERIOD = 0.2
#: The longest time in seconds that a client waits for the end of a goto to be reported, and for the first reply.
GOTO_END_WAIT, FIRST_REPLY_WAIT = 2.0, 2.0
#: Seconds that a client waits for a new answer before it gets the last one, while the mount is at rest and while it
#: moves. MAX_READ_TRIES: how often the gateway asks the mount if orders keep outdating its replies.
ANSWER_TIMEOUT, ANSWER_TIMEOUT_MOVING, MAX_READ_TRIES = 2.5, 3.2, 3
#: Degrees: a goto that ends farther from its goal counts as missed.
GOAL_TOLERANCE = 0.5


class Reader:
    """Reads for clients: ``peek`` returns a cached answer, and ``answer`` asks the mount, within a timeout. Reads for
    the gateway are not extrapolated: ``read`` uses the cache if possible, ``read_now`` always asks the mount.

    Signals: ``position_read``, ``axes_read`` and ``status_read`` with each reading; ``position_failed`` if one fails;
    ``goto_over`` when the mount reports the end of a goto, and ``goto_missed`` with a message if it missed its goal.
    """

    def __init__(self, context: Context, runner: DriverRunner) -> None:
        self._context, self._driver, self._clock, self._link, self._cache = (
            context, context.driver, context.now, context.link, context.cache)  # fmt: skip
        self._wanted, self._movement, self._astrometry = context.wanted, context.movement, context.astrometry
        self._runner = runner
        #: The reads in progress: by kind, or by native request and the number of orders before it.
        self._shared_tasks: dict[object, asyncio.Task[object]] = {}
        #: By kind of read, the number of exchanges that the last read took.
        self.exchange_counts: dict[Kind, int] = {}
        #: The loop time to which positions in replies to clients are extrapolated.
        self._extrapolated_to = -1e9
        #: The value of ``may_move.count`` at the last stop; -1 after one that may not have ended every motion.
        self._motion_count_at_stop = 0
        #: Whether clients get the last known position because the mount has not replied in time.
        self.gives_last_position = False
        #: By kind, for the last position given without extrapolation: the loop times of its reading and of the answer.
        self._given_positions: dict[Kind, tuple[float, float]] = {}
        self.position_read: Signal[op.Equatorial] = Signal()
        self.axes_read: Signal[op.Horizontal] = Signal()
        self.status_read: Signal[op.Status] = Signal()
        self.position_failed: Signal[None] = Signal()
        self.goto_over: Signal[None] = Signal()
        self.goto_missed: Signal[str] = Signal()

    def latest_position(self) -> TimedPosition | None:
        """Return the last position that the mount has reported, however old; None before the first."""
        last = self._cache.entries.get(op.Position)
        if last is None or last.reading is None:
            return None
        return TimedPosition(last.reading.completed_at, last.asked_at, last.value)

    # --- answers from the cache -------------------------------------------------------------------------------------

    def fresh_reading(self, kind: Kind) -> object:
        """Return the last answer if it is fresh, else NOT_CACHED. The cache notes that this kind is polled."""
        run_on = self._context.run_on.current
        if kind is op.Slewing and (self._wanted.goto_pending or (run_on is not None and run_on.goto)):
            return True
        return self._cache.fresh_answer(kind, self._clock())

    def peek(self, kind: Kind) -> object:
        """Return the answer to a client's read if it is cached; NOT_CACHED if it must be requested."""
        value = self.fresh_reading(kind)
        if kind not in POSITION_READS:
            return value
        if (source := self.source_kind_of(kind)) is not None:
            return self._convert_to(kind, self.peek(source))
        return NOT_CACHED if value is NOT_CACHED else self._position_for_client(kind, self._cache.entries[kind])

    def _position_for_client(self, kind: Kind, entry: CachedAnswer) -> object:
        """Return a reported position, extrapolated if the mount moves; NOT_CACHED if the mount must be asked."""
        if entry.reading is None or entry.forgotten or entry.asked_at < self._cache.outdated_before:
            return NOT_CACHED
        if not self._is_moving:
            return entry.value
        if not any(extrapolation_of(self._context, kind, entry).rates) and self._was_given_before(
            kind, entry.reading.completed_at
        ):
            return NOT_CACHED  # no rate is known: ask the moving mount instead of repeating the value
        return self._position_at(kind, entry, self._extrapolation_moment())

    def _was_given_before(self, kind: Kind, completed_at: float) -> bool:
        """Whether a client got this reading more than ``MIN_GAP`` seconds ago. ``completed_at``: its loop time. If no
        client got it before, record that one gets it now.
        """
        now = self._clock()
        reading, at = self._given_positions.get(kind, (0.0, 0.0))
        if reading != completed_at:
            self._given_positions[kind] = completed_at, now
            return False
        return now - max(at, completed_at) > MIN_GAP

    def peek_native(self, operation: op.NativeRequest, program: ProgramId) -> bytes:
        """Return the cached reply of the mount to a program; NOT_CACHED if it must be requested."""
        reply: bytes = self._cache.native_reply(operation, self._clock())
        return NOT_CACHED if isinstance(reply, Fault) or self._is_overridden(operation, program) else reply

    def last_answer(self, kind: Kind) -> object:
        """Return the answer that a client gets if the mount does not reply in time; NOT_CACHED if there is none."""
        if kind is op.Slewing:
            return self._movement.slewing or self._wanted.goto_pending or self._context.run_on.is_after_goto
        if kind is op.GetStatus:
            return self._cache.last_value(kind) or UNKNOWN_STATUS
        entry = self._cache.entries.get(kind)
        source = self.source_kind_of(kind) or (op.Position if kind is op.HorizontalPosition else None)
        if entry is None or entry.reading is None:
            return NOT_CACHED if source is None else self._convert_to(kind, self.last_answer(source))
        if entry.asked_at < self._cache.outdated_before or self._clock() - entry.reading.completed_at > MAX_STALE_AGE:
            return NOT_CACHED
        if not self.gives_last_position:
            self.gives_last_position = True
            self._context.note(
                f"the mount has not replied in time: programs get its last position, up to {MAX_STALE_AGE:.0f} s old"
            )
        return self._position_at(kind, entry, self._clock()) if self._is_moving else entry.value

    def fresh_until(self, kinds: list[Kind]) -> float:
        """Return the loop time until which the last answers may be given again."""
        positions = [kind for kind in kinds if kind in POSITION_READS]
        sources = [source for kind in positions if (source := self.source_kind_of(kind)) is not None]
        until = self._cache.fresh_until([*kinds, *sources])
        return min(until, self._extrapolated_to + POSITION_REUSE_TIME) if positions and self._is_moving else until

    @property
    def _is_moving(self) -> bool:
        return self._movement.any_motion or self._clock() < self._movement.moved_by_others_until

    def _extrapolation_moment(self) -> float:
        """Return the loop time to which positions are extrapolated. A new time makes earlier answers outdated."""
        now = self._clock()
        if now - self._extrapolated_to >= POSITION_REUSE_TIME:
            self._extrapolated_to = now
            self._cache.version += 1
        return self._extrapolated_to

    def _position_at(self, kind: Kind, entry: CachedAnswer, moment: float) -> object:
        """Return the position of a moving mount, extrapolated to this loop time."""
        return type(entry.value)(*predict(extrapolation_of(self._context, kind, entry), moment))

    def source_kind_of(self, kind: Kind) -> Kind | None:
        """Return the kind of position from which this kind is calculated; None if this kind is read. A mount that
        needs two requests per position is asked for only one kind while it moves.
        """
        if kind is op.HorizontalPosition and self._movement.any_motion and self._driver.position_reads > 1:
            return op.Position
        entry = self._cache.entries.get(kind)
        return None if entry is None else entry.from_kind

    def _convert_to(self, kind: Kind, position: object) -> object:
        """Convert an equatorial position to this kind by the present site and time; NOT_CACHED without a site."""
        if not isinstance(position, op.Equatorial):
            return position
        try:
            if kind is op.HorizontalPosition:
                return self._astrometry.horizontal(position)
            return self._astrometry.axes_of(position, on_wedge=not self._driver.german)
        except Unsupported:
            return NOT_CACHED

    def _is_overridden(self, operation: op.NativeRequest, program: ProgramId) -> bool:
        """Whether the request reads a site or clock that this program has set differently from the mount's."""
        if operation.keep not in ("clock", "site"):
            return False
        read = SiteView(self._context.site_clock, program)
        return read.has_own_clock() if operation.keep == "clock" else read.has_own_site()

    # --- what outdates positions ------------------------------------------------------------------------------------

    def note_acknowledged(self, operation: op.Operation, moved_by_others: bool) -> None:
        """Mark positions as outdated if the acknowledged operation changes the mount's motion or coordinates.
        ``moved_by_others``: the position shows a motion that the gateway has not ordered.
        """
        moves = self._movement.any_motion
        if isinstance(operation, op.AbortMotion | op.StopAxis | op.AbortSlew):
            sent = self._runner.may_move.count
            if not (moves or sent != self._motion_count_at_stop or moved_by_others):
                return
            self._motion_count_at_stop = -1 if moves and not isinstance(operation, op.AbortMotion) else sent
        elif isinstance(operation, op.Move | op.MoveAxis):
            if self._wanted.hand_moves.get(operation.axis) == operation:
                return  # the same motion continues
        elif not isinstance(operation, (*GOTOS, op.Sync)):
            return
        self.mark_outdated()

    def mark_outdated(self) -> None:
        """Treat readings that were requested before now as outdated."""
        self._cache.mark_outdated(self._clock())
        self._extrapolated_to = -1e9

    # --- answers that may take an exchange --------------------------------------------------------------------------

    async def answer(self, operation: op.Operation) -> object:
        """Answer a client's read by asking the mount, or by the last answer if no new one comes in time. Raises Fault
        if neither exists.
        """
        kind = type(operation)
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_MOVING if self._movement.any_motion else ANSWER_TIMEOUT):
                answer = await self._newest_answer(operation)
        except Asleep:
            raise
        except (NoAnswer, Busy, TimeoutError) as failed:
            if (last := self.last_answer(kind)) is NOT_CACHED:
                raise failed if isinstance(failed, Fault) else NoAnswer from None
            return last
        self.gives_last_position = self.gives_last_position and kind not in POSITION_READS
        return answer

    async def _newest_answer(self, operation: op.Operation) -> object:
        """Return a new answer of the mount; ask again if a motion order has outdated its position. Raises Fault."""
        kind, answer = type(operation), NOT_CACHED
        for _ in range(MAX_READ_TRIES):
            if (source := self.source_kind_of(kind)) is not None:
                known = self.peek(source)
                value = self._convert_to(kind, await self.answer(source()) if known is NOT_CACHED else known)
                if value is not NOT_CACHED:
                    return value
            answer = await self._shared_answer(operation)
            if kind is op.Slewing:
                return answer or self._context.run_on.is_after_goto
            if kind not in POSITION_READS:
                return answer
            self._cache.note_polled((kind,), self._clock())  # the client's interest counts from the reply
            if self.source_kind_of(kind) is None:
                value = self._position_for_client(kind, self._cache.entries[kind])
                if value is not NOT_CACHED:
                    return value
        return answer

    async def answer_native(self, operation: op.NativeRequest, program: ProgramId) -> bytes:
        """Return the mount's own reply, cached or by an exchange that all waiting clients share. Raises Fault."""
        if self._is_overridden(operation, program):
            raise Unsupported
        reply = self._cache.native_reply(operation, self._clock())
        if isinstance(reply, Fault):
            raise type(reply)(str(reply))
        return cast(bytes, await shared_result(self.shared_task(operation)) if reply is NOT_CACHED else reply)

    async def read(self, operation: op.Operation[_T]) -> _T:
        """Return a reading from the cache, or by an exchange that all callers share. Raises Fault."""
        value = self.fresh_reading(type(operation))
        return cast(_T, await self._shared_answer(operation) if value is NOT_CACHED else value)

    async def read_now(self, operation: op.Operation[_T]) -> _T:
        """Read from the mount even if the last reading is fresh. The read outlasts a cancelled caller. Raises Fault."""
        return cast(_T, await result_of(self.shared_task(operation)))

    async def _shared_answer(self, operation: op.Operation) -> object:
        """Return the answer of the read in progress, or of a new read. Raises Fault; NoAnswer if the mount is not
        identified in time. During a goto, the answer to Slewing is True if the mount does not reply in time.
        """
        first = not self._required_event(operation).is_set()
        slews = isinstance(operation, op.Slewing) and self._movement.slewing
        try:
            async with asyncio.timeout(FIRST_REPLY_WAIT if first else GOTO_END_WAIT if slews else None):
                return await shared_result(self.shared_task(operation))
        except TimeoutError:
            if first or not self._movement.slewing:
                raise NoAnswer from None
            return True

    # --- exchanges --------------------------------------------------------------------------------------------------

    def shared_task(self, operation: op.Operation) -> asyncio.Task[object]:
        """Return the task that carries out this read; start it if there is none. No caller may cancel the task."""
        is_native = isinstance(operation, op.NativeRequest)
        key = (operation, self._cache.order_count) if is_native else type(operation)
        task = self._shared_tasks.get(key)
        if task is None:
            work = self._ask_native(operation) if isinstance(operation, op.NativeRequest) else self._ask(operation)
            task = self._shared_tasks[key] = self._context.tasks.spawn(work)
            task.add_done_callback(lambda done: self._unshare(key, done))
        return task

    def _unshare(self, key: object, task: asyncio.Task[object]) -> None:
        self._shared_tasks.pop(key, None)
        mark_exception_retrieved(task)

    def _required_event(self, operation: op.Operation) -> asyncio.Event:
        """Return the event that this read awaits: the mount's first reply for a position, else its identification."""
        return self._context.replied if isinstance(operation, op.Position) else self._context.identified

    async def _ask_native(self, operation: op.NativeRequest) -> bytes:
        await self._context.identified.wait()
        orders, fresh_for = self._cache.order_count, NATIVE_AGE.get(operation.keep, 0.0)
        try:
            answer: bytes = await self._runner.perform(operation, READ)
        except (NoDevice, Silence) as fault:
            # A mount that does not know a request will not know it later, and each timeout takes long: keep a Silence.
            fresh_for = inf if isinstance(fault, Silence) else fresh_for
            self._cache.store_native_reply(operation, type(fault)(str(fault)), fresh_for, orders, self._clock())
            raise
        self._cache.store_native_reply(operation, answer, fresh_for, orders, self._clock())
        return answer

    async def _ask(self, operation: op.Operation) -> object:
        kind = type(operation)
        if not self._required_event(operation).is_set():
            await self._required_event(operation).wait()
            if (known := self.fresh_reading(kind)) is not NOT_CACHED:
                return known  # identification has read it meanwhile
        gotos = self._wanted.goto_event_count
        if kind is op.AxisPosition and not self._driver.implementation(op.AxisPosition):
            entry = await self._axes_from_position()
        elif kind is op.HorizontalPosition and self._driver.position_reads > 1:
            entry = await self._read_while_at_rest(operation)
        else:
            entry = await self._request(operation)
        if kind is op.Slewing:
            if self._movement.slewing and not entry.value:
                await self._finish_goto()
            entry.value = entry.value or gotos != self._wanted.goto_event_count  # another goto may have begun meanwhile
        elif kind is op.HorizontalPosition and entry.value is None:
            position = await self.read(op.Position())
            entry = CachedAnswer(self._astrometry.horizontal(position), from_kind=op.Position)
        self._publish(kind, entry)
        return entry.value

    async def _request(self, operation: op.Operation) -> CachedAnswer:
        """Ask the mount and return its answer. Raises Fault."""
        priority = POSITION if isinstance(operation, op.Position) else READ
        try:
            value = await self._runner.perform(operation, priority)
        except Fault:
            if isinstance(operation, op.Position):
                self.position_failed.emit(None)
            raise
        self.exchange_counts[type(operation)] = self._runner.exchange_count
        return self._entry_for(operation, value)

    def _entry_for(self, operation: op.Operation, value: object) -> CachedAnswer:
        """Return a cache entry for a new answer. A position is converted to the equinox of date and gets its times."""
        if isinstance(operation, op.Position):
            value = self._astrometry.from_mount_equinox(cast(op.Equatorial, value))
        if not isinstance(value, op.Equatorial | op.Horizontal):
            return CachedAnswer(value)
        half = self._link.times.typical_rtt / 2.0
        first, second = self._driver.read_at or (self._clock(), self._clock())
        reading = Reading(angles_of(value), (first - half, second - half))
        return CachedAnswer(value, asked_at=self._runner.requested_at, reading=reading)

    def take_reading(self, operation: op.Operation, value: object) -> None:
        """Store and publish a reading that another part of the gateway has received from the mount."""
        self._publish(type(operation), self._entry_for(operation, value))

    def _publish(self, kind: Kind, entry: CachedAnswer) -> None:
        """Store a reading in the cache and emit its signal, by which the limits are checked."""
        if entry.reading is not None:
            self._link_to_previous(kind, entry)
        self._cache.store(kind, entry, self._clock())
        if isinstance(entry.value, op.Status):
            self.status_read.emit(entry.value)
        if kind is op.Position:
            self.position_read.emit(entry.value)
        elif kind is op.AxisPosition:
            self.axes_read.emit(entry.value)

    def _link_to_previous(self, kind: Kind, entry: CachedAnswer) -> None:
        """Link a new position to the previous one, for the extrapolation; pass it to the run-on watch."""
        context, last = self._context, self._cache.entries.get(kind)
        assert entry.reading is not None
        if kind is op.Position and context.run_on.current is not None:
            present = TimedPosition(self._clock(), entry.asked_at, entry.value)
            context.run_on.add_position(present, is_equatorial(context), self._driver.rest_tolerance)
        if last is not None and last.reading is not None:
            near = min(entry.reading.times) - min(last.reading.times) < MIN_GAP
            entry.prev, last.prev = last.prev if near else last, None

    async def _axes_from_position(self) -> CachedAnswer:
        """Calculate the axis readings for a mount that does not report them."""
        if not (await self.read(op.GetStatus())).equatorial:  # the axes of a fork are azimuth and altitude
            return CachedAnswer(await self.read(op.HorizontalPosition()), from_kind=op.HorizontalPosition)
        position = await self.read(op.Position())
        return CachedAnswer(self._astrometry.axes_of(position, on_wedge=not self._driver.german), from_kind=op.Position)

    async def _read_while_at_rest(self, operation: op.Operation) -> CachedAnswer:
        """Return the answer to a read that takes two requests, which is too long while the mount moves. If a motion
        begins meanwhile, return an entry with the value None.
        """
        reading = self._context.tasks.spawn(self._request(operation))
        try:
            while not self._movement.any_motion:
                if (await asyncio.wait({reading}, timeout=MOTION_CHECK_PERIOD))[0]:
                    return reading.result()
            return CachedAnswer(None)
        finally:
            reading.cancel()

    async def _finish_goto(self) -> None:
        """Read the position after the end of a goto, and log a missed goal. Clients learn of the end afterwards."""
        before = self._wanted.value
        slew, ends = before.motion, self._wanted.is_ending
        self.goto_over.emit(None)
        self._cache.forget(op.HorizontalPosition, op.AxisPosition, op.Position, op.PierSide)
        self.mark_outdated()
        await self.answer(op.Position())
        position = self._cache.last_value(op.Position)  # None if the mount has not reported a new one
        after = self._wanted.value
        is_newer = (before.stop_count, before.goto_count) != (after.stop_count, after.goto_count)
        if ends or self._wanted.is_ending or is_newer:
            return  # a client itself has ended or replaced it
        if position is None or not isinstance(slew, Slew) or self._wanted.axes_moved_by_hand:
            return
        if miss := await self._miss_message_for(slew.operation, position):
            self._context.note(miss)
            self.goto_missed.emit(miss)

    async def _miss_message_for(self, goto: op.Operation, position: op.Equatorial) -> str:
        """Return the log line for a goto that missed its goal; empty if it reached the goal or that is unknown."""
        if isinstance(goto, op.Goto):
            return miss_text(self._astrometry.from_mount_equinox(op.Equatorial(goto.ra, goto.dec)), position)
        goal = self._driver.destination(goto) if isinstance(goto, op.Park) else goto
        if not isinstance(goal, op.GotoAxes | op.GotoHorizontal):
            return ""
        kind = op.AxisPosition if isinstance(goal, op.GotoAxes) else op.HorizontalPosition
        await self.answer(kind())
        reached = self._cache.last_value(kind)
        return (
            ""
            if reached is None
            else miss_text(op.Equatorial(goal.az, goal.alt), op.Equatorial(reached.az, reached.alt))
        )

    async def tube_side(self) -> str | None:
        """Return the pier side (E, W) of the tube of a German mount; None if it is unknown."""
        if self._driver.tube_side("E") is None:
            return None
        try:
            return self._driver.tube_side(await self.read(op.PierSide()))
        except Fault:
            return None


def miss_text(goal: op.Equatorial, position: op.Equatorial) -> str:
    """Return the log line for a goto that missed its goal; empty if it reached the goal. ``goal`` and ``position`` are
    in the same coordinates. The gateway does not repeat the goto: a person may have ended it at the hand control.
    """
    away = separation(goal.ra, goal.dec, position.ra, position.dec)
    why = "the mount or a person at its keys ended it"
    return "" if away <= GOAL_TOLERANCE else f"the goto ended {away:.1f} degrees from its goal: {why}"
