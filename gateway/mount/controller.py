"""The controller of one mount: builds its parts, each of which knows only those before it, and is their interface to
all other layers.

The parts report back by signals. Reads are answered from the cache while they are fresh, and share one exchange if they
are not. While any client polls, the cache is refreshed, so a hundred polling clients load the mount's line like one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import TypeVar, cast

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, NotAligned
from gateway.mount.context import Context
from gateway.mount.identification import Identification
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate, ReplyVerifier
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.order_runner import Announce, Consequences, OrderRunner
from gateway.mount.motion.outcomes import ended_short
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.orders import Orders
from gateway.mount.policy import Policy
from gateway.mount.presence import NOBODY, Presence, Program
from gateway.mount.readings.cache import MAX_AGE, NOT_CACHED
from gateway.mount.readings.poller import Poller
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.motions import Admission
from gateway.mount.safety.unattended import SunAhead, Supervisor, TrackingAtLimit
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.shutdown import end_motion
from gateway.mount.site.readers import ReadBy
from gateway.mount.site.settings import SiteAndClock
from gateway.mount.site.settings_sync import SyncSettings
from gateway.protocols.base.driver import FollowUps

_T = TypeVar("_T")


class MountController:
    """``perform`` carries out any operation and waits for it, ``begin`` does not wait; ``impossible`` returns why an
    operation cannot succeed. ``peek`` answers a read at once if that needs no exchange, ``read`` waits if it does, and
    ``read_now`` asks the mount however fresh the last reading is. ``fresh_until`` returns how long answers may be given
    again, and ``touch`` notes that they were. ``announcers``: see ``OrderRunner``.
    """

    def __init__(self, context: Context, follow_ups: FollowUps, announcers: Sequence[Announce] = ()) -> None:
        self.context, self.driver, line, site_clock = context, context.driver, context.link, context.site_clock
        self.line, self.site_clock, self.wire_log = line, site_clock, context.log
        self.now, self.spawn, self.loop = context.now, context.tasks.spawn, asyncio.get_running_loop()
        # State: readings of the mount, what is wanted of it, its site and clock.
        cache, wanted, self.movement = context.cache, context.wanted, context.movement
        self.cache, self.wanted, self.sources, self.suns = cache, wanted, context.sources, context.suns
        self.astrometry = context.astrometry
        # Exchanges with the mount.
        gate = HibernationGate(context)
        self.verifier = ReplyVerifier(line, self.now, self.driver.speed_factor)
        runner = DriverRunner(context, self.verifier, gate)
        # Readings.
        reader = self.reader = Reader(context, runner)
        self.read, self.read_now = reader.read, reader.read_now
        self.touch, self.fresh_until = cache.touch, reader.fresh_until
        context.run_on.sent = runner.may_move
        sync = SyncSettings(context, runner, reader)
        self.settings = SiteAndClock(context, runner, sync)
        # Limits and motion.
        self.hold, self.synced, self.ends = context.hold, context.synced, EndWatch(self.now, context.note)
        watch = self.watch = LimitWatch(context, reader, self.ends)
        sync.moved_by_others = lambda: watch.moved_by_others
        self.admission = Admission(context, reader, watch)
        reader.goto_over.connect(watch.goto_ended)
        reader.position.connect(watch.check_position)
        self.sun_ahead = SunAhead(context, reader, watch)
        reader.position.connect(self.sun_ahead.check)
        reader.axes.connect(watch.check_altitude_axis)
        reader.unseen.connect(watch.position_missing)
        reader.status.connect(self._on_status)
        self.order_runner = OrderRunner(context, follow_ups, runner, self.admission, announcers)
        reconciler = self.reconciler = Reconciler(context, runner, self.order_runner)
        #: Emitted when the state that is saved to disk may have changed.
        self.changed = reconciler.lasting
        consequences = Consequences(context, gate, reader, watch, self.ends)
        reconciler.begins.connect(consequences.begins)
        reconciler.done.connect(consequences.done)
        reconciler.stop_sent.connect(consequences.stop_sent)
        reconciler.at_rest.connect(consequences.at_rest)
        context.run_on.changed.connect(self._hold_pulses)
        watch.must_stop.connect(self._stop_now)
        self.ends.again.connect(reconciler.send_again)
        reader.goto_over.connect(reconciler.arrived)
        reader.goto_missed.connect(lambda words: reconciler.want(ended_short(reconciler.wanted, words)))
        reader.goto_over.connect(lambda _: context.run_on.ended(goto=True, latest=reader.latest()))
        # Orders of clients, supervision of the motions that they begin, identification, polling.
        self.orders = Orders(context, runner, reader, self.settings, reconciler)
        self.perform, self.begin, self.impossible = self.orders.perform, self.orders.begin, self.orders.impossible
        TrackingAtLimit(context, reader, watch, self.orders.perform).must_stop.connect(self._stop_now)
        self.presence = Presence(self.now)
        self.supervisor = Supervisor(context, self.presence, self.orders.perform)
        reconciler.done.connect(self.supervisor.start_watching)
        self.identification = Identification(context, runner, gate, reader, sync, reconciler, self.ends)
        self.identification.identified.connect(self._on_identified)
        self.identified, self.settled = context.known, context.settled
        self.poller = Poller(context, gate, reader, self.settings, watch, self.ends)
        #: The signals that make earlier answers outdated, besides the cache.
        self._changes = wanted.changed, site_clock.changed

    def _on_status(self, status: op.Status) -> None:
        """Forget the sum of syncs if the mount is not aligned."""
        if not status.aligned:
            self.synced.forget()

    def _hold_pulses(self, until: float) -> None:
        """Let guide pulses wait for a mount that runs on."""
        self.reconciler.want(replace(self.reconciler.wanted, rests_by=until))

    def _stop_now(self, why: str) -> None:
        self.reconciler.begin_stop(why)

    def _on_identified(self, _: None) -> None:
        """Set the equinox of the mount's coordinates, which its identity implies."""
        chosen = self.context.policy.equinox or self.driver.default_equinox
        self.astrometry.equinox = self.driver.equinox if chosen == "auto" else chosen

    # --- start and end --------------------------------------------------------------------------------------------

    def start(self, refresh: bool = True) -> None:
        """Open the line and identify the mount; ``refresh`` the cache from then on."""
        self.line.start()
        if refresh:
            self.poller.start()

    async def close(self) -> None:
        """End motion, resume tracking, cancel pending orders, close the line."""
        await end_motion(self.context, self.reader, self.reconciler)
        self.context.closed = True
        self.context.found.set()  # callers that wait for the mount continue, and find the line closed
        self.context.known.set()
        self.reconciler.close()
        self.supervisor.close()
        await self.context.tasks.close()
        await self.line.close()

    # --- state ----------------------------------------------------------------------------------------------------

    @property
    def policy(self) -> Policy:
        return self.context.policy

    @property
    def moving(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return self.movement.anything

    @property
    def slewing(self) -> bool:
        return self.movement.slewing

    @property
    def version(self) -> int:
        """A number that grows whenever an answer may have changed, so that cached replies are outdated."""
        wanted, site_clock = self._changes
        return self.cache.version + wanted.count + site_clock.count

    @property
    def stops(self) -> int:
        """The number of stops so far: a motion that a client asked for before the last stop is not begun."""
        return self.wanted.value.stops

    def peek(self, operation: op.Operation[_T], program: Program = NOBODY) -> _T:
        """Return the answer to a client's read if it is cached; NOT_CACHED if it must be requested."""
        answer: object
        if isinstance(operation, op.Own):
            answer = self.reader.peek_own(operation, program)
        elif type(operation) in MAX_AGE:
            answer = self.reader.peek(type(operation))
        elif (answer := ReadBy(self.site_clock, program).answer(type(operation))) is None:
            answer = NOT_CACHED
        return cast(_T, answer)

    async def preview(self, goal: op.Equatorial) -> Fault | None:
        """Return what a goto there would be refused with now; None if the mount would be sent there.

        The mount is not asked: what only it can tell is not foreseen.
        """
        if not self.context.known.is_set():
            return NoAnswer()
        refusal = await self.admission.preview(goal) or self.impossible(op.Goto(goal.ra, goal.dec))
        status: op.Status | None = self.cache.value(op.GetStatus)
        if refusal is None and not self.driver.sync_aligns and status is not None and not status.aligned:
            return NotAligned()
        return refusal

    def begin_stop(self, by: str = "") -> None:
        """End every motion, before everything else, without waiting for the acknowledgement. ``by``: who asks."""
        self.wanted.stopped_by = by
        self.reconciler.begin_stop("")

    async def stop(self, by: str = "") -> None:
        """End every motion, and wait until the mount has acknowledged the stop. Raises Fault."""
        self.wanted.stopped_by = by
        await self.reconciler.stop("")
