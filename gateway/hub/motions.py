"""Motions: one after the other, each admitted by the checks, and all of them ended by a stop.

A motion that waits for its turn dies when a stop comes; one that runs is cancelled between two exchanges. The stop
itself waits for the exchange on the wire and for nothing else: not for a setting that outlives it, which goes on when
the stop is done. The halt of one axis goes before all that waits, except a goto that was asked for before it; a motion
of the other axis that is only being prepared is begun anew behind it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway import operations as op
from gateway.driver import Later
from gateway.errors import Fault, Stopped
from gateway.hub.halts import Halting, Halts
from gateway.hub.releases import Pressed
from gateway.hub.turn import FIRST, IN_ORDER, RESUMED, Turn
from gateway.line import MOTION, SETTING, STOP
from gateway.motion_kinds import BEGUN_ANEW, ENDS, GOTOS, LATEST, MOVING, axis_moved

if TYPE_CHECKING:
    from gateway.hub.core import Hub
    from gateway.hub.dead_man import Life

#: How often a stop is sent again on a line that is up, when its answer was lost.
STOP_TRIES = 3


def _heed(task: asyncio.Task[Any]) -> None:
    """Whoever waits for a task gets its exception; that nobody waits is no error."""
    if not task.cancelled():
        task.exception()


class Motions:
    """Everything that can move the mount. ``stops`` counts those so far, ``gotos`` what was asked for and begun."""

    def __init__(self, hub: Hub, follow_ups: dict[type[Any], Callable[[Any, Any], Any]]) -> None:
        self._hub, self._follow_ups = hub, follow_ups
        self.stops = self.gotos = 0
        self.owed = False
        #: What moves by hand, axis by axis.
        self.by_hand: dict[int, op.Move | op.MoveAxis] = {}
        self._turn = Turn()
        self._at_turn: asyncio.Task[Any] | None = None
        self._stopping: asyncio.Task[None] | None = None
        self._interruptible: asyncio.Task[Any] | None = None
        self._halts, self._pressed = Halts(hub.now), Pressed()
        self._jobs: dict[asyncio.Task[Any], op.Operation] = {}
        self._later: dict[op.Operation, asyncio.TimerHandle] = {}
        self._checks = hub.checks

    @property
    def axes(self) -> set[int]:
        """The axes that move by hand."""
        return set(self.by_hand)

    @property
    def ending(self) -> bool:
        """Whether a stop or a halt is not done yet."""
        return self.owed or bool(self._halts)

    @property
    def goto_waits(self) -> bool:
        """Whether a goto was asked for that the mount has not acknowledged yet."""
        return any(isinstance(job, GOTOS) for job in self._jobs.values())

    @property
    def waking(self) -> bool:
        """Whether the mount was asked to wake, and has not acknowledged it yet."""
        return bool(self._wakes)

    @property
    def _wakes(self) -> list[asyncio.Task[Any]]:
        return [task for task, job in self._jobs.items() if isinstance(job, op.Wake)]

    @property
    def busy(self) -> bool:
        """Whether anything moves, is about to, or is to be ended later: all that a stop would end or put right."""
        coming = any(not one.outlives_stop for one in (*self._jobs.values(), *self._later))
        return self.owed or coming or self._hub.moving or self._hub.driver.unrestored

    def begin_stop(self) -> asyncio.Task[None]:
        """End every motion: what runs or waits dies now, and the stop goes to the line first.

        It is owed until the mount has acknowledged it: a lost answer or a lost line does not cancel it.
        """
        self.stops += 1
        self.owed = True
        self._pressed.clear()
        ended = [task for task, job in self._jobs.items() if not job.outlives_stop]
        for task in ended:
            task.cancel()
        for operation in [planned for planned in self._later if not planned.outlives_stop]:
            self._later.pop(operation).cancel()
        return self.send_stop(ended)

    def send_stop(self, ended: list[asyncio.Task[Any]] | None = None) -> asyncio.Task[None]:
        """Send a stop when these tasks have ended. By itself it ends nothing that was asked for, only what moves."""
        if self._stopping is None or self._stopping.done():  # else it is being done: nothing can have begun since
            self._stopping = self._hub.spawn(self._stop(ended or []))
            self._stopping.add_done_callback(_heed)
        return self._stopping

    async def stop(self) -> None:
        """The same, and wait until the mount has acknowledged it. Raises Fault."""
        await asyncio.shield(self.begin_stop())

    async def _stop(self, ended: list[asyncio.Task[Any]]) -> None:
        if ended:
            await asyncio.wait(ended)
        for attempt in range(STOP_TRIES):
            try:
                await self._hub.drive(self._hub.driver.perform(op.Stop()), STOP)
                break
            except Fault as fault:
                self._hub.transcript.note("mount", f"stop: {fault}")
                down = self._hub.line.state == "down"
                if self._hub.driver.asleep and not down:  # it stands still, and hears of nothing
                    break
                if attempt == STOP_TRIES - 1 or down:
                    self._hub.ends.sent((1, 2), self._hub.guard.fastest)  # it stays owed, while it is seen to move
                    raise
        self.owed = False
        self._hub.ends.sent((1, 2), self._hub.guard.fastest)
        self._at_rest()

    def _at_rest(self) -> None:
        """Whatever moved has been ended."""
        self.by_hand.clear()
        self._hub.dead_man.stopped()
        self._hub.guard.ended()
        self._hub.snapshot.put(op.Slewing, False, self._hub.now())

    def begin(self, operation: op.Operation, stops: int | None, life: Life | None) -> asyncio.Task[Any]:
        """Put a motion in line behind those before it; from now on it counts as asked for, by ``life``."""
        if isinstance(operation, op.Move | op.MoveAxis):
            self._pressed.press(operation.axis, life)
        elif isinstance(operation, GOTOS):
            self._pressed.goto()
        during = self._during_goto(operation, life) if isinstance(operation, op.Halt) else None
        if during is not None:
            return during
        same = self.again(operation)
        if same is not None:
            return same.task
        task = self._hub.loop.create_task(self._run(operation, self.stops if stops is None else stops, life))
        if isinstance(operation, ENDS):
            self._interrupt(self._halts.begun(operation, self._overtakes(operation), task))
        else:
            self._halts.asked += 1
        self._jobs[task] = operation
        self.gotos += isinstance(operation, GOTOS)
        self._hub.snapshot.version += 1  # a goto that was asked for changes what "slewing" answers
        task.add_done_callback(self._ended)
        return task

    def _during_goto(self, halt: op.Halt, life: Life | None) -> asyncio.Task[Any] | None:
        """What a halt means while a goto waits or is under way; None without one, and where its axis moves by hand."""
        pressed = self._pressed.release(halt.axis, life)
        waiting = [task for task, job in self._jobs.items() if isinstance(job, GOTOS) and not task.cancelling()]
        if not waiting and (self.by_hand or not self._hub.slewing):  # an arrow that was begun has ended the goto
            return None
        return self._hub.spawn(self._release(halt, waiting[-1:])) if pressed else self.begin_stop()

    async def _release(self, halt: op.Halt, waiting: list[asyncio.Task[Any]]) -> None:
        """The arrow was over when the goto took its place; where that was refused, it is released after all."""
        for goto in waiting:
            await asyncio.wait({goto})
            if (goto.cancelled() or goto.exception() is not None) and halt.axis in self.by_hand:
                await self.ended(self.begin(halt, None, None))

    def again(self, operation: op.Operation) -> Halting | None:
        """Take back what it ends -> the equal halt that is not done and does for this one, too; None without any."""
        self._make_way(operation)
        same = self._halts.same(operation, self._overtakes(operation)) if isinstance(operation, ENDS) else None
        if same is not None:
            self._interrupt(same)
        return same

    def _interrupt(self, halting: Halting) -> None:
        """What is only being prepared is begun anew behind a halt that goes first."""
        if halting.first and self._interruptible is not None:
            self._interruptible.cancel()

    async def woken(self) -> None:
        """Wait for what is to wake the mount, if anything is. Not for motions: it may wait behind them."""
        if self._wakes:
            await asyncio.wait(self._wakes)

    async def _stopped(self) -> None:
        """Wait for the stop that is under way, if there is one."""
        while self._stopping is not None and not self._stopping.done():
            await asyncio.wait({self._stopping})

    async def ended(self, task: asyncio.Task[Any]) -> Any:
        """Wait for a motion that was begun. Raises Fault, and Stopped when a stop came first."""
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            if task.cancelled():
                raise Stopped from None
            raise

    def _make_way(self, operation: op.Operation) -> None:
        """A halt ends what would set its axis moving, the end of gotos those that wait, a newer rate an older one."""
        for task, other in list(self._jobs.items()):
            halted = isinstance(operation, op.Halt) and axis_moved(other) == operation.axis
            if isinstance(operation, LATEST) and task is not self._at_turn:
                halted = (axis_moved(other), type(other)) == (axis_moved(operation), type(operation))
            if halted or (isinstance(operation, op.CancelGoto) and isinstance(other, GOTOS)):
                task.cancel()

    def _overtakes(self, operation: op.Operation) -> bool:
        """Whether it goes before all that waits; not before a goto, which it may have to end."""
        return isinstance(operation, ENDS) and not any(
            isinstance(job, GOTOS) and not task.cancelling() for task, job in self._jobs.items())

    def _ended(self, task: asyncio.Task[Any]) -> None:
        operation = self._jobs.pop(task)
        self._halts.ended(operation, task)
        self._hub.snapshot.version += 1
        _heed(task)

    async def _run(self, operation: op.Operation, stops: int, life: Life | None) -> Any:
        task = asyncio.current_task()
        assert task is not None
        wakes = isinstance(operation, op.Wake) and self._hub.driver.asleep  # what is before it would not be heard
        halting = self._halts.find(operation, task)
        rank = FIRST if wakes or (halting is not None and halting.first) else IN_ORDER
        while True:
            async with self._turn.taken(rank):
                self._at_turn = task
                await self._stopped()
                if self._too_late(operation, stops):
                    raise Stopped
                work = self._hub.loop.create_task(self._carry_out(operation, halting))
                waits = isinstance(operation, BEGUN_ANEW) or (halting is not None and halting.hammered)
                self._interruptible = work if waits else None
                try:
                    carried_out, value = await work
                    break
                except asyncio.CancelledError:
                    if task.cancelling():
                        raise
                    rank = RESUMED
                    if isinstance(operation, op.Move | op.MoveAxis):  # perhaps the mount has heard of it
                        self._begun(operation, life)
                except Fault:
                    half_begun = rank is RESUMED and isinstance(operation, MOVING)
                    not_ended = isinstance(operation, ENDS) and not self._hub.driver.asleep
                    if not_ended or half_begun:  # whatever should have ended, or may move, must end
                        self.begin_stop()
                    raise
                finally:
                    self._interruptible = None
        self._begun(carried_out, life)
        return value

    def _too_late(self, operation: op.Operation, stops: int) -> bool:
        """Whether a stop has come since it was asked for, or the end of all."""
        lasts = isinstance(operation, op.Halt) or operation.outlives_stop
        return self._hub.closed or (stops != self.stops and not lasts)

    def _begun(self, operation: op.Operation, life: Life | None) -> None:
        self._after(operation)
        self._hub.dead_man.began(operation, life)

    async def _carry_out(self, operation: op.Operation, halting: Halting | None) -> tuple[op.Operation, Any]:
        """-> the operation as it was admitted, and its answer."""
        operation = await self._checks.admit(operation)
        if isinstance(operation, MOVING):
            await self._hub.before_motion()
        elif isinstance(operation, op.Sleep) and (self._hub.moving or self._hub.driver.unrestored):
            await self.stop()
        rank = MOTION if halting is None else SETTING if halting.hammered else STOP
        return operation, await self._hub.drive(self._hub.driver.perform(operation), rank)

    async def _go_on(self) -> None:
        """One axis was ended: what still moves must be allowed without it."""
        try:
            await self._checks.still_allowed()
        except Fault as fault:
            self._hub.transcript.note("mount", f"stopped: {fault}")
            self.begin_stop()

    # --- what is known afterwards -----------------------------------------------------------------------------------

    def _after(self, operation: op.Operation) -> None:
        """What is known without asking, once an operation has been carried out."""
        snapshot = self._hub.snapshot
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._hub.guard.began(operation)
        if isinstance(operation, GOTOS):
            self.gotos += 1
            self.by_hand.clear()
            self._hub.ends.moves((1, 2))
            snapshot.put(op.Slewing, True, self._hub.now())
            snapshot.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            self.by_hand[operation.axis] = operation
            self._hub.ends.moves((operation.axis,))
            snapshot.changed(op.Position)  # it must be watched from now on
        elif isinstance(operation, op.Halt):
            moved = self.by_hand.pop(operation.axis, None)
            if moved is not None:
                self._hub.ends.sent((operation.axis,), self._hub.driver.speed(moved.rate))
            self._hub.guard.halted()
            if self.by_hand:
                self._hub.spawn(self._go_on())
            else:
                self._hub.guard.ended()
        elif isinstance(operation, op.CancelGoto):
            snapshot.put(op.Slewing, False, self._hub.now())
        elif isinstance(operation, op.Sync):
            status, here = snapshot.value(op.GetStatus), snapshot.value(op.Position)
            if status is not None and status.aligned and here is not None:
                there = self._hub.derived.from_mount(op.Equatorial(operation.ra, operation.dec))
                self._hub.synced = self._hub.synced.added(here, there, status.equatorial)
            aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
            snapshot.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Sleep | op.Wake):
            snapshot.forget(op.GetStatus)
            if isinstance(operation, op.Sleep):
                self._at_rest()
                self._hub.slumber.begun()
        self._hub.changed()

    # --- later ------------------------------------------------------------------------------------------------------

    def plan(self, later: Later) -> None:
        """Have a follow-up performed after some seconds; the same one planned again replaces the first."""
        hub = self._hub
        old = self._later.pop(later.operation, None)
        if old is not None:
            old.cancel()
        if later.urgent:
            hub.line.expect_urgent(hub.now() + later.seconds)
        self._later[later.operation] = hub.loop.call_later(later.seconds, self._begin_follow_up, later)

    def _begin_follow_up(self, later: Later) -> None:
        self._later.pop(later.operation, None)
        task = self._hub.spawn(self._follow_up(later.operation, later.urgent))
        if not later.urgent:
            self._jobs[task] = later.operation
            task.add_done_callback(self._ended)

    async def _follow_up(self, operation: op.Operation, urgent: bool) -> None:
        special = self._follow_ups.get(type(operation))
        driver = self._hub.driver
        try:
            async with self._turn.taken(FIRST if urgent else IN_ORDER):
                self._at_turn = asyncio.current_task()
                await self._stopped()
                steps = special(driver, operation) if special else driver.perform(operation)
                await self._hub.drive(steps, STOP if urgent else MOTION)
            self._hub.changed()
        except Fault as fault:
            self._hub.transcript.note("mount", f"{type(operation).__name__}: {fault}")
            if urgent:
                self.begin_stop()

    async def settle(self) -> None:
        """Wait for what outlives a stop: hand controls may need to be told twice to track again."""
        while self._hub.line.state == "up" and self._hub.line.served and (self._later or self._jobs):
            await asyncio.sleep(0.05)

    def close(self) -> None:
        """Forget everything that was planned or waits."""
        for handle in self._later.values():
            handle.cancel()
        for task in list(self._jobs):
            task.cancel()
