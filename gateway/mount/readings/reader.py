"""Reads the mount: fresh readings come from the cache, and all clients that ask meanwhile share one exchange.

The limits are checked with every reading before any client gets it. What the mount does not report itself is calculated
from other reads.
"""

from __future__ import annotations

import asyncio
from typing import Any, TypeVar, cast

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, NoAnswer
from gateway.core.signals import Signal
from gateway.core.waiting import FairScheduler, mark_retrieved, result_of
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import POSITION, READ
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings.cache import NOT_CACHED, Kind
from gateway.mount.readings.client_readings import POSITIONS, ClientReadings, cached_reading

_T = TypeVar("_T")
#: Seconds between two checks whether the mount has begun to move.
MOTION_CHECK = 0.2
#: Seconds that a client waits at most to learn whether a goto has ended, and for the first reply of the mount.
END_OF_GOTO, FIRST_ANSWER = 2.0, 2.0
#: Seconds that a client waits for a new reading before it gets the last one: at rest, and in motion, in which the last
#: one is outdated (as long as a reply may take). TRIES: how often the mount is asked again if orders keep coming that
#: make its replies outdated.
TIMEOUT, TIMEOUT_MOVING, TRIES = 2.5, 3.2, 3
#: Degrees from its goal within which an undisturbed goto ends on every mount.
AT_GOAL = 0.5


class Reader:
    """``read`` prefers the cache, ``read_now`` always asks the mount, ``answer`` answers a client with a timeout.

    Signals: ``position``, ``axes`` and ``status`` with a new reading; ``unseen`` when a position read failed;
    ``goto_over`` when the mount reports that a goto has ended, ``goto_missed`` in words if that is not at its goal.
    """

    def __init__(
        self, context: Context, runner: DriverRunner, fair: FairScheduler, client_readings: ClientReadings
    ) -> None:
        self._context, self._driver, self._now, self._link, self._cache = (
            context, context.driver, context.now, context.link, context.cache)  # fmt: skip
        self._wanted, self._movement, self._astrometry = context.wanted, context.movement, context.astrometry
        self._runner, self._fair, self._client_readings = runner, fair, client_readings
        self._sharing: dict[Kind, asyncio.Task[Any]] = {}
        self._exchanges: dict[Kind, int] = {}
        self.position: Signal[op.Equatorial] = Signal()
        self.axes: Signal[op.Horizontal] = Signal()
        self.status: Signal[op.Status] = Signal()
        self.unseen: Signal[None] = Signal()
        self.goto_over: Signal[None] = Signal()
        self.goto_missed: Signal[str] = Signal()

    def close(self) -> None:
        for task in self._sharing.values():
            task.cancel()

    def exchanges(self, kind: Kind) -> int:
        """Return the number of exchanges that the last read of this kind took."""
        return self._exchanges.get(kind, 1)

    def _precondition(self, operation: op.Operation) -> asyncio.Event:
        """Return the event to wait for before this read: for the position a mount was found, else identified."""
        return self._context.found if isinstance(operation, op.Position) else self._context.known

    async def answer(self, operation: op.Operation) -> Any:
        """Return the answer for a client, the last one if no new one arrives in time. Raises Fault if there is none."""
        fault: Fault
        try:
            async with asyncio.timeout(TIMEOUT_MOVING if self._movement.anything else TIMEOUT):
                answer = await self._newest(operation)
        except Asleep:
            raise
        except (NoAnswer, Busy) as said:
            fault = said
        except TimeoutError:
            fault = NoAnswer()
        else:
            self._client_readings.answered(type(operation))
            return answer
        last = self._client_readings.last(type(operation))
        if last is NOT_CACHED:
            raise fault
        return last

    async def _newest(self, operation: op.Operation) -> Any:
        """Return the mount's answer, from the cache or by an exchange. Raises Fault.

        A position that was requested before the last motion order is outdated: the mount is asked again.
        """
        kind, client_readings = type(operation), self._client_readings
        value = client_readings.peek(operation)
        answer: Any = NOT_CACHED
        for _ in range(TRIES):
            if value is NOT_CACHED and (source := client_readings.source(kind)) is not None:
                await self.answer(source())
                value = client_readings.peek(operation)
            if value is not NOT_CACHED:
                return value
            answer = await self.shared_answer(operation)
            if kind is op.Slewing:
                return answer or self._context.run_on.of_goto
            if kind not in POSITIONS:
                return answer
            value = client_readings.peek(operation)
        return answer if value is NOT_CACHED else value

    async def read(self, operation: op.Operation[_T]) -> _T:
        """Return a reading from the cache, or by an exchange that all callers share. Raises Fault."""
        value = cached_reading(self._context, type(operation))
        return cast(_T, await self.shared_answer(operation) if value is NOT_CACHED else value)

    async def shared_answer(self, operation: op.Operation) -> Any:
        """Return the answer of the exchange under way, or of a new one. Raises Fault; NoAnswer if a mount that is not
        identified yet does not answer soon. A slow mount counts as slewing until it reports the end of the goto.
        """
        first = not self._precondition(operation).is_set()
        slews = isinstance(operation, op.Slewing) and self._movement.slewing
        try:
            async with asyncio.timeout(FIRST_ANSWER if first else END_OF_GOTO if slews else None):
                return await self._fair.shared_result(self.shared(operation))
        except TimeoutError:
            if first or not self._movement.slewing:
                raise NoAnswer from None
            return True

    async def read_now(self, operation: op.Operation[_T]) -> _T:
        """Read from the mount, even if the last reading is fresh. A cancelled caller does not end it. Raises Fault."""
        return cast(_T, await result_of(self.shared(operation)))

    def shared(self, operation: op.Operation) -> asyncio.Task[Any]:
        """Return the task that reads this kind now, or start one. It is shared: no caller may cancel it."""
        kind = type(operation)
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = asyncio.get_running_loop().create_task(self._ask(operation))
            task.add_done_callback(lambda done: self._unshare(kind, done))
        return task

    def _unshare(self, kind: Kind, task: asyncio.Task[Any]) -> None:
        self._sharing.pop(kind, None)
        mark_retrieved(task)

    async def _ask(self, operation: op.Operation) -> Any:
        if not self._precondition(operation).is_set():
            await self._precondition(operation).wait()
            if (known := cached_reading(self._context, type(operation))) is not NOT_CACHED:
                return known  # identification has read it meanwhile
        kind, gotos = type(operation), self._wanted.gotos
        source: Kind | None = None
        if isinstance(operation, op.AxisPosition) and not self._driver.implementation(op.AxisPosition):
            source, value = await self._axes_from_the_sky()
        elif isinstance(operation, op.HorizontalPosition) and self._driver.position_reads > 1:
            value = await self._while_it_rests(operation)
        else:
            value = await self._request(operation)
        if isinstance(operation, op.Slewing):
            if self._movement.slewing and not value:
                await self._settled()
            value = value or gotos != self._wanted.gotos  # another goto may have begun meanwhile
        if isinstance(operation, op.HorizontalPosition) and value is None:
            source, value = op.Position, self._astrometry.horizon(await self.read(op.Position()))
        if source is not None:
            self._client_readings.calculated_from(kind, source)
        self._publish(kind, value)
        return value

    async def _axes_from_the_sky(self) -> tuple[Kind, Any]:
        """Calculate the axis readings for a mount that does not report them; return (source read, readings)."""
        equatorial = (await self.read(op.GetStatus())).equatorial
        if not equatorial:  # the axes of a fork are azimuth and altitude
            return op.HorizontalPosition, await self.read(op.HorizontalPosition())
        seen = await self.read(op.Position())
        return op.Position, self._astrometry.axes(seen, wedge=not self._driver.german)

    def _publish(self, kind: Kind, value: Any) -> None:
        """Store a reading, and pass it to the limits by signals."""
        self._cache.put(kind, value, self._now())
        if isinstance(value, op.Status):
            self.status.emit(value)
        if kind is op.Position:
            self.position.emit(value)
        elif kind is op.AxisPosition:
            self.axes.emit(value)

    def take(self, operation: op.Operation, value: Any) -> None:
        """Take a reading that the mount reported in an exchange of another part."""
        self._publish(type(operation), self._converted(operation, value))

    async def _request(self, operation: op.Operation) -> Any:
        """Ask the mount and return its answer. Raises Fault."""
        priority = POSITION if isinstance(operation, op.Position) else READ
        try:
            value = await self._runner.perform(operation, priority)
        except Fault:
            if isinstance(operation, op.Position):
                self.unseen.emit(None)
            raise
        self._exchanges[type(operation)] = self._runner.exchanges
        return self._converted(operation, value)

    def _converted(self, operation: op.Operation, value: Any) -> Any:
        """Convert an answer that has just arrived to the equinox of date, and pass on positions with their times."""
        if isinstance(operation, op.Position):
            value = self._astrometry.from_mount(value)
        if isinstance(value, op.Equatorial | op.Horizontal):
            half = self._link.typical_rtt / 2.0
            first, second = self._driver.read_at or (self._now(), self._now())
            self._client_readings.take(type(operation), value, self._runner.asked_at, (first - half, second - half))
        return value

    async def _while_it_rests(self, operation: op.Operation) -> Any:
        """Return the answer, or None once the mount moves: then two positions of two requests each take too long."""
        reading = self._context.tasks.spawn(self._request(operation))
        try:
            while not self._movement.anything:
                if (await asyncio.wait({reading}, timeout=MOTION_CHECK))[0]:
                    return reading.result()
            return None
        finally:
            reading.cancel()

    async def _settled(self) -> None:
        """Read the final position before reporting that the goto has ended."""
        before = self._wanted.value
        slew, ends = before.motion, self._wanted.ending
        self.goto_over.emit(None)
        self._cache.forget(op.HorizontalPosition, op.AxisPosition, op.Position, op.PierSide)
        self._client_readings.outdate()
        await self.answer(op.Position())
        here = self._cache.value(op.Position)  # None if the mount has not told a new one
        after = self._wanted.value
        if ends or self._wanted.ending or (before.stops, before.gotos) != (after.stops, after.gotos):
            return  # a client has ended or replaced it, and knows
        if (
            here is not None
            and isinstance(slew, Slew)
            and isinstance(slew.operation, op.Goto)
            and not self._wanted.axes
        ):
            goal = self._astrometry.from_mount(op.Equatorial(slew.operation.ra, slew.operation.dec))
            if words := missed(goal, here):
                self._context.note(words)
                self.goto_missed.emit(words)

    async def tube_side(self) -> str | None:
        """Return the pier side (E, W) of the tube of a German mount; None if it is unknown."""
        if self._driver.tube_side("E") is None:
            return None
        try:
            return self._driver.tube_side(await self.read(op.PierSide()))
        except Fault:
            return None


def missed(goal: op.Equatorial, here: op.Equatorial) -> str:
    """Return the log line for a goto that ended away from its goal; an empty text if it reached it. Both positions are
    in the same coordinates. The gateway does not repeat the goto: a person may have ended it at the hand control.
    """
    away = separation(goal.ra, goal.dec, here.ra, here.dec)
    why = "the mount or a person at its keys ended it"
    return "" if away <= AT_GOAL else f"the goto ended {away:.1f} degrees from its goal: {why}"
