"""The controller of one mount: builds its parts, and passes each operation of a client to the part that answers it:
readings, motions, site and clock, or astronomy.

Each part uses only parts that were built before it; the others are connected by signals. Reads are answered from
the cache while they are fresh, and otherwise share one exchange. While any client polls, the cache is refreshed, so a
hundred polling clients load the mount's line like one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from math import inf
from typing import Any, TypeVar, cast

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, NotAligned, Stopped, Unsupported
from gateway.core.motion_kinds import SEQUENTIAL_ORDERS
from gateway.core.waiting import Outcome, result_of
from gateway.mount.as_left import SameMountCheck
from gateway.mount.context import Context
from gateway.mount.identification import Identification
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate, ReplyVerifier
from gateway.mount.link.queue import SETTING
from gateway.mount.motion.changes import after_goto_end, after_goto_failure
from gateway.mount.motion.consequences import Consequences
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.reconciler import Announce, Reconciler
from gateway.mount.motion.wanted import Slew
from gateway.mount.policy import Limits, Policy
from gateway.mount.presence import NO_PROGRAM, ClientPresence, HostActivity, ProgramId
from gateway.mount.readings.cache import MAX_AGE, NOT_CACHED
from gateway.mount.readings.poller import Poller
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.motions import MotionAdmission
from gateway.mount.safety.unattended import ClientSupervisor, SunApproachWatch, TrackingLimiter
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.shutdown import end_motion
from gateway.mount.site.places import POSITION_FUNCTIONS
from gateway.mount.site.readers import SiteView
from gateway.mount.site.settings import SiteClockOperations
from gateway.mount.site.settings_sync import SettingsSender
from gateway.protocols.base.driver import FollowUps

_T = TypeVar("_T")


class MountController:
    """Carries out operations on one mount: ``perform`` waits for the end, ``begin`` does not. ``certain_fault`` returns
    the reason why an operation cannot succeed. ``peek`` answers a client's read if the answer is cached; ``answer``
    asks the mount if it is not. The gateway itself uses ``read``, and ``read_now``, which never uses the cache.
    ``fresh_until``: the loop time until which a client may get the same answers again. ``touch`` notes that a client
    polls. ``announcers`` are awaited before any command that sets the mount moving.
    """

    def __init__(self, context: Context, follow_ups: FollowUps, announcers: Sequence[Announce] = ()) -> None:
        self.context, self.driver, line, site_clock = context, context.driver, context.link, context.site_clock
        self.line, self.site_clock, self.wire_log = line, site_clock, context.log
        self.now, self.spawn, self.loop = context.now, context.tasks.spawn, asyncio.get_running_loop()
        # State: readings of the mount, the orders to it, its site and clock.
        cache, wanted, self.movement = context.cache, context.wanted, context.movement
        self.cache, self.wanted, self.sources, self.suns = cache, wanted, context.sources, context.suns
        self.astrometry = context.astrometry
        # Exchanges with the mount.
        gate = HibernationGate(context)
        self.verifier = ReplyVerifier(line, self.now, self.driver.speed_factor)
        runner = self._runner = DriverRunner(context, self.verifier, gate)
        # Readings.
        reader = self.reader = Reader(context, runner)
        self.read, self.read_now = reader.read, reader.read_now
        self.touch, self.fresh_until, self.certain_fault = cache.note_polled, reader.fresh_until, context.certain_fault
        context.run_on.may_move = runner.may_move
        sync = SettingsSender(context, runner, reader)
        self.site_settings = SiteClockOperations(context, runner, sync)
        # Limits and motion.
        self.owners_limits = context.policy.limits
        self.hold, self.syncs, self.end_watch = context.hold, context.syncs, EndWatch(self.now, context.note, wanted)
        watch = self.watch = LimitWatch(context, reader, self.end_watch)
        sync.moved_by_others = lambda: watch.moved_by_others
        self.admission = MotionAdmission(context, reader, watch)
        reader.goto_over.connect(watch.on_goto_end)
        reader.position_read.connect(watch.check_position)
        self.sun_approach_watch = SunApproachWatch(context, reader, watch)
        reader.position_read.connect(self.sun_approach_watch.check)
        reader.axes_read.connect(watch.hour_angle.take_reading)
        reader.position_failed.connect(watch.on_no_position)
        reader.status_read.connect(self._on_status)
        consequences = Consequences(context, gate, reader, watch, self.end_watch)
        reconciler = self.reconciler = Reconciler(context, follow_ups, runner, self.admission, consequences, announcers)
        #: Emitted when the state that the gateway saves to disk may have changed.
        self.save_due = reconciler.saved_state_changed
        #: Guide pulses wait for a mount that runs on.
        context.run_on.changed.connect(lambda until: reconciler.update(replace(reconciler.wanted, pulses_from=until)))
        watch.must_stop.connect(reconciler.begin_stop)
        self.end_watch.resend_needed.connect(reconciler.stop_again)
        reader.goto_over.connect(lambda _: reconciler.update(after_goto_end(reconciler.wanted)))
        reader.goto_missed.connect(lambda reason: reconciler.update(after_goto_failure(reconciler.wanted, reason)))
        reader.goto_over.connect(lambda _: context.run_on.begin(after_goto=True, position=reader.latest_position()))
        # Supervision of motions, identification, polling.
        TrackingLimiter(context, reader, watch, self.perform).must_stop.connect(reconciler.begin_stop)
        self.presence = ClientPresence(self.now)
        self.supervisor = ClientSupervisor(context, self.presence, self.perform)
        reconciler.client_motion_began.connect(self.supervisor.start_watching)
        self.same_mount_check = SameMountCheck(context, runner)
        reader.position_read.connect(self.same_mount_check.record_position)
        self.identification = Identification(
            context, runner, gate, reader, sync, reconciler, self.end_watch, self.same_mount_check.check
        )
        self.identification.identified.connect(self._on_identified)
        self.identified, self.site_read = context.identified, context.site_read
        self.poller = Poller(context, gate, reader, self.site_settings, watch, self.end_watch)
        #: Signals after which earlier answers are outdated; the cache counts its own changes.
        self._outdating_signals = wanted.changed, site_clock.changed

    def _on_status(self, status: op.Status) -> None:
        """Reset the sum of syncs if the mount reports that it is not aligned."""
        if not status.aligned:
            self.syncs.reset()

    def _on_identified(self, _: None) -> None:
        """Set the equinox of the mount's coordinates: the owner's choice, else what its identity implies."""
        chosen = self.context.policy.equinox or self.driver.default_equinox
        self.astrometry.equinox = self.driver.equinox if chosen == "auto" else chosen

    # --- start and end --------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin to open the line, to identify the mount and to keep the readings fresh; return at once."""
        self.line.start()
        self.poller.start()

    async def close(self) -> None:
        """End motion, resume tracking, cancel pending orders, close the line."""
        await end_motion(self.context, self.reader, self.reconciler)
        self.context.closed = True
        self.context.replied.set()  # callers that wait for the mount continue, and find the line closed
        self.context.identified.set()
        self.reconciler.close()
        self.supervisor.close()
        await self.context.tasks.close()
        await self.line.close()

    # --- state ----------------------------------------------------------------------------------------------------

    @property
    def policy(self) -> Policy:
        return self.context.policy

    def narrow_limits(self, **requested_limits: float | None) -> Limits:
        """Set limits within the owner's until the gateway ends; None: as the owner's. Raises Invalid if wider."""
        limits = self.owners_limits.narrowed_by_page(**requested_limits)
        self.context.policy = replace(self.policy, limits=limits)
        self.suns.set_min_distance(limits.sun)
        self.watch.narrow_limits(limits.lowest, limits.highest, limits.hour_angle)
        return limits

    @property
    def moving(self) -> bool:
        """Whether a motion is under way that a stop should end."""
        return self.movement.any_motion

    @property
    def slewing(self) -> bool:
        return self.movement.slewing

    @property
    def answer_version(self) -> int:
        """A number that grows whenever an answer may have changed, so that cached replies are outdated."""
        wanted, site_clock = self._outdating_signals
        return self.cache.version + wanted.count + site_clock.count

    @property
    def stop_count(self) -> int:
        """The number of stops since the start. A motion that a client requested before the last stop is not begun."""
        return self.wanted.value.stop_count

    def peek(self, operation: op.Operation[_T], program: ProgramId = NO_PROGRAM) -> _T:
        """Return the answer to a client's read if it is cached; NOT_CACHED if it must be requested."""
        answer: object
        if isinstance(operation, op.NativeRequest):
            answer = self.reader.peek_native(operation, program)
        elif type(operation) in MAX_AGE:
            answer = self.reader.peek(type(operation))
        elif (answer := SiteView(self.site_clock, program).answer(type(operation))) is None:
            answer = NOT_CACHED
        return cast(_T, answer)

    async def answer(self, operation: op.Operation[_T], activity: HostActivity | None = None) -> _T:
        """Return the answer to a read, from the cache if possible. Raises Fault."""
        cached = self.peek(operation, activity.program if activity is not None else NO_PROGRAM)
        return await self.perform(operation, activity=activity) if cached is NOT_CACHED else cached

    async def preview_goto(self, goal: op.Equatorial) -> Fault | None:
        """Return the fault with which a goto would be refused now; None if it would be allowed.

        This sends nothing to the mount, so it cannot foresee the mount's own refusals.
        """
        if not self.context.identified.is_set():
            return NoAnswer()
        refusal = await self.admission.preview(goal) or self.certain_fault(op.Goto(goal.ra, goal.dec))
        status: op.Status | None = self.cache.last_value(op.GetStatus)
        if refusal is None and not self.driver.sync_aligns and status is not None and not status.aligned:
            return NotAligned()
        return refusal

    # --- operations of clients --------------------------------------------------------------------------------------

    async def perform(
        self,
        operation: op.Operation[_T],
        stop_count: int | None = None,
        activity: HostActivity | None = None,
        max_delay: float = inf,
        arrived_at: float | None = None,
    ) -> _T:
        """Carry out an operation for the connection ``activity``, and return its answer. Raises Fault.

        Most reads ask the mount even if the answer is cached; ``answer`` uses the cache first. For motions,
        ``arrived_at`` is the loop time at which the request arrived (default: now), ``stop_count`` the number of stops
        before that (a later stop cancels it), and ``max_delay`` for how many seconds the client waits for it.
        """
        program = activity.program if activity is not None else NO_PROGRAM
        if type(operation) in MAX_AGE:
            if self.driver.asleep and (waking := self.reconciler.outcomes_of_kind(op.Wake)):
                await asyncio.wait(waking)  # reads wait for the wake-up; motions do not, it may wait behind them
            return cast(_T, await self.reader.answer(operation))
        if isinstance(operation, op.NativeRequest):
            return cast(_T, await self.reader.answer_native(operation, program))
        if isinstance(operation, op.AbortMotion):
            return cast(_T, await self.stop(activity.host if activity is not None else ""))
        if isinstance(operation, op.AbortSlew):
            self._note_stop(activity.host if activity is not None else "")
        if isinstance(operation, SEQUENTIAL_ORDERS):
            value = await _wait_for_outcome(
                self.reconciler.accept(operation, stop_count, activity, max_delay, arrived_at)
            )
            if isinstance(value, op.Chosen) and value.place is not None:
                value = op.Chosen(self.astrometry.from_mount_equinox(value.place), value.text, value.reply)
            return cast(_T, value)
        return cast(_T, await self._perform_unshared(operation, program))

    async def _perform_unshared(self, operation: op.Operation, program: ProgramId) -> Any:
        """Carry out an operation that is neither a motion nor a read that clients share. Raises Fault."""
        if type(operation) in POSITION_FUNCTIONS:
            return POSITION_FUNCTIONS[type(operation)](self.context.astrometry_for(program), operation)
        if (setting := self.site_settings.handlers.get(type(operation))) is not None:
            answer = await setting(operation, program)
            self.save_due.emit(None)
            return answer
        if isinstance(operation, op.GetActivity):
            position_age = self.cache.age(op.Position, self.now())
            return self.context.run_on.activity(self.wanted.value, self.driver.parked, position_age)
        if isinstance(operation, op.GetAbilities):  # by the tables, and by the mount's model and version
            return self.driver.abilities((await self.reader.read(op.GetStatus())).equatorial)
        if isinstance(operation, op.TubeSide):
            reported = await self.reader.read(op.PierSide())
            if not self.driver.german:
                raise Unsupported("Only a German mount has two sides of the pier.")
            if (side := self.driver.tube_side(reported)) is not None:
                return side
            return reported if self.astrometry.site().latitude >= 0.0 else {"E": "W", "W": "E"}[reported]
        answer = await self._runner.perform(operation, SETTING)
        if not isinstance(operation, op.Read):
            self.save_due.emit(None)
        return answer

    def begin(
        self,
        operation: op.Operation,
        stop_count: int,
        on_failure: Callable[[Fault], None],
        activity: HostActivity,
        arrived_at: float | None = None,
    ) -> asyncio.Future[None]:
        """Carry out an operation without waiting for it; ``on_failure`` is called with the Fault if it fails."""
        outcome = None
        if isinstance(operation, op.AbortSlew):
            self._note_stop(activity.host)
        if isinstance(operation, SEQUENTIAL_ORDERS):
            outcome = self.reconciler.accept(operation, stop_count, activity, arrived_at=arrived_at)

        async def finish() -> None:
            try:
                await (_wait_for_outcome(outcome) if outcome is not None else self.perform(operation, stop_count))
            except Fault as fault:
                on_failure(fault)
            except Exception as error:  # no caller waits for this task, so a defect must be logged here
                self.context.note(f"internal error, please report it: {error!r}")
                self.reconciler.stop_after_defect()

        return self.spawn(finish())

    def begin_stop(self, client_name: str = "") -> None:
        """Stop every motion, without waiting for the mount's acknowledgement. ``client_name`` is for the log."""
        self._note_stop(client_name)
        self.reconciler.begin_stop("")

    async def stop(self, client_name: str = "") -> None:
        """Stop every motion, and wait until the mount has acknowledged the stop. Raises Fault."""
        self._note_stop(client_name)
        await self.reconciler.stop("")

    def _note_stop(self, client_name: str) -> None:
        """Record which client stops the mount, and log it if that ends a goto before its goal."""
        self.wanted.stopped_by = client_name
        if isinstance(self.wanted.value.motion, Slew):
            self.context.note(f"the goto was stopped before its goal{f' by {client_name}' if client_name else ''}")


async def _wait_for_outcome(outcome: Outcome) -> Any:
    """Return the result of an order, which goes on if the caller is cancelled. Raises Fault; Stopped if superseded."""
    try:
        return await result_of(outcome)
    except asyncio.CancelledError:
        if outcome.cancelled():
            raise Stopped from None
        raise
