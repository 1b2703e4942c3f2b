"""The controller of one mount: builds its parts, in an order in which each knows only those before it, and is the one
that everybody outside asks.

What goes back up goes by signals. Reads are answered from the cache while they are fresh and share one exchange when
they are not; while any client polls, the cache is refreshed, so a hundred pollers cost the mount's line what one costs.
"""

from __future__ import annotations

import asyncio
from typing import TypeVar, cast

from gateway.core import operations as op
from gateway.core.waiting import FairScheduler
from gateway.mount.context import Context
from gateway.mount.identification import Identification
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate
from gateway.mount.link.verification import ReplyVerifier
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.order_runner import Consequences, OrderRunner
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.orders import Orders
from gateway.mount.policy import Policy
from gateway.mount.presence import Presence
from gateway.mount.readings.own_answers import OwnAnswers
from gateway.mount.readings.poller import Poller
from gateway.mount.readings.reader import Reader
from gateway.mount.readings.told_position import ToldPosition
from gateway.mount.safety.admission.motions import Admission
from gateway.mount.safety.unattended import Supervisor, TrackingAtLimit
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.shutdown import end_motion
from gateway.mount.site.settings import SiteAndClock
from gateway.mount.site.settings_sync import SyncSettings
from gateway.protocols.base.driver import FollowUps

_T = TypeVar("_T")


class MountController:
    """``perform`` carries out any operation, ``begin`` one that nobody waits for; ``impossible`` says why nothing can
    come of one. ``peek`` answers a read at once when that needs no exchange, ``read`` waits for one where it does, and
    ``anew`` asks the mount however fresh the last answer is; ``fresh_until`` says how long answers may be told again,
    and ``touch`` that they were.
    """

    def __init__(self, context: Context, follow_ups: FollowUps) -> None:
        self.context, self.driver, line, site_clock = context, context.driver, context.link, context.site_clock
        self.line, self.site_clock, self.wire_log = line, site_clock, context.log
        self.now, self.spawn, self.loop = context.now, context.tasks.spawn, asyncio.get_running_loop()
        # What is known: of the mount, of what is wanted of it, of where and when it is.
        cache, wanted, self.movement = context.cache, context.wanted, context.movement
        self.cache, self.wanted, self.sources, self.suns = cache, wanted, context.sources, context.suns
        self.astrometry = context.astrometry
        # Exchanges with the mount.
        gate = HibernationGate(context)
        self.verifier = ReplyVerifier(line, self.now, self.driver.speed_factor)
        runner = DriverRunner(context, self.verifier, gate)
        self.fair_scheduler = FairScheduler(self.loop, lambda: wanted.ending)
        # Reading it.
        told = self.told_position = ToldPosition(context)
        reader = self.reader = Reader(context, runner, self.fair_scheduler, told)
        self.read, self.anew = reader.read, reader.anew
        self.touch, self.fresh_until = cache.touch, told.fresh_until
        runner.stirs.connect(told.stirs)
        self.own = OwnAnswers(context, runner, self.fair_scheduler)
        sync = SyncSettings(context, runner, reader)
        self.settings = SiteAndClock(context, runner, sync)
        # Keeping it within its limits, and moving it.
        self.hold, self.synced, self.ends = context.hold, context.synced, EndWatch(self.now, context.note)
        watch = self.watch = LimitWatch(context, reader, self.ends, lambda: sync.sets_sky)
        self.admission = Admission(context, reader, watch)
        reader.goto_over.connect(watch.arrived)
        reader.position.connect(watch.look)
        reader.axes.connect(watch.look_at_altitude)
        reader.unseen.connect(watch.unseen)
        reader.status.connect(self._status_came)
        self.order_runner = OrderRunner(context, follow_ups, runner, self.admission)
        reconciler = self.reconciler = Reconciler(context, runner, self.order_runner)
        #: Emitted when something that outlives the gateway may have changed.
        self.changed = reconciler.lasting
        consequences = Consequences(context, gate, told, watch, self.ends)
        reconciler.begins.connect(consequences.begins)
        reconciler.done.connect(consequences.done)
        reconciler.stop_sent.connect(consequences.stop_sent)
        reconciler.at_rest.connect(consequences.at_rest)
        watch.must_stop.connect(self._stop_now)
        self.ends.again.connect(reconciler.send_again)
        reader.goto_over.connect(reconciler.arrived)
        # Whoever asks for something, and whoever looks after what was begun.
        self.orders = Orders(context, runner, reader, self.own, self.settings, reconciler)
        self.perform, self.begin, self.impossible = self.orders.perform, self.orders.begin, self.orders.impossible
        TrackingAtLimit(context, reader, watch, self.orders.perform).must_stop.connect(self._stop_now)
        self.presence = Presence(self.now)
        self.supervisor = Supervisor(context, self.presence, self.orders.perform)
        reconciler.done.connect(self.supervisor.look_after)
        self.identification = Identification(context, runner, gate, reader, self.own, sync, reconciler, self.ends)
        self.identification.told.connect(self._found_equinox)
        self.identified, self.settled = context.known, context.settled
        self.poller = Poller(context, gate, reader, self.settings, watch, self.ends)
        #: What answers are made of, and whatever may outdate one.
        self._changes = cache.changed, wanted.changed, site_clock.changed, told.changed

    def _status_came(self, status: op.Status) -> None:
        """A mount that is not aligned has no sky that syncs could have moved."""
        if not status.aligned:
            self.synced.forget()

    def _stop_now(self, _: None) -> None:
        self.begin_stop()

    def _found_equinox(self, _: None) -> None:
        """The mount has said who it is, and with that what its coordinates mean."""
        if self.context.policy.equinox == "auto":
            self.astrometry.equinox = self.context.told_astrometry.equinox = self.driver.equinox

    # --- life -----------------------------------------------------------------------------------------------------

    def start(self, refresh: bool = True) -> None:
        """Open the line, find out what is on it, and keep the cache fresh, unless somebody else decides on that."""
        self.line.start()
        if refresh:
            self.poller.start()

    async def close(self) -> None:
        """End motion, put tracking back, forget what was planned, close the line."""
        await end_motion(self.context, self.reader, self.reconciler)
        self.context.closed = True
        self.context.met.set()  # whoever waits for the mount goes on, and finds the line closed
        self.context.known.set()
        self.reconciler.close()
        self.supervisor.close()
        self.reader.close()
        await self.context.tasks.close()
        await self.line.close()

    # --- what is known --------------------------------------------------------------------------------------------

    @property
    def policy(self) -> Policy:
        return self.context.policy

    @property
    def moving(self) -> bool:
        """Whether anything moves that a stop should end."""
        return self.movement.anything

    @property
    def slewing(self) -> bool:
        return self.movement.slewing

    @property
    def version(self) -> int:
        """Grows whenever an answer changes: what was made from older ones is then out of date."""
        answers, wanted, site_clock, told = self._changes
        return answers.count + wanted.count + site_clock.count + told.count

    @property
    def stops(self) -> int:
        """How many stops there were: a motion that was asked for before the last one is not begun."""
        return self.wanted.value.stops

    def peek(self, operation: op.Operation[_T]) -> _T:
        """The answer of a read for a program, when it is at hand; MISSING when it must be waited for."""
        told: object = self.own.tell(operation) if isinstance(operation, op.Own) else self.told_position.tell(operation)
        return cast(_T, told)

    def begin_stop(self) -> None:
        """End every motion, before everything else; from now on it counts as stopped."""
        self.reconciler.begin_stop()

    async def stop(self) -> None:
        """The same, and wait until the mount has acknowledged it. Raises Fault."""
        await self.reconciler.stop()
