"""Motion that no client attends: by hand after its client has gone, tracking to a limit, the Sun coming to the tube.

Dead man's switch: fast motion by hand, and motion of the focuser, ends when the client that began it is no longer
active. Rates up to 60" a second count as tracking by the client and continue; gotos end by themselves. Tracking that
reaches a limit is turned off, and again if it is turned on again; a mount that drifts on with tracking off is reported
once. If the Sun will come near a tube that rests or tracks, the user is warned a quarter of an hour before. The gateway
does not move the tube away, because it begins no motion by itself.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable

from msgspec import Struct

from gateway.astro.spherical import SIDEREAL_RATE, separation
from gateway.core import operations as op
from gateway.core.errors import Fault, Unsupported
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.motion.seen import NEVER
from gateway.mount.motion.wanted import HandMove, Wanted
from gateway.mount.presence import ClientPresence, HostActivity
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.watch import MAX_STATUS_AGE, LimitWatch
from gateway.mount.site.astrometry import Sun
from gateway.mount.site.site_clock import MOUNT_SOURCE

#: Degrees a second; a motion by hand up to this speed counts as tracking by the client.
MAX_TRACKING_SPEED = 60.0 / 3600.0
#: Seconds between two checks of the clients.
CHECK_PERIOD = 0.5
#: Seconds: how far ahead the Sun's path is examined, and in what steps; the time between two examinations, and until
#: the next one if the mount's status is not known yet.
LOOK_AHEAD_TIME, LOOK_AHEAD_STEP, RECHECK_PERIOD, FIRST_RECHECK_DELAY = 900.0, 60.0, 30.0, 1.0
#: Seconds after tracking was switched off during which cached readings from before may still show that it is on.
OLD_READING_TIME = 12.0
#: The beginning of the message that tracking was switched off at a limit.
SWITCHED_OFF_MESSAGE = "tracking was switched off at"
WAY_OUT_ADVICE = "cover the tube, or move it away."


class SupervisedMotion(Struct, frozen=True):
    """A motion that needs an active client: the operation that ends it, the client, and when it began."""

    end_operation: op.Operation
    client: HostActivity
    began_at: float


class ClientSupervisor:
    """Ends the motions of clients that went silent. ``perform`` carries out the operation that ends a motion."""

    def __init__(
        self, context: Context, presence: ClientPresence, perform: Callable[[op.Operation], Awaitable[object]]
    ) -> None:
        self._context, self._wanted_state, self._presence, self._perform = context, context.wanted, presence, perform
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._ended_motions: set[SupervisedMotion] = set()

    def start_watching(self, _: object = None) -> None:
        """Start the timer of the checks, if there is a motion to supervise and the timer is not running."""
        if self._timer is None and supervised_motions(self._wanted_state.value):
            self._timer = self._loop.call_later(CHECK_PERIOD, self._check_clients)

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _check_clients(self) -> None:
        self._timer = None
        motions, policy = supervised_motions(self._wanted_state.value), self._context.policy
        for motion, why in abandoned_motions(
            motions, self._presence, self._loop.time(), policy.dead_man, policy.dead_man_closed
        ):
            if motion not in self._ended_motions:
                self._ended_motions.add(motion)
                what = "the focuser" if isinstance(motion.end_operation, op.Focus) else "its motion"
                self._context.note(f"{motion.client.host} {why}: {what} is stopped")
                self._context.tasks.spawn(self._end_motion(motion.end_operation))
        self._ended_motions.intersection_update(motions)
        self.start_watching()

    async def _end_motion(self, operation: op.Operation) -> None:
        try:
            await self._perform(operation)
        except Fault as fault:
            self._context.note(f"the motion could not be stopped: {fault}")


def supervised_motions(wanted: Wanted) -> list[SupervisedMotion]:
    """Return the motions that need an active client."""
    moments = []
    if isinstance(wanted.motion, HandMove):
        moments += [
            SupervisedMotion(op.StopAxis(axis), motion.client, motion.began_at)
            for axis, motion in wanted.motion
            if motion.client is not None and motion.speed > MAX_TRACKING_SPEED
        ]
    if wanted.focus_motion is not None and wanted.focus_motion.client is not None:
        moments.append(SupervisedMotion(op.Focus(0), wanted.focus_motion.client, wanted.focus_motion.began_at))
    return moments


def abandoned_motions(
    motions: Iterable[SupervisedMotion], presence: ClientPresence, now: float, max_silence: float, max_away: float
) -> list[tuple[SupervisedMotion, str]]:
    """Return the motions whose client has disconnected or has been silent for too long, each with the reason as text.

    Silence on an open connection is allowed for ``max_silence`` seconds, absence without one for ``max_away`` seconds.
    """
    moments = []
    for motion in motions:
        activities = presence.connections_for(motion.client)
        for activity in activities:
            if activity.sent_data:
                activity.sent_data, activity.last_active_at = False, now
        left = [activity.closed_at for activity in activities if activity.closed_at is not None]
        if len(left) == len(activities) and now - max(motion.began_at, *left) >= max_away:
            moments.append((motion, "has disconnected"))
        elif now - max(motion.began_at, *(activity.last_active_at for activity in activities)) >= max_silence:
            moments.append((motion, f"has sent nothing for {max_silence:g} s"))
    return moments


class TrackingLimiter:
    """Turns tracking off when ``watch`` reports that tracking carries the mount to a limit.

    ``perform`` carries out an operation. ``must_stop`` is emitted if tracking cannot be turned off: then everything
    must be stopped.
    """

    def __init__(
        self, context: Context, reader: Reader, watch: LimitWatch, perform: Callable[[op.Operation], Awaitable[object]]
    ) -> None:
        self._context, self._reader, self._perform = context, reader, perform
        self._watch, self._switching_off = watch, False
        #: Loop times at which tracking proved impossible to turn off, and at which the mount drifted with tracking off.
        self._refused_at = self._drifts_since = NEVER
        #: When tracking was last switched off here.
        self._switched_off_at = NEVER
        self.must_stop: Signal[str] = Signal()
        watch.carried_to_limit.connect(self.switch_off)

    def switch_off(self, reason: str) -> None:
        began, tracked, now = self._watch.observed.began_at, self._watch.tracked_at, self._context.now()
        drifts = self._drifts_since > max(began, tracked)
        if drifts and self._context.cache.age(op.GetStatus, now) > MAX_STATUS_AGE:
            self._reader.shared_task(op.GetStatus())
        elif not (self._switching_off or drifts or self._refused_at > began):
            self._switching_off = True
            self._context.tasks.spawn(self._switch_off(reason))

    async def _switch_off(self, reason: str) -> None:
        context = self._context
        try:
            if (await self._reader.read(op.GetStatus())).tracking is op.Tracking.OFF:
                if context.now() - self._switched_off_at > OLD_READING_TIME:
                    context.note(
                        f"WARNING: tracking is off, but the mount is drifting past {reason}; there is nothing to stop"
                    )
                    self._drifts_since = context.now()
                return
            await self._perform(op.SetTracking(on=False))
            self._switched_off_at = context.now()
            context.note(f"{SWITCHED_OFF_MESSAGE} {reason}")
        except Unsupported:
            self._refused_at = context.now()
            # at rest: the mount has not reached it by tracking
            sky_changed = self._watch.sky_change.changed_at > self._watch.observed.began_at
            context.note(f"{'WARNING: the mount is' if sky_changed else 'stopped'} at {reason}")
            context.note_once("this mount's tracking cannot be switched off at a limit")
            if not sky_changed:
                self.must_stop.emit(f"stopped at {reason}")
        except Fault as fault:
            context.note(f"tracking could not be switched off at {reason} and continues beyond it: {fault}")
        finally:
            self._switching_off = False


class SunApproachWatch:
    """Warns if the Sun will come near a tube at rest, or will rise near a tube that tracks.

    ``warning`` says when, and by which source of site and time; empty if it will not. Call ``check`` with every
    position.
    """

    def __init__(self, mount: Context, reader: Reader, watch: LimitWatch) -> None:
        self._mount, self._reader, self._watch = mount, reader, watch
        self._next_check = float("-inf")
        self.warning = ""

    def check(self, position: op.Equatorial) -> None:
        """Update ``warning`` by a position of the mount, at most twice a minute; log it if there was none before."""
        mount, now = self._mount, self._mount.now()
        if now < self._next_check or not mount.suns.min_dist:
            return
        self._next_check = now + RECHECK_PERIOD
        before, self.warning = self.warning, ""
        if mount.movement.any_motion or self._watch.moved_by_others or not mount.sources.sites():
            return
        status = mount.cache.last_value(op.GetStatus)
        if status is None or not status.aligned:
            self._next_check = now + FIRST_RECHECK_DELAY
            return
        self.warning = self._find_warning(position, tracks=status.tracking is not op.Tracking.OFF)
        if self.warning and not before:
            mount.note(f"WARNING: {self.warning}")

    def _find_warning(self, position: op.Equatorial, tracks: bool) -> str:
        """Return the warning for the earliest approach of the Sun, by any source; empty if there is none."""
        suns = self._mount.suns
        up = {(sun.sync_shift, sun.confirmed) for sun in suns.suns_to_avoid()}
        for minute in range(round(LOOK_AHEAD_TIME / LOOK_AHEAD_STEP) + 1):
            for sun in suns.calculate_suns(self._mount.tube_frame(), minute * LOOK_AHEAD_STEP):
                distance = self._distance(position, sun, 0.0 if tracks else minute * LOOK_AHEAD_STEP)
                if distance < suns.min_dist:
                    return self._warning_for(sun, distance, minute, (sun.sync_shift, sun.confirmed) not in up, tracks)
        return ""

    def _distance(self, position: op.Equatorial, sun: Sun, seconds: float) -> float:
        """Return the degrees to ``sun`` from a tube that stands still for ``seconds`` while the sky turns."""
        tube = self._mount.suns.pointing(position, sun.sync_shift)
        return separation(tube.ra + SIDEREAL_RATE * seconds, tube.dec, sun.ra, sun.dec)

    def _warning_for(self, sun: Sun, distance: float, minute: int, rises: bool, tracks: bool) -> str:
        source = sun.time.source if sun.site is None or sun.time.source != MOUNT_SOURCE else sun.site.source
        by = "" if sun.confirmed else f" by {source}"
        tube = f"the {'tracking' if tracks else 'resting'} tube"
        when = "" if minute == 0 else f" in {minute} minute{'s' * (minute != 1)}"
        if minute and not rises:
            return f"the Sun{by} comes within {self._mount.suns.min_dist:g} degrees of {tube}{when}: {WAY_OUT_ADVICE}"
        return f"the Sun{by} {'rises' if rises else 'is'} {distance:.0f} degrees from {tube}{when}: {WAY_OUT_ADVICE}"
