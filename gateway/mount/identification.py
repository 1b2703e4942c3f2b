"""Identifies the mount each time the line comes up. A stop that the mount has not acknowledged is repeated before that.

If the mount moved when the line was lost, a stop is the first command on the restored line. After a longer loss, a
person may be using the hand control, so the motion of the mount is observed first (``left_moving.py``). A mount that
was not identified before is probed first, because a mount of another kind might misread the bytes of a stop.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.astro.axes import Pair
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.core.motion_kinds import MOVERS
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate
from gateway.mount.link.queue import POSITION, READ, STOP
from gateway.mount.motion import changes
from gateway.mount.motion.ends import MIN_VISIBLE_SPEED, AxisSample, EndWatch
from gateway.mount.motion.left_moving import (
    MAX_MARK_AGE,
    SAMPLE_GAP,
    SAMPLES_TIMEOUT,
    Leftover,
    axes_still_moving,
    axis_speeds,
    find_leftover,
    is_at_rest,
)
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.motion.seen import axis_sample
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.contradictions import log_contradictions
from gateway.mount.safety.watch import CLOSE_WATCH_TIME
from gateway.mount.shutdown import stop_commands
from gateway.mount.site.settings_sync import SettingsSender

#: Seconds between two attempts to identify a mount that does not reply.
RETRY_PERIOD = 1.0


class Identification:
    """Identifies the mount each time the line comes up, compares it with its last record, and emits ``identified``."""

    def __init__(
        self,
        context: Context,
        runner: DriverRunner,
        gate: HibernationGate,
        reader: Reader,
        settings_sender: SettingsSender,
        reconciler: Reconciler,
        end_watch: EndWatch,
        check_same_mount: Callable[[], Awaitable[None]],
    ) -> None:
        self._context, self._driver = context, context.driver
        self._link, self._cache, self._runner, self._gate = context.link, context.cache, runner, gate
        self._reader, self._sender, self._reconciler, self._end_watch = reader, settings_sender, reconciler, end_watch
        self._check_same_mount = check_same_mount
        self._identify_task: asyncio.Task[Any] | None = None
        self.identified: Signal[None] = Signal()
        #: Whether the mount moved when the port was lost; the loop time of the loss; that motion (None: unclear).
        self._motion_interrupted, self._lost_at = False, 0.0
        self._leftover_motion: Leftover | None = None
        self._status_when_lost: op.Status | None = None
        self._link.came_up.connect(self._on_line_up)
        self._link.reopened.connect(self._stop_interrupted_motion)
        self._link.writing_stop.connect(self._add_pending_stop)
        self._link.port_lost.connect(self._on_port_lost)

    def _on_port_lost(self, _: None) -> None:
        if self._motion_interrupted or not (self._reconciler.busy or self._end_watch.is_watching):
            return
        self._motion_interrupted, self._lost_at = True, self._context.now()
        self._leftover_motion = None if self._end_watch.is_watching else self.leftover_motion()
        self._status_when_lost = self._cache.last_value(op.GetStatus)

    def leftover_motion(self) -> Leftover | None:
        """Return the motion of this gateway that is under way now; None without one, or if positions cannot show it."""
        return find_leftover(self._reconciler.wanted, self._context.driver.speed, self._end_watch.samples)

    def set_leftover_motion(self, motion: Leftover) -> None:
        """Set the motion that an earlier run of the gateway did not end. If the mount still makes it, it is stopped."""
        self._leftover_motion = motion

    def _stop_interrupted_motion(self, _: None) -> None:
        """Stop the mount if it moved when the port was lost. After a long loss, `_stop_leftover_motion` decides."""
        old = self._leftover_motion is not None and self._context.now() - self._lost_at >= MAX_MARK_AGE
        if self._motion_interrupted and old and not self._reconciler.wanted.stop_owed:
            self._motion_interrupted = False
        elif self._motion_interrupted:
            self._motion_interrupted, self._leftover_motion = False, None
            self._context.note(
                "the connection to the mount was lost during a motion and is open again: the mount is stopped first"
            )
            self._reconciler.begin_stop("stopped when the connection to the mount was lost and restored")

    def _add_pending_stop(self, commands: list[bytes]) -> None:
        """Add the bytes of a stop to ``commands`` if an identified mount has not acknowledged the last stop, or if no
        position has confirmed yet that the mount stopped and no newer motion is being sent.
        """
        wanted = self._reconciler.wanted
        active = wanted.active_order
        begins = active is not None and isinstance(active.operation, MOVERS)
        if (wanted.stop_owed or (self._end_watch.is_watching and not begins)) and self._context.identified.is_set():
            commands += stop_commands(self._driver, self._link.reply_rules, without_restores=True)

    def _on_line_up(self, _: None) -> None:
        self._cache.clear()
        self._driver.on_line_up()
        if self._driver.goto is not None and self._driver.goto.unconfirmed:  # poll it until the mount reports its end
            self._cache.put(op.Slewing, True, self._context.now())
        self._gate.allow_next_read()
        self._sender.pause()
        if self._identify_task is not None:
            self._identify_task.cancel()
        self._identify_task = self._context.tasks.spawn(self._identify())

    async def _identify(self) -> None:
        """Repeat an unacknowledged stop or stop motion left over, then read identity, status, site and clock."""
        if self._reconciler.wanted.stop_owed:
            with contextlib.suppress(Fault):
                if not self._context.identified.is_set():
                    await self._runner.drive(self._driver.probe(), STOP)
                await self._reconciler.stop()
        elif self._leftover_motion is not None and self._context.identified.is_set():
            await self._stop_leftover_motion(self._leftover_motion)
        identified = False
        while self._cache.last_value(op.GetIdentity) is None:
            identified = identified or await self._contact_mount()
            if identified:
                await self.read_once(op.GetIdentity())
            if self._link.state != "up":
                return  # identification begins again when the line is up
            if self._cache.last_value(op.GetIdentity) is None:
                await asyncio.sleep(RETRY_PERIOD)
        if self._reconciler.wanted.stop_owed:  # the mount did not acknowledge the first stop, but it replies now
            self._reconciler.begin_stop()
        elif self._leftover_motion is not None:
            await self.read_once(op.GetStatus())
            await self.read_once(op.GetSite())
            await self._stop_leftover_motion(self._leftover_motion)
        await self._check_same_mount()
        self.identified.emit(None)
        self._context.replied.set()
        self._context.identified.set()
        await self.read_once(op.GetStatus())
        await self.read_once(op.GetSite())
        self._context.site_clock.note_site_requested()
        if self._has_wrong_hemisphere():
            await self.read_once(op.GetStatus())
        await self.read_once(op.GetClock())
        self._sender.resume()
        self._context.site_read.set()
        log_contradictions(self._context)

    async def _contact_mount(self) -> bool:
        """Return whether a mount replies; cache the position if its first reply contains one."""
        try:
            place = await self._runner.drive(self._driver.contact(), READ)
        except Fault as fault:
            if not isinstance(fault, NoAnswer):
                self._context.note_once(str(fault))
            return False
        if place is not None:
            self._reader.take_reading(op.Position(), place)
            self._context.replied.set()
        return True

    # --- motion that was left behind ----------------------------------------------------------------------------------

    async def _stop_leftover_motion(self, motion: Leftover) -> None:
        """Stop this motion if the mount still makes it, or if that is unclear. Do not stop any other motion."""
        context, reconciler = self._context, self._reconciler
        self._leftover_motion = None
        axes: frozenset[int] = frozenset()
        with contextlib.suppress(Fault, TimeoutError):
            async with asyncio.timeout(SAMPLES_TIMEOUT):
                slewing = await self._reports_goto() and (
                    not motion.goto or await self._reports_goto()
                )  # the first report may be outdated
                if slewing != motion.goto:  # a goto has ended, or has replaced an arrow
                    self._leave_motion_alone()
                    return
                rates = (0.0, 0.0) if slewing else await self._measure_speed()
            axes = frozenset((1, 2)) if slewing else axes_still_moving(motion, rates)
            if not axes and not is_at_rest(rates):
                self._leave_motion_alone()
                return
            if len(axes) == 1 and abs(rates[2 - min(axes)]) >= MIN_VISIBLE_SPEED:
                [axis] = axes
                reconciler.accept(op.StopAxis(axis), None, None)
                context.note(f"axis {axis} still moved as the gateway had left it: it is stopped")
                return
        if axes:
            context.note("the mount still moved as the gateway had left it: it is stopped")
        reconciler.begin_stop()

    def _leave_motion_alone(self) -> None:
        reconciler = self._reconciler
        self._context.note("the mount no longer moves as the gateway had left it: what moves now is left alone")
        reconciler.update(changes.after_acknowledged_stop(reconciler.wanted))
        self._context.tasks.spawn(self._resume_tracking_later(reconciler.wanted.order_count))

    async def _resume_tracking_later(self, order_count: int) -> None:
        """Resume the tracking that the driver suspended for a motion, once the mount is at rest. A newer order cancels
        this; ``order_count`` is the number of orders until now.
        """
        resting = False
        while self._driver.tracking_suspended and self._reconciler.wanted.order_count == order_count and not resting:
            await asyncio.sleep(CLOSE_WATCH_TIME)
            with contextlib.suppress(Fault):
                resting = is_at_rest(await self._measure_speed()) and not await self._reports_goto()
        if resting and self._driver.tracking_suspended and self._reconciler.wanted.order_count == order_count:
            self._reconciler.begin_stop()

    async def _reports_goto(self) -> bool:
        """Return whether the mount reports a goto, whoever has begun it. Raises Fault."""
        self._driver.moved_by_others = True
        return bool(await self._runner.perform(op.Slewing(), READ))

    async def _measure_speed(self) -> Pair:
        """Return the speeds of both axes, degrees a second, measured from two positions. Raises Fault."""
        before = await self._read_axes()
        await asyncio.sleep(max(0.0, before.time + SAMPLE_GAP - self._context.now()))
        return axis_speeds(before, await self._read_axes())

    async def _read_axes(self) -> AxisSample:
        """Read the position and return it as axis readings. Raises Fault."""
        context, astrometry = self._context, self._context.astrometry
        place = astrometry.from_mount_equinox(await self._runner.perform(op.Position(), POSITION))
        status = self._status_when_lost or self._cache.last_value(op.GetStatus)
        return axis_sample(astrometry, status, getattr(self._driver, "low", False), context.now(), place)

    def _has_wrong_hemisphere(self) -> bool:
        """Whether the mount has reported a southern site after its status was decoded as tracking in the north."""
        place, status = self._context.sources.site(), self._cache.last_value(op.GetStatus)
        north = status is not None and status.tracking is op.Tracking.EQ_NORTH
        return north and place is not None and place.latitude < 0.0

    async def read_once(self, operation: op.Operation) -> None:
        """Ask the mount once and store the answer. Raises nothing: silence is ignored, another fault is logged."""
        try:
            value = await self._runner.perform(operation, READ)
        except NoAnswer:
            return
        except Fault as fault:
            self._context.note(str(fault))
            return
        if isinstance(value, op.Place | op.Moment):
            self._sender.take_reported_value(value)
        else:
            self._cache.put(type(operation), value, self._context.now())
