"""The hub: the one owner of a mount.

Reads are answered from a snapshot while it is fresh and share one exchange when it is not; while any client polls,
the snapshot is refreshed in the background, so a hundred pollers cost the mount's line what one costs. Motions, and
site and clock, have files of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar, cast

from msgspec import Struct

from gateway.astro.ephemeris import Sky
from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, Held, NoAnswer
from gateway.core.motion_kinds import GOTOS, MOTIONS, begins_motion
from gateway.core.wire_log import Transcript
from gateway.mount.execution import HubExecutor
from gateway.mount.fair_scheduler import FairScheduler
from gateway.mount.identification import Identification
from gateway.mount.link.hibernation import HibernationGate
from gateway.mount.link.queue import SETTING, STOP, MountLink
from gateway.mount.link.verification import ReplyVerifier
from gateway.mount.motion.awaited import ended
from gateway.mount.motion.end_watch import EndWatch
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.readings.cache import FRESH, Kind, ReadingsCache
from gateway.mount.readings.own_answers import OwnAnswers
from gateway.mount.readings.poller import Poller
from gateway.mount.readings.reader import Reader
from gateway.mount.readings.told_position import Telling
from gateway.mount.safety.limits import Limits
from gateway.mount.safety.rules.dead_man import HostActivity, Presence
from gateway.mount.safety.rules.held import Hold
from gateway.mount.safety.rules.sun import SunAvoidance
from gateway.mount.safety.rules.sync_sum import SyncSum
from gateway.mount.safety.supervisor import Supervisor
from gateway.mount.safety_inputs import make_rules
from gateway.mount.shutdown import end_motion
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.mount.site.ephemeris_reads import PLACES
from gateway.mount.site.settings import SiteAndClock
from gateway.mount.site.site_clock import SiteClock
from gateway.mount.site.sources import BestSources
from gateway.protocols.base.driver import Driver, Steps


async def _at_once() -> None:
    """Nobody needs to know before a motion."""


_T = TypeVar("_T")


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


class MountController:
    """``perform`` carries out any operation; ``peek`` answers a read at once when that needs no exchange."""

    def __init__(
        self,
        driver: Driver,
        follow_ups: dict[type[Any], Callable[[Any, Any], Any]],
        line: MountLink,
        sky: Sky,
        observatory: SiteClock,
        transcript: Transcript,
        policy: Policy = Policy(),
    ) -> None:
        self.driver, self.line, self.observatory = driver, line, observatory
        self.transcript, self.policy = transcript, policy
        self.loop = asyncio.get_running_loop()
        self.now = self.loop.time
        self.sources = BestSources(observatory)
        #: Astronomy by the best sources, for the limits and for horizon coordinates; and by what programs are told.
        self.derived = SiteAstrometry(sky, self.sources, policy.equinox)
        self.told = SiteAstrometry(sky, observatory, policy.equinox)
        self.snapshot = ReadingsCache()
        self.belief = ReplyVerifier(line, self.now, driver.hurry)
        self.reader, self.identification = Reader(self), Identification(self)
        #: The mount has said who it is; it has said where and when it is, as far as it can.
        self.identified, self.settled = self.identification.known, self.identification.settled
        self.suns = SunAvoidance(self.derived, transcript, policy.limits.sun, self.settled.is_set)
        #: How far the syncs since the alignment have moved the sky together.
        self.synced = SyncSum()
        self.ends = EndWatch(self.now, self._end_again, lambda text: transcript.note("mount", text))
        self.hold = Hold()
        self.guard, self.checks = make_rules(self)
        self.executor, self.presence = HubExecutor(self), Presence(self.now)
        self.supervisor = Supervisor(
            self.presence, policy.silence, policy.silence_closed, self.perform, self.executor.note
        )
        self.motions = Reconciler(driver, self.executor, follow_ups)
        self.slumber = HibernationGate(driver, self.now, lambda: self.motions.waking)
        self.refresh = Poller(self)
        self.telling, self.own = Telling(self), OwnAnswers(self)
        self.settings = SiteAndClock(self)
        #: Called when something that outlives the gateway may have changed; awaited before the mount is set moving.
        self.changed: Callable[[], None] = lambda: None
        self.before_motion: Callable[[], Awaitable[None]] = _at_once
        self.closed = False  # when it is, nothing is begun any more
        self.turnstile = FairScheduler(self.loop, lambda: self.motions.ending)
        self._tasks: set[asyncio.Task[Any]] = set()

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
        self.identification.met.set()  # whoever waits for that is to hear that nothing comes
        self.identified.set()
        self.motions.close()
        self.supervisor.close()
        self.reader.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.line.close()

    def spawn(self, work: Any) -> asyncio.Task[Any]:
        """Run something in the background and hold on to it."""
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    # --- asking ---------------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        """Whether anything moves that a stop should end."""
        return bool(self.motions.axes) or self.slewing

    def impossible(self, operation: op.Operation) -> Fault | None:
        """Why nothing can come of an operation, as far as that is known without asking: no may be said at once."""
        if self.line.state == "down" or (self.line.overdue and not self.driver.asleep):
            return NoAnswer()
        sleeps = (self.driver.asleep or self.driver.powerless) and not self.motions.waking
        if sleeps and begins_motion(operation):
            return Asleep()
        if self.line.occupied and begins_motion(operation) and not isinstance(operation, GOTOS):  # which wait for it
            return Busy()
        try:
            if isinstance(operation, MOTIONS):
                self.hold.admit(operation)
        except Held as fault:
            return fault
        return self.motions.impossible(operation) if self.identified.is_set() else None

    @property
    def slewing(self) -> bool:
        return bool(self.snapshot.value(op.Slewing))

    def peek(self, operation: op.Operation[_T]) -> _T:
        """The answer of a read for a program, when it is at hand; MISSING when it must be waited for."""
        told: object = self.own.tell(operation) if isinstance(operation, op.Own) else self.telling.tell(operation)
        return cast(_T, told)

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

    async def perform(
        self,
        operation: op.Operation[_T],
        stops: int | None = None,
        life: HostActivity | None = None,
        patience: float = math.inf,
    ) -> _T:
        """Carry out an operation for ``life``. ``stops`` is the count of stops when it was asked for. Raises Fault.

        Nobody is told what came of it after ``patience`` seconds.
        """
        if type(operation) in FRESH:
            if self.driver.asleep:
                await self.motions.woken()
            return cast(_T, await self.telling.read(operation))
        if isinstance(operation, op.Own):
            return cast(_T, await self.own.read(operation))
        try:
            return cast(_T, await self._order(operation, stops, life, patience))
        finally:
            if not isinstance(operation, op.Read):
                self.own.forget()

    async def _order(
        self, operation: op.Operation, stops: int | None, life: HostActivity | None, patience: float
    ) -> Any:
        """Whatever is no question that everybody shares."""
        if isinstance(operation, op.Stop):
            return await self.stop()
        if isinstance(operation, MOTIONS):
            value = await ended(self.motions.begin(operation, stops, life, patience))
            if isinstance(value, op.Chosen) and value.place is not None:
                value = op.Chosen(self.derived.from_mount(value.place), value.text, value.reply)
            return value
        if type(operation) in PLACES:
            return PLACES[type(operation)](self.told, operation)
        handler = self.settings.handlers.get(type(operation))
        if handler is not None:
            return await handler(operation)
        return await self.drive(self.driver.perform(operation), SETTING)

    def begin(
        self, operation: op.Operation, stops: int, failed: Callable[[Fault], None], life: HostActivity
    ) -> asyncio.Future[None]:
        """Carry out an operation that nobody waits for; ``failed`` is told when it was not."""
        motion = self.motions.begin(operation, stops, life) if isinstance(operation, MOTIONS) else None

        async def finish() -> None:
            try:
                await (ended(motion) if motion is not None else self.perform(operation, stops))
            except Fault as fault:
                failed(fault)
            except Exception as error:  # a defect must not be lost because nobody waits for what came of it
                self.transcript.note("mount", f"internal error, please report it: {error!r}")
                if self.motions.busy:
                    self.begin_stop()  # what failed may have been what should have ended a motion

        return self.spawn(finish())

    def at_hand(self, operation: op.Operation) -> Any:
        """What the mount said last, when it is fresh enough; MISSING when it must be asked."""
        return self.reader.at_hand(operation)

    async def read(self, operation: op.Operation) -> Any:
        """What the mount says, at hand or by an exchange that everyone who asks shares. Raises Fault."""
        return await self.reader.read(operation)

    async def asked(self, operation: op.Operation) -> Any:
        """The answer of the exchange under way, or of a new one. Raises Fault."""
        return await self.reader.asked(operation)

    async def anew(self, operation: op.Operation) -> Any:
        """A read from the mount, however fresh the last answer is. Raises Fault."""
        return await self.reader.anew(operation)

    async def tube_side(self) -> str | None:
        """The side of the pier (E, W) that the tube of a German mount is on; None where nobody tells."""
        return await self.reader.tube_side()

    async def drive(self, steps: Steps, rank: int) -> Any:
        """Carry out a driver's generator: exchanges, pauses, things to do later. Raises Fault."""
        return await self.executor.drive(steps, rank)
