"""Reading the mount: what is fresh is told again, and one exchange serves everybody who asks meanwhile.

What the mount says is folded into what the limits go by before anybody is told. What it cannot say itself is worked out
from other reads.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.core.shared_work import result_of
from gateway.mount.link.queue import POSITION, READ
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings.arrival import missed
from gateway.mount.readings.cache import FRESH, MISSING, Kind
from gateway.mount.safety.rules.sync_sum import SyncSum
from gateway.mount.site.settings import FIRST_ANSWER

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: How soon it is noticed that the mount has begun to move, seconds.
A_MOMENT = 0.2
#: Seconds that whoever asks whether a goto is over waits, at most, until that is known.
UNTIL_KNOWN = 2.0


class Reader:
    """``read`` takes what is at hand, ``anew`` asks the mount in any case."""

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        self._sharing: dict[Kind, asyncio.Task[Any]] = {}

    def close(self) -> None:
        """Nobody waits any more."""
        for task in self._sharing.values():
            task.cancel()

    def _there(self, operation: op.Operation) -> asyncio.Event:
        """What must have happened before the mount is asked this: where it points it tells before its name."""
        identification = self._controller.identification
        return identification.met if isinstance(operation, op.Position) else identification.known

    def at_hand(self, operation: op.Operation) -> Any:
        """What the mount said last, when it is fresh enough; MISSING when it must be asked."""
        kind = type(operation)
        if kind not in FRESH:
            known = self._controller.settings.peek(kind)
            return MISSING if known is None else known
        if kind is op.Slewing and self._controller.motions.goto_waits:
            return True
        now = self._controller.snapshot.asked[kind] = self._controller.now()
        return self._controller.snapshot.fresh(
            kind, now, 2.5 * self._controller.line.typical, self._controller.line.state != "up"
        )

    async def read(self, operation: op.Operation) -> Any:
        """What the mount says, from the readings cache or by an exchange that everyone who asks shares. Raises
        Fault."""
        value = self.at_hand(operation)
        return await self.asked(operation) if value is MISSING else value

    async def asked(self, operation: op.Operation) -> Any:
        """The answer of the exchange under way, or of a new one; not long after the start. Raises Fault.

        A goto goes on until it is known to be over: a slow mount is not waited for long to say so.
        """
        first, slews = (
            not self._there(operation).is_set(),
            isinstance(operation, op.Slewing) and self._controller.slewing,
        )
        try:
            async with asyncio.timeout(FIRST_ANSWER if first else UNTIL_KNOWN if slews else None):
                return await self._controller.turnstile.outcome(self.shared(operation))
        except TimeoutError:
            if first or not self._controller.slewing:
                raise NoAnswer from None
            return True

    async def anew(self, operation: op.Operation) -> Any:
        """A read from the mount, however fresh the last answer is; who gives up ends it for nobody. Raises Fault."""
        return await result_of(self.shared(operation))

    def shared(self, operation: op.Operation) -> asyncio.Task[Any]:
        """The exchange under way for this kind of read, else a new one. It belongs to all: nobody may cancel it."""
        kind = type(operation)
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = self._controller.loop.create_task(self._ask(operation))
            task.add_done_callback(lambda done: self._unshare(kind, done))
        return task

    def _unshare(self, kind: Kind, task: asyncio.Task[Any]) -> None:
        self._sharing.pop(kind, None)
        if not task.cancelled():
            task.exception()  # whoever still waits gets it; nobody waiting is no error

    async def _ask(self, operation: op.Operation) -> Any:
        if not self._there(operation).is_set():
            await self._there(operation).wait()
            if (met := self.at_hand(operation)) is not MISSING:
                return met  # it was told where the mount was met
        kind, gotos = type(operation), self._controller.motions.gotos
        source: Kind | None = None
        if isinstance(operation, op.AxisPosition) and not self._controller.driver.way(op.AxisPosition):
            equatorial = (await self.read(op.GetStatus())).equatorial  # the axes of a fork are azimuth and altitude
            source = op.Position if equatorial else op.HorizontalPosition
            seen = await self.read(source())
            value: Any = (
                self._controller.derived.axes(seen, wedge=not self._controller.driver.german) if equatorial else seen
            )
        elif isinstance(operation, op.HorizontalPosition) and self._controller.driver.position_reads > 1:
            value = await self._while_it_rests(operation)
        else:
            value = await self._hear(operation)
        if isinstance(operation, op.Slewing):
            if self._controller.slewing and not value:
                await self._settled()
            value = (
                value or gotos != self._controller.motions.gotos
            )  # a goto that has been begun meanwhile is under way
        if isinstance(operation, op.HorizontalPosition) and value is None:
            source, value = op.Position, self._controller.derived.horizon(await self.read(op.Position()))
        if source is not None:
            self._controller.telling.worked_out(kind, source)
        self._fold(kind, value)
        return value

    def _fold(self, kind: Kind, value: Any) -> None:
        """What was said is known from now on, and the limits go by it."""
        self._controller.snapshot.put(kind, value, self._controller.now())
        if isinstance(value, op.Status) and not value.aligned:
            self._controller.synced = SyncSum()
        if kind is op.Position:
            self._controller.guard.look(value)
        elif kind is op.AxisPosition:
            self._controller.guard.look_at_altitude(value)

    def told(self, operation: op.Operation, value: Any) -> None:
        """The mount has told this without having been asked for it here."""
        self._fold(type(operation), self._taken(operation, value))

    async def _hear(self, operation: op.Operation) -> Any:
        """What the mount itself answers; a place together with when it was asked for it and when it was there."""
        rank = POSITION if isinstance(operation, op.Position) else READ
        try:
            value = await self._controller.drive(self._controller.driver.perform(operation), rank)
        except Fault:
            if isinstance(operation, op.Position):
                self._controller.guard.unseen()
            raise
        self._controller.refresh.cost(type(operation), self._controller.executor.exchanges)
        return self._taken(operation, value)

    def _taken(self, operation: op.Operation, value: Any) -> Any:
        """An answer that has just come, as the gateway goes by it."""
        if isinstance(operation, op.Position):
            value = self._controller.derived.from_mount(value)
        if isinstance(value, op.Equatorial | op.Horizontal):
            half = self._controller.line.typical / 2.0
            first, second = self._controller.driver.halves or (self._controller.now(), self._controller.now())
            self._controller.telling.came(
                type(operation), value, self._controller.executor.asked_at, (first - half, second - half)
            )
        return value

    async def _while_it_rests(self, operation: op.Operation) -> Any:
        """The answer, or None once the mount moves: then the line has no room for two positions in halves."""
        reading = self._controller.spawn(self._hear(operation))
        try:
            while not self._controller.moving:
                if (await asyncio.wait({reading}, timeout=A_MOMENT))[0]:
                    return reading.result()
            return None
        finally:
            reading.cancel()

    async def _settled(self) -> None:
        """A goto has just ended: nobody is told so before the position is known where it ended."""
        slew = self._controller.motions.wanted.motion
        self._controller.guard.arrived()
        self._controller.motions.arrived()
        self._controller.snapshot.forget(op.HorizontalPosition, op.AxisPosition, op.Position, op.PierSide)
        self._controller.telling.anew()
        here = await self._controller.telling.read(op.Position())
        if isinstance(slew, Slew) and isinstance(slew.operation, op.Goto) and not self._controller.motions.axes:
            goal = self._controller.derived.from_mount(op.Equatorial(slew.operation.ra, slew.operation.dec))
            if words := missed(goal, here):
                self._controller.transcript.note("mount", words)

    async def tube_side(self) -> str | None:
        """The side of the pier (E, W) that the tube of a German mount is on; None where nobody tells."""
        if self._controller.driver.tube_side("E") is None:
            return None
        try:
            return self._controller.driver.tube_side(await self.read(op.PierSide()))
        except Fault:
            return None
