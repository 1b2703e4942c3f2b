"""The hub: the one owner of a mount.

Reads are answered from a snapshot while it is fresh and share one exchange when it is not; while any client polls,
the snapshot is refreshed in the background, so a hundred pollers cost the mount's line what one costs. Motions, and
site and clock, have files of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from msgspec import Struct

from gateway import operations as op
from gateway.driver import Driver, Steps
from gateway.errors import Fault, NoAnswer
from gateway.hub.belief import Belief
from gateway.hub.ending import end_motion, stop_commands
from gateway.hub.executor import HubExecutor
from gateway.hub.refresh import ASK_AGAIN, Refresh
from gateway.hub.rules import make_rules, say_doubts
from gateway.hub.settings import FIRST_ANSWER, SiteAndClock
from gateway.hub.slumber import Slumber
from gateway.hub.snapshot import FRESH, MISSING, Kind, Snapshot
from gateway.hub.telling import Telling
from gateway.hub.turnstile import Turnstile
from gateway.line import POSITION, READ, SETTING, STOP, Line
from gateway.motion_kinds import MOTIONS
from gateway.mount.motion.arrival import missed
from gateway.mount.motion.end_watch import EndWatch
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.motion.wanted import Slew
from gateway.mount.safety.dead_man import HostActivity, Presence
from gateway.mount.safety.held import Hold
from gateway.mount.safety.limits import Limits
from gateway.mount.safety.sun import SunAvoidance
from gateway.mount.safety.supervisor import Supervisor
from gateway.mount.safety.sync_sum import SyncSum
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.mount.site.ephemeris_reads import PLACES
from gateway.mount.site.sources import BestSources
from gateway.observatory import Observatory
from gateway.sky import Sky
from gateway.transcript import Transcript

#: How soon it is noticed that the mount has begun to move, seconds.
A_MOMENT = 0.2


async def _at_once() -> None:
    """Nobody needs to know before a motion."""


class Policy(Struct, frozen=True):
    """What the operator has decided for a mount.

    ``own_park``: the park position is his own choice. ``unaligned``: whether a mount that is not aligned may be sent to
    axis readings (``allow`` or ``refuse``). ``silence`` and ``silence_closed`` are for how many seconds a
    client that moves the mount by hand may be silent, on an open connection and after it was closed.
    """

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str = "jnow"
    own_park: bool = False
    unaligned: str = "refuse"
    silence: float = 30.0
    silence_closed: float = 5.0


class Hub:
    """``perform`` carries out any operation; ``peek`` answers a read at once when that needs no exchange."""

    def __init__(self, driver: Driver, follow_ups: dict[type[Any], Callable[[Any, Any], Any]], line: Line, sky: Sky,
                 observatory: Observatory, transcript: Transcript, policy: Policy = Policy()) -> None:
        self.driver, self.line, self.observatory = driver, line, observatory
        self.transcript, self.policy = transcript, policy
        self.loop = asyncio.get_running_loop()
        self.now = self.loop.time
        self.sources = BestSources(observatory)
        #: Astronomy by the best sources, for the limits and for horizon coordinates; and by what programs are told.
        self.derived = SiteAstrometry(sky, self.sources, policy.equinox)
        self.told = SiteAstrometry(sky, observatory, policy.equinox)
        self.snapshot = Snapshot()
        self.belief = Belief(line, self.now, driver.hurry)
        #: The mount has said who it is; it has said where and when it is, as far as it can.
        self.identified, self.settled = asyncio.Event(), asyncio.Event()
        self.suns = SunAvoidance(self.derived, transcript, policy.limits.sun, self.settled.is_set)
        #: How far the syncs since the alignment have moved the sky together.
        self.synced = SyncSum()
        self.ends = EndWatch(self.now, self._end_again, lambda text: transcript.note("mount", text))
        self.hold = Hold()
        self.guard, self.checks = make_rules(self)
        self.executor, self.presence = HubExecutor(self), Presence(self.now)
        self.supervisor = Supervisor(self.presence, policy.silence, policy.silence_closed, self.perform,
                                     self.executor.note)
        self.motions = Reconciler(driver, self.executor, follow_ups)
        self.slumber = Slumber(driver, self.now, lambda: self.motions.waking)
        self.refresh = Refresh(self)
        self.telling = Telling(self)
        self.settings = SiteAndClock(self)
        #: Called when something that outlives the gateway may have changed; awaited before the mount is set moving.
        self.changed: Callable[[], None] = lambda: None
        self.before_motion: Callable[[], Awaitable[None]] = _at_once
        self._identifying: asyncio.Task[Any] | None = None
        self._sharing: dict[Kind, asyncio.Task[Any]] = {}
        self.closed = False  # when it is, nothing is begun any more
        self.turnstile = Turnstile(self.loop, lambda: self.motions.ending)
        self._tasks: set[asyncio.Task[Any]] = set()
        #: Something moved when the mount's port was lost.
        self._cut_short = False
        line.on_up, line.first_words, line.talk.on_lost = self._on_up, self._first_words, self._on_lost

    # --- life -----------------------------------------------------------------------------------------------------

    def start(self, refresh: bool = True) -> None:
        """Open the line, find out what is on it, and keep the snapshot fresh, unless somebody else decides on that."""
        self.line.start()
        if refresh:
            self.refresh.start()

    async def close(self) -> None:
        """End motion, put tracking back, forget what was planned, close the line."""
        await end_motion(self)
        self.closed = True
        self.identified.set()  # whoever waits for that is to hear that nothing comes
        self.motions.close()
        self.supervisor.close()
        for task in [*self._tasks, *self._sharing.values()]:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.line.close()

    def spawn(self, work: Any) -> asyncio.Task[Any]:
        """Run something in the background and hold on to it."""
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _on_lost(self) -> None:
        self._cut_short = self._cut_short or self.motions.busy or self.ends.pending

    def _first_words(self) -> list[bytes]:
        """The port is open again: nothing that moved survives that. A mount that nobody knows yet is greeted first."""
        if self._cut_short:
            self._cut_short = False
            self.transcript.note("mount", "the line was lost while the mount moved: it is stopped, now that it is back")
            self.motions.begin_stop()
        known = self.motions.owed and self.identified.is_set()
        return stop_commands(self.driver, self.line.dialogue, ends_only=True) if known else []

    def _on_up(self) -> None:
        self.snapshot.clear()
        self.driver.line_was_lost()
        if self.driver.unsure:  # it is looked at until it is seen to be over
            self.snapshot.put(op.Slewing, True, self.now())
        self.slumber.doubt()
        self.settings.sync.doubt()
        if self._identifying is not None:
            self._identifying.cancel()
        self._identifying = self.spawn(self._identify())

    async def _identify(self) -> None:
        """Who is there, where it stands, what time it has. A stop that is owed goes before everything else."""
        if self.motions.owed:
            with contextlib.suppress(Fault):
                if not self.identified.is_set():
                    await self.drive(self.driver.greet(), STOP)
                await self.stop()
        while op.GetIdentity not in self.snapshot.seen:
            await self._learn(op.GetIdentity())
            if self.line.state != "up":
                return  # it is begun again when the line is up
            if op.GetIdentity not in self.snapshot.seen:
                await asyncio.sleep(ASK_AGAIN)
        if self.motions.owed:  # it did not answer to the stop, but it does now
            self.begin_stop()
        if self.policy.equinox == "auto":
            self.derived.equinox = self.told.equinox = self.driver.equinox
        self.identified.set()
        await self._learn(op.GetStatus())
        await self._learn(op.GetSite())
        await self._learn(op.GetClock())
        self.settings.sync.resume()
        self.settled.set()
        say_doubts(self)

    async def _learn(self, operation: op.Operation) -> None:
        """Ask for something that is told but once."""
        try:
            value = await self.drive(self.driver.perform(operation), READ)
        except NoAnswer:
            return
        except Fault as fault:
            self.transcript.note("mount", str(fault))
            return
        if isinstance(value, op.Place | op.Moment):
            self.settings.sync.heard(value)
        else:
            self.snapshot.put(type(operation), value, self.now())

    # --- asking ---------------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        """Whether anything moves that a stop should end."""
        return bool(self.motions.axes) or self.slewing

    @property
    def slewing(self) -> bool:
        return bool(self.snapshot.value(op.Slewing))

    def peek(self, operation: op.Operation) -> Any:
        """The answer of a read for a program, when it is at hand; MISSING when it must be waited for."""
        return self.telling.tell(operation)

    def at_hand(self, operation: op.Operation) -> Any:
        """What the mount said last, when it is fresh enough; MISSING when it must be asked."""
        kind = type(operation)
        if kind not in FRESH:
            known = self.settings.peek(kind)
            return MISSING if known is None else known
        if kind is op.Slewing and self.motions.goto_waits:
            return True
        now = self.snapshot.asked[kind] = self.now()
        return self.snapshot.fresh(kind, now, 2.5 * self.line.typical, self.line.state != "up")

    @property
    def version(self) -> int:
        """Grows whenever an answer changes: what was made from older ones is then out of date."""
        return self.snapshot.version

    @property
    def stops(self) -> int:
        """How many stops there were: a motion that was asked for before the last one is not begun."""
        return self.motions.stops

    def _end_again(self, axes: frozenset[int]) -> None:
        """An end that was sent is sent once more: the mount was seen to go on moving."""
        if len(axes) > 1:
            self.motions.send_stop()
            return

        async def send() -> None:
            with contextlib.suppress(Fault):  # it is sent again when the next position shows no difference
                await self.drive(self.driver.perform(op.Halt(*axes)), STOP)

        self.spawn(send())

    def begin_stop(self) -> None:
        """End every motion, before everything else; from now on it counts as stopped."""
        self.motions.begin_stop()

    async def stop(self) -> None:
        """The same, and wait until the mount has acknowledged it. Raises Fault."""
        await self.motions.stop()

    def fresh_until(self, kinds: list[Kind]) -> float:
        """The loop time until which the answers of these reads may be told."""
        return self.telling.fresh_until(kinds)

    def touch(self, kinds: list[Kind], now: float) -> None:
        """A client was served a repeated reply: it is polling what that was made of all the same."""
        for kind in kinds:
            self.snapshot.asked[kind] = now

    async def perform(self, operation: op.Operation, stops: int | None = None, life: HostActivity | None = None) -> Any:
        """Carry out an operation for ``life``. ``stops`` is the count of stops when it was asked for. Raises Fault."""
        if type(operation) in FRESH:
            if self.driver.asleep:
                await self.motions.woken()
            return await self.telling.read(operation)
        if isinstance(operation, op.Stop):
            return await self.stop()
        if isinstance(operation, MOTIONS):
            return await self.motions.ended(self.motions.begin(operation, stops, life))
        if type(operation) in PLACES:
            return PLACES[type(operation)](self.told, operation)
        handler = self.settings.handlers.get(type(operation))
        if handler is not None:
            return await handler(operation)
        return await self.drive(self.driver.perform(operation), SETTING)

    def begin(self, operation: op.Operation, stops: int, failed: Callable[[Fault], None],
              life: HostActivity) -> asyncio.Future[None]:
        """Carry out an operation that nobody waits for; ``failed`` is told when it was not."""
        motion = self.motions.begin(operation, stops, life) if isinstance(operation, MOTIONS) else None

        async def finish() -> None:
            try:
                await (self.motions.ended(motion) if motion is not None else self.perform(operation, stops))
            except Fault as fault:
                failed(fault)
            except Exception as error:  # a defect must not be lost because nobody waits for what came of it
                self.transcript.note("mount", f"internal error, please report it: {error!r}")
                if self.motions.busy:
                    self.begin_stop()  # what failed may have been what should have ended a motion

        return self.spawn(finish())

    async def read(self, operation: op.Operation) -> Any:
        """What the mount says, from the snapshot or by an exchange that everyone who asks shares. Raises Fault."""
        value = self.at_hand(operation)
        return await self.asked(operation) if value is MISSING else value

    async def asked(self, operation: op.Operation) -> Any:
        """The answer of the exchange under way, or of a new one; not long after the start. Raises Fault."""
        first = not self.identified.is_set()
        try:
            async with asyncio.timeout(FIRST_ANSWER if first else None):
                return await self.turnstile.outcome(self.shared(operation))
        except TimeoutError:
            raise NoAnswer from None

    async def anew(self, operation: op.Operation) -> Any:
        """A read from the mount, however fresh the last answer is; who gives up ends it for nobody. Raises Fault."""
        return await asyncio.shield(self.shared(operation))

    def shared(self, operation: op.Operation) -> asyncio.Task[Any]:
        """The exchange under way for this kind of read, else a new one. It belongs to all: nobody may cancel it."""
        kind = type(operation)
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = self.loop.create_task(self._ask(operation))
            task.add_done_callback(lambda done: self._unshare(kind, done))
        return task

    def _unshare(self, kind: Kind, task: asyncio.Task[Any]) -> None:
        self._sharing.pop(kind, None)
        if not task.cancelled():
            task.exception()  # whoever still waits gets it; nobody waiting is no error

    async def _ask(self, operation: op.Operation) -> Any:
        await self.identified.wait()
        kind, gotos = type(operation), self.motions.gotos
        source: Kind | None = None
        if isinstance(operation, op.AxisPosition) and not self.driver.way(op.AxisPosition):
            equatorial = (await self.read(op.GetStatus())).equatorial  # the axes of a fork are azimuth and altitude
            source = op.Position if equatorial else op.HorizontalPosition
            seen = await self.read(source())
            value: Any = self.derived.axes(seen) if equatorial else seen
        elif isinstance(operation, op.HorizontalPosition) and self.driver.position_reads > 1:
            value = await self._while_it_rests(operation)
        else:
            value = await self._hear(operation)
        if isinstance(operation, op.Slewing):
            if self.slewing and not value:
                await self._settled()
            value = value or gotos != self.motions.gotos  # a goto that has been begun meanwhile is under way
        if isinstance(operation, op.HorizontalPosition) and value is None:
            source, value = op.Position, self.derived.horizon(await self.read(op.Position()))
        if source is not None:
            self.telling.worked_out(kind, source)
        self.snapshot.put(kind, value, self.now())
        if isinstance(value, op.Status) and not value.aligned:
            self.synced = SyncSum()
        if isinstance(operation, op.Position):
            self.guard.look(value)
        elif isinstance(operation, op.AxisPosition):
            self.guard.look_at_altitude(value)
        return value

    async def _hear(self, operation: op.Operation) -> Any:
        """What the mount itself answers; a place together with when it was asked for it and when it was there."""
        rank = POSITION if isinstance(operation, op.Position) else READ
        try:
            value = await self.drive(self.driver.perform(operation), rank)
        except Fault:
            if isinstance(operation, op.Position):
                self.guard.unseen()
            raise
        self.refresh.cost(type(operation), self.executor.exchanges)
        if isinstance(operation, op.Position):
            value = self.derived.from_mount(value)
        if isinstance(value, op.Equatorial | op.Horizontal):
            half = self.line.typical / 2.0
            first, second = self.driver.halves or (self.now(), self.now())
            self.telling.came(type(operation), value, self.executor.asked_at, (first - half, second - half))
        return value

    async def _while_it_rests(self, operation: op.Operation) -> Any:
        """The answer, or None once the mount moves: then the line has no room for two positions in halves."""
        reading = self.spawn(self._hear(operation))
        try:
            while not self.moving:
                if (await asyncio.wait({reading}, timeout=A_MOMENT))[0]:
                    return reading.result()
            return None
        finally:
            reading.cancel()

    async def _settled(self) -> None:
        """A goto has just ended: nobody is told so before the position is known where it ended."""
        slew = self.motions.wanted.motion
        self.guard.arrived()
        self.motions.arrived()
        self.snapshot.forget(op.HorizontalPosition, op.AxisPosition, op.Position, op.PierSide)
        self.telling.anew()
        here = await self.telling.read(op.Position())
        if isinstance(slew, Slew) and isinstance(slew.operation, op.Goto) and not self.motions.axes:
            goal = self.derived.from_mount(op.Equatorial(slew.operation.ra, slew.operation.dec))
            if words := missed(goal, here):
                self.transcript.note("mount", words)

    async def tube_side(self) -> str | None:
        """The side of the pier (E, W) that the tube of a German mount is on; None where nobody tells."""
        if self.driver.tube_side("E") is None:
            return None
        try:
            return self.driver.tube_side(await self.read(op.PierSide()))
        except Fault:
            return None

    async def drive(self, steps: Steps, rank: int) -> Any:
        """Carry out a driver's generator: exchanges, pauses, things to do later. Raises Fault."""
        return await self.executor.drive(steps, rank)
