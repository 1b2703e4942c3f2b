"""Reading the mount: what is fresh is told again, and one exchange serves everybody who asks meanwhile.

What the mount says is folded into what the limits go by before anybody is told. What it cannot say itself is worked out
from other reads.
"""

from __future__ import annotations

import asyncio
from typing import Any, TypeVar, cast

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, NoAnswer
from gateway.core.signals import Signal
from gateway.core.waiting import FairScheduler, heed, result_of
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import POSITION, READ
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings.cache import MISSING, Kind
from gateway.mount.readings.told_position import PLACES, ToldPosition, at_hand

_T = TypeVar("_T")
#: How soon it is noticed that the mount has begun to move, seconds.
A_MOMENT = 0.2
#: Seconds that whoever asks whether a goto is over waits, at most, until that is known; and for the mount's first word.
UNTIL_KNOWN, FIRST_ANSWER = 2.0, 2.0
#: Seconds that a program waits for an answer where the last one may stand in for it: in motion, which makes it old, as
#: long as a reply may take; and how often the mount is asked again while orders come faster than it can tell what came
#: of them.
WAITS, WAITS_MOVING, TRIES = 2.5, 3.2, 3
#: Degrees from the goal within which every mount ends a goto that nobody ends before.
CLOSE = 0.5


class Reader:
    """``read`` takes what is at hand, ``anew`` asks the mount in any case, ``tell`` waits as a program waits.

    Signals: what the mount has told of its position, its axes and its state; ``unseen`` when it did not tell where it
    is; ``goto_over`` when it has told that a goto is over.
    """

    def __init__(self, context: Context, runner: DriverRunner, fair: FairScheduler, told: ToldPosition) -> None:
        self._context, self._driver, self._now, self._link, self._cache = (
            context, context.driver, context.now, context.link, context.cache)  # fmt: skip
        self._wanted, self._movement, self._astrometry = context.wanted, context.movement, context.astrometry
        self._runner, self._fair, self._told = runner, fair, told
        self._sharing: dict[Kind, asyncio.Task[Any]] = {}
        self._exchanges: dict[Kind, int] = {}
        self.position: Signal[op.Equatorial] = Signal()
        self.axes: Signal[op.Horizontal] = Signal()
        self.status: Signal[op.Status] = Signal()
        self.unseen: Signal[None] = Signal()
        self.goto_over: Signal[None] = Signal()

    def close(self) -> None:
        for task in self._sharing.values():
            task.cancel()

    def exchanges(self, kind: Kind) -> int:
        """How many the last answer of this kind has taken."""
        return self._exchanges.get(kind, 1)

    def _there(self, operation: op.Operation) -> asyncio.Event:
        """What must have happened before the mount is asked this: where it points it tells before its name."""
        return self._context.met if isinstance(operation, op.Position) else self._context.known

    async def tell(self, operation: op.Operation) -> Any:
        """The answer for a program. Raises Fault where there is nothing to tell.

        In place of one that does not come in time stands the last one; a state that nobody knows is told as it does no
        harm.
        """
        fault: Fault
        try:
            async with asyncio.timeout(WAITS_MOVING if self._movement.anything else WAITS):
                answer = await self._newest(operation)
        except Asleep:
            raise
        except (NoAnswer, Busy) as said:
            fault = said
        except TimeoutError:
            fault = NoAnswer()
        else:
            self._told.answered(type(operation))
            return answer
        last = self._told.last(type(operation))
        if last is MISSING:
            raise fault
        return last

    async def _newest(self, operation: op.Operation) -> Any:
        """The mount's answer, at hand or waited for. Raises Fault.

        A place that was asked for before the last order is not told: the mount is asked again.
        """
        kind, told = type(operation), self._told
        value = told.tell(operation)
        answer: Any = MISSING
        for _ in range(TRIES):
            if value is MISSING and (source := told.source(kind)) is not None:
                await self.tell(source())
                value = told.tell(operation)
            if value is not MISSING:
                return value
            answer = await self.asked(operation)
            if kind not in PLACES:
                return answer
            value = told.tell(operation)
        return answer if value is MISSING else value

    async def read(self, operation: op.Operation[_T]) -> _T:
        """What the mount says, at hand or by an exchange that everyone who asks shares. Raises Fault."""
        value = at_hand(self._context, type(operation))
        return cast(_T, await self.asked(operation) if value is MISSING else value)

    async def asked(self, operation: op.Operation) -> Any:
        """The answer of the exchange under way, or of a new one; not long after the start. Raises Fault.

        A goto goes on until it is known to be over: a slow mount is not waited for long to say so.
        """
        first = not self._there(operation).is_set()
        slews = isinstance(operation, op.Slewing) and self._movement.slewing
        try:
            async with asyncio.timeout(FIRST_ANSWER if first else UNTIL_KNOWN if slews else None):
                return await self._fair.outcome(self.shared(operation))
        except TimeoutError:
            if first or not self._movement.slewing:
                raise NoAnswer from None
            return True

    async def anew(self, operation: op.Operation[_T]) -> _T:
        """A read from the mount, however fresh the last answer is; who gives up ends it for nobody. Raises Fault."""
        return cast(_T, await result_of(self.shared(operation)))

    def shared(self, operation: op.Operation) -> asyncio.Task[Any]:
        """The exchange under way for this kind of read, else a new one. It belongs to all: nobody may cancel it."""
        kind = type(operation)
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = asyncio.get_running_loop().create_task(self._ask(operation))
            task.add_done_callback(lambda done: self._unshare(kind, done))
        return task

    def _unshare(self, kind: Kind, task: asyncio.Task[Any]) -> None:
        self._sharing.pop(kind, None)
        heed(task)

    async def _ask(self, operation: op.Operation) -> Any:
        if not self._there(operation).is_set():
            await self._there(operation).wait()
            if (met := at_hand(self._context, type(operation))) is not MISSING:
                return met  # it was told where the mount was met
        kind, gotos = type(operation), self._wanted.gotos
        source: Kind | None = None
        if isinstance(operation, op.AxisPosition) and not self._driver.implementation(op.AxisPosition):
            source, value = await self._axes_from_the_sky()
        elif isinstance(operation, op.HorizontalPosition) and self._driver.position_reads > 1:
            value = await self._while_it_rests(operation)
        else:
            value = await self._hear(operation)
        if isinstance(operation, op.Slewing):
            if self._movement.slewing and not value:
                await self._settled()
            value = value or gotos != self._wanted.gotos  # a goto that has been begun meanwhile is under way
        if isinstance(operation, op.HorizontalPosition) and value is None:
            source, value = op.Position, self._astrometry.horizon(await self.read(op.Position()))
        if source is not None:
            self._told.worked_out(kind, source)
        self._fold(kind, value)
        return value

    async def _axes_from_the_sky(self) -> tuple[Kind, Any]:
        """Where the axes stand of a mount that does not tell -> what that follows from, and the readings."""
        equatorial = (await self.read(op.GetStatus())).equatorial
        if not equatorial:  # the axes of a fork are azimuth and altitude
            return op.HorizontalPosition, await self.read(op.HorizontalPosition())
        seen = await self.read(op.Position())
        return op.Position, self._astrometry.axes(seen, wedge=not self._driver.german)

    def _fold(self, kind: Kind, value: Any) -> None:
        """What was said is known from now on, and the limits go by it."""
        self._cache.put(kind, value, self._now())
        if isinstance(value, op.Status):
            self.status.emit(value)
        if kind is op.Position:
            self.position.emit(value)
        elif kind is op.AxisPosition:
            self.axes.emit(value)

    def told(self, operation: op.Operation, value: Any) -> None:
        """The mount has told this without having been asked for it here."""
        self._fold(type(operation), self._taken(operation, value))

    async def _hear(self, operation: op.Operation) -> Any:
        """What the mount itself answers; a place together with when it was asked for it and when it was there."""
        rank = POSITION if isinstance(operation, op.Position) else READ
        try:
            value = await self._runner.perform(operation, rank)
        except Fault:
            if isinstance(operation, op.Position):
                self.unseen.emit(None)
            raise
        self._exchanges[type(operation)] = self._runner.exchanges
        return self._taken(operation, value)

    def _taken(self, operation: op.Operation, value: Any) -> Any:
        """An answer that has just come, as the gateway goes by it."""
        if isinstance(operation, op.Position):
            value = self._astrometry.from_mount(value)
        if isinstance(value, op.Equatorial | op.Horizontal):
            half = self._link.typical / 2.0
            first, second = self._driver.read_at or (self._now(), self._now())
            self._told.came(type(operation), value, self._runner.asked_at, (first - half, second - half))
        return value

    async def _while_it_rests(self, operation: op.Operation) -> Any:
        """The answer, or None once the mount moves: then the line has no room for two positions in halves."""
        reading = self._context.tasks.spawn(self._hear(operation))
        try:
            while not self._movement.anything:
                if (await asyncio.wait({reading}, timeout=A_MOMENT))[0]:
                    return reading.result()
            return None
        finally:
            reading.cancel()

    async def _settled(self) -> None:
        """A goto has just ended: nobody is told so before the position is known where it ended."""
        slew = self._wanted.value.motion
        self.goto_over.emit(None)
        self._cache.forget(op.HorizontalPosition, op.AxisPosition, op.Position, op.PierSide)
        self._told.anew()
        here = await self.tell(op.Position())
        if isinstance(slew, Slew) and isinstance(slew.operation, op.Goto) and not self._wanted.axes:
            goal = self._astrometry.from_mount(op.Equatorial(slew.operation.ra, slew.operation.dec))
            if words := missed(goal, here):
                self._context.note(words)

    async def tube_side(self) -> str | None:
        """The side of the pier (E, W) that the tube of a German mount is on; None where nobody tells."""
        if self._driver.tube_side("E") is None:
            return None
        try:
            return self._driver.tube_side(await self.read(op.PierSide()))
        except Fault:
            return None


def missed(goal: op.Equatorial, here: op.Equatorial) -> str:
    """Words for the log on a goto that is over; none where it has come to its goal. Both in the same coordinates.

    Whoever stands beside the mount may have ended it there, and is not fought.
    """
    away = separation(goal.ra, goal.dec, here.ra, here.dec)
    return "" if away <= CLOSE else f"the goto ended {away:.1f} degrees from its goal: it was ended at the mount"
