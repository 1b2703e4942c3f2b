"""Checks every position that the mount reports, and ends motion that would pass a limit.

All motion is watched: by clients, at the hand control, and tracking. Each position is added to the observed motion
(``seen.py``), and the rules are evaluated (``allow.py``). If the mount could pass a limit before the next position, it
is stopped now; tracking that carries it to a limit is turned off. If positions do not show a motion by hand that was
ordered, it is ended and reported. A change of coordinates because site or clock were set is no motion.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.motion_kinds import GOTOS, MOVERS
from gateway.core.signals import Signal
from gateway.mount.context import FASTEST_RATE, Context
from gateway.mount.motion import seen
from gateway.mount.motion.ends import MIN_STEP_UNITS, AxisSample, EndWatch
from gateway.mount.motion.seen import NEVER, ObservedMotion, PositionSample
from gateway.mount.motion.wanted import MotionState, Slew
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.altitudes import contradicting_sources, unsynced_sources
from gateway.mount.safety.admission.slew_paths import POINT_SPACING, axis_readings_at
from gateway.mount.safety.allow import (
    MAX_TRACKING_SPEED,
    MIN_POSITION_GAP,
    CheckedPath,
    JudgedState,
    Verdict,
    degrees_to_limits,
    farthest_from_suns,
    first_position_deadline,
    judge_motion,
)
from gateway.mount.safety.hour_angle import HourAngleWatch
from gateway.mount.site.pending_settings import AT_REST

#: If the position changes this many times faster than the mount can move, it was aligned anew at the hand control.
REALIGNED_FACTOR = 3.0
#: Seconds for which a mount may run on after the end of a motion; its positions meanwhile are not judged.
COASTING_TIME = 1.0
#: Seconds for which a status "not aligned" or "not tracking" is trusted.
MAX_STATUS_AGE = 5.0
NOT_ALIGNED_MESSAGE = "not aligned: positions mean nothing yet, so no limit can be watched"
#: Seconds without a position after which motion by hand is stopped; at least as many pass between two such stops.
MAX_BLIND_TIME = 1.0
#: An axis counts as stalled if it was commanded to move at least this fast, degrees a second, for at least this many
#: seconds, and has covered less than this fraction of the commanded distance.
STALL_MIN_SPEED, STALL_TIME, STALL_MIN_PART = 0.1, 3.0, 0.1
#: Seconds for which a mount that was moved at the hand control is watched closely.
CLOSE_WATCH_TIME = 3.0
#: Degrees from its calculated paths at which a goto is watched like a motion by hand.
ASTRAY_DEGREES = 3.0 + POINT_SPACING / 2.0
#: Degrees a second on the sky: guide pulses move the tube more slowly, even where right ascension changes fast.
MAX_GUIDE_SPEED = 0.01
#: The speed at which two axes together move the tube, as a multiple of that of one.
TWO_AXES_FACTOR = 1.42
#: Seconds after a goto in which the mount may still settle.
SETTLE_TIME = 2.0
#: Seconds: if the clock is set by more than this, positions before and after cannot be compared.
CLOCK_JUMP = 30.0
#: Seconds after site or clock was set during which a resting mount may still report positions by the old setting.
NEW_SITE_TIME = 3.0


class LimitWatch:
    """Watches the limits of a mount: ``check_position`` gets every position, ``on_motion_start`` every motion.

    ``must_stop`` is emitted with the reason: a forbidden or missing position, a missed deadline, or a stalled axis.
    ``carried_to_limit`` is emitted with the limit, as text, that the mount reaches although only tracking moves it.
    """

    def __init__(self, mount: Context, reader: Reader, end_watch: EndWatch) -> None:
        self._mount, self._reader, self._end_watch = mount, reader, end_watch
        self.must_stop: Signal[str] = Signal()
        self.carried_to_limit: Signal[str] = Signal()
        self._deadline, self._stalls = StopDeadline(asyncio.get_running_loop(), self._deadline_passed), StallWatch()
        self.observed = ObservedMotion()
        self._limits = mount.policy.limits
        self.others_watch, self._coasts_until, self._blind_stop_at = OthersWatch(), NEVER, NEVER
        #: Whether the mount was sent to a park position without altitude limits, and whether it has rested there.
        self._at_own_park = self._rested_at_park = False
        self._goto_is_astray = False
        self.sky_change = SkyChange(mount)
        #: Loop time of the last position while the mount may have been tracking.
        self.tracked_at = NEVER
        self.hour_angle = HourAngleWatch(mount, reader.tube_side)
        #: Loop times at which the last motion by hand and the last goto ended.
        self.at_rest_since = self._goto_ended_at = NEVER
        self.next_path = CheckedPath()
        #: What admission had found out about the path of the last motion when that motion began.
        self._current_path = CheckedPath()

    @property
    def moved_by_others(self) -> bool:
        """Whether the mount moves without an order of a client."""
        return self._mount.now() < self.others_watch.watch_closely_until

    @property
    def _is_moving(self) -> bool:
        return self._mount.movement.any_motion or self.moved_by_others

    def others_move(self, axis: int) -> bool:
        """Whether the last two positions show that somebody else moves this axis faster than any tracking.

        Motion soon after a goto belongs to it. On an alt-azimuth mount either axis counts, because both follow the sky.
        """
        mount, before, last, now = self._mount, self.observed.previous, self.observed.last, self._mount.now()
        if mount.movement.any_motion or mount.run_on.current is not None or now - self._goto_ended_at < SETTLE_TIME:
            return False
        if before is None or last is None or now - last.time > CLOSE_WATCH_TIME:
            return False
        if self.observed.sky_speed < MAX_GUIDE_SPEED:
            return False
        earlier, latest = (self._axis_sample(sample.time, sample.position) for sample in (before, last))
        least = max(MAX_TRACKING_SPEED * self.observed.elapsed, MIN_STEP_UNITS * latest.resolution)
        status = mount.cache.last_value(op.GetStatus)
        axes = (axis,) if status is None or status.equatorial else (1, 2)
        turned = [abs(wrap180(latest.angles[each - 1] - earlier.angles[each - 1])) for each in axes]
        return any(min(way, 180.0 - way) > least for way in turned)  # a pulse over the pole is no half turn

    @property
    def others_just_began(self) -> bool:
        """Whether the last position was the first to show motion by somebody else."""
        return self.others_watch.just_began

    @property
    def position_needed_within(self) -> float:
        """Seconds within which the next position is needed, so that motion at the hand control, which may begin at any
        time, is noticed before it can reach a limit that applies to it.
        """
        mount, last = self._mount, self.observed.last
        if last is None or self.hour_angle.has_limit:
            return 0.0
        nearest = min(degrees_to_limits(last, mount.policy.limits.for_keypad(), mount.suns.min_dist))
        return nearest / (TWO_AXES_FACTOR * mount.driver.speed(FASTEST_RATE)) - mount.stop_timing.reaction

    @property
    def max_commanded_speed(self) -> float:
        """The highest speed of the commanded motions under way, degrees a second; 0 if there are none."""
        moving = self._mount.movement.snapshot()
        if moving.slewing:
            return self.observed.sky_speed or self._mount.driver.speed(FASTEST_RATE)
        return max((self._mount.driver.speed(motion.rate) for motion in moving.hand_moves.values()), default=0.0)

    @property
    def on_clear_path(self) -> bool:
        """Whether the only motion is a goto on a path within the limits, and nothing else was ordered."""
        wanted = self._mount.wanted
        ordered = any(isinstance(order.operation, MOVERS) for order in wanted.value.pending)
        is_only_motion = isinstance(wanted.value.motion, Slew) and not (wanted.is_ending or ordered)
        return self._current_path.allowed and is_only_motion

    def narrow_limits(self, min_alt: float, max_alt: float, hour_angle: float | None) -> None:
        """Apply tighter limits (degrees) to the motion under way, too; wider ones apply to the next."""
        self._limits = self._limits if self._at_own_park else self._limits.narrowed(min_alt, max_alt, None, hour_angle)

    # --- events -----------------------------------------------------------------------------------------------------

    def on_motion_start(self, operation: op.Operation) -> None:
        """Note that a motion has begun: it starts from the last position, unless the mount was moving already."""
        mount, moving = self._mount, self._mount.movement.snapshot()
        limits, self._at_own_park = mount.policy.limits, False
        if isinstance(operation, op.Goto | op.GotoHorizontal | op.Move):
            limits = limits.narrowed(operation.lowest, operation.highest)
        elif isinstance(operation, op.Park) and (mount.policy.own_park or mount.driver.destination(operation) is None):
            limits, self._at_own_park = limits.without_altitudes(), True
        self._limits, self._coasts_until, self._goto_is_astray = limits, NEVER, self.next_path.points == []
        self._current_path = replace(self.next_path) if isinstance(operation, GOTOS) else CheckedPath()
        self._rested_at_park = False
        ordered_speed = mount.driver.speed(operation.rate) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        if isinstance(operation, op.Sync):
            self.observed = replace(self.observed, previous=None, last=None, farthest_from_suns=())
            self.hour_angle.forget()
        self.observed = seen.begin_motion(self.observed, mount.now(), ordered_speed, at_rest=not self._is_moving)
        if not isinstance(operation, op.Move | op.MoveAxis):
            self._deadline.disarm()
        elif moving.hand_moves.get(operation.axis) != operation:  # a repeated command is judged already
            speed = sum(
                mount.driver.speed(motion.rate) for motion in {**moving.hand_moves, operation.axis: operation}.values()
            )
            self._apply_verdict(first_position_deadline(self._judged_state(mount.now(), moving), mount.now(), speed))

    def on_goto_end(self, _: None = None) -> None:
        """Note the end of a goto. If it was stopped on its way, the tube may still be beyond the pole or the zenith."""
        self._goto_ended_at = self._mount.now()
        moving = self._mount.movement.snapshot()
        if not (moving.end_pending or moving.hand_moves):
            self.observed = replace(self.observed, upright=True)

    def on_axis_stop(self) -> None:
        """Note that one axis was stopped: a goto that continues on the other leaves the path that was checked."""
        self._goto_is_astray, self._current_path.allowed = True, False

    def on_motion_end(self) -> None:
        """Note that one or all motions by hand have ended."""
        self._deadline.disarm()
        self.at_rest_since = self._mount.now()
        self._coasts_until = self._mount.now() + COASTING_TIME

    def on_no_position(self, _: None = None) -> None:
        """Note that the mount did not report its position; stop a motion by hand if that lasts too long."""
        mount, now = self._mount, self._mount.now()
        reason = blind_reason(mount.movement.snapshot(), mount.cache.age(op.Position, now), now - self._blind_stop_at)
        if reason:
            self._blind_stop_at = now
            self._stop(f"stopped: {reason}")

    # --- positions --------------------------------------------------------------------------------------------------

    def check_position(self, position: op.Equatorial) -> None:
        """Compare a position with the previous position, apply the rules, and act on the verdict."""
        now, last = self._mount.now(), self.observed.last
        if last is not None and now - last.time < MIN_POSITION_GAP:
            return
        self._deadline.disarm()
        self._check_axes(now, position)
        if self.sky_change.has_changed(now, self.moved_by_others):
            last = None
            self.hour_angle.forget()
        elif last is not None and last.altitude is None:  # the site may be known by now
            last = self._sample(last.time, last.position)
            self.observed = seen.add_first_position(self.observed, last)
        sample, status = self._sample(now, position, last), self._mount.cache.last_value(op.GetStatus)
        near = max(abs(position.dec), sample.altitude or 0.0) > seen.PASSAGE_LAT
        if near and not (self._mount.movement.slewing or self.moved_by_others):
            self.observed = seen.update_upright_by_passage(self.observed, last, sample, self._mount.astrometry, status)
        if last is None or now < self._coasts_until or last.comparison_key != sample.comparison_key:
            self.observed = seen.add_first_position(self.observed, sample)
            return
        if status is not None and not status.aligned:
            self.observed = replace(self.observed, previous=None, last=sample)
            self._mount.note_once(NOT_ALIGNED_MESSAGE)
            if self._status_age > MAX_STATUS_AGE:
                self._reader.shared_task(op.GetStatus())
            return
        self.observed, moving = seen.add_position(self.observed, sample), self._mount.movement.snapshot()
        self._update_state(now, status, moving)
        self._goto_is_astray = self._goto_is_astray or (moving.slewing and self._is_off_paths(position))
        view = self._judged_state(now, moving)
        self.observed = replace(self.observed, farthest_from_suns=farthest_from_suns(view))
        self._apply_verdict(judge_motion(view))

    def _sample(self, now: float, reported: op.Equatorial, before: PositionSample | None = None) -> PositionSample:
        """Return a position that was read at ``now`` with its altitude, hour angle and distances from the Sun."""
        mount, frame = self._mount, self._mount.tube_frame()
        position = reported if before is None else seen.extrapolate_ra(now, reported, before, mount.stop_timing.ra_lag)
        altitude, hour_angle = mount.astrometry.alt_and_ha(position)
        shifted = tuple(unsynced_sources(mount, frame))
        others = () if altitude is None else (*shifted, *contradicting_sources(mount, self._limits))
        further = tuple(source.altitude(position) for source in others)
        suns, lifting = tuple(mount.suns.distances(position)), mount.wanted.hand_moves.get(2)
        key = (mount.suns.reset_count, frame, altitude is None, len(further))
        return PositionSample(now, reported, altitude, hour_angle, suns, lifting, key, further, 1 + len(shifted))

    def _update_state(self, now: float, status: op.Status | None, moving: MotionState) -> None:
        """Notice motion at the hand control, a new alignment and a tube beyond pole or zenith. Restore the limits when
        the ordered motion has ended; after a park, only when the mount tracks again.
        """
        mount, last = self._mount, self.observed.last
        self.tracked_at = now if status is None or status.tracking is not op.Tracking.OFF else self.tracked_at
        self.others_watch.record(now, self.observed.sky_speed > MAX_TRACKING_SPEED and not moving.ordered_by_client)
        mount.movement.moved_by_others_until = self.others_watch.watch_closely_until
        mount.driver.moved_by_others = self.moved_by_others
        if self.others_watch.just_began and mount.driver.moved_by_others:
            mount.cache.mark_changed(op.Slewing)  # no new answer, but the mount must be asked whether it slews
        if self.observed.sky_speed > REALIGNED_FACTOR * mount.driver.speed(FASTEST_RATE):
            mount.syncs.reset()
        if status is not None and last is not None and last.axis2_move is not None:
            self.observed = seen.set_upright(self.observed, status.equatorial, mount.driver.speed(last.axis2_move.rate))
        if not moving.ordered_by_client and (not self._at_own_park or self._has_left_park(status)):
            self._limits, self._at_own_park = mount.policy.limits, False

    def _is_off_paths(self, position: op.Equatorial) -> bool:
        """Whether this position of a goto is more than ``ASTRAY_DEGREES`` from the paths calculated for it."""
        if not self._current_path.points:
            return False
        reading = axis_readings_at(self._mount.astrometry, position, self._mount.tube_frame().polar)
        return all(separation(*reading, *way) > ASTRAY_DEGREES for way in self._current_path.points)

    def _has_left_park(self, status: op.Status | None) -> bool:
        """Whether the mount tracks again after the owner's park position; from then on the limits apply again."""
        if status is None or not (self._rested_at_park or self._status_age <= MAX_STATUS_AGE):
            self._reader.shared_task(op.GetStatus())
            return False
        tracks = status.tracking is not op.Tracking.OFF
        self._rested_at_park = self._rested_at_park or not tracks
        return self._rested_at_park and tracks

    @property
    def _status_age(self) -> float:
        return self._mount.cache.age(op.GetStatus, self._mount.now())

    def _judged_state(self, now: float, moving: MotionState) -> JudgedState:
        mount, limits = self._mount, self._limits
        past = None if mount.policy.limits.hour_angle is None else self.hour_angle.past_meridian_now(self.observed)
        if self.moved_by_others and not moving.ordered_by_client:
            limits = limits.for_keypad()
            if now - mount.cache.age(op.Slewing, now) < self.others_watch.began_at:
                moving = replace(moving, slewing=True)  # perhaps: the next exchange will show it
        status = mount.cache.last_value(op.GetStatus)
        suns = mount.suns
        return JudgedState(
            self.observed, limits, mount.stop_timing, moving, suns.min_dist, status, past, self._goto_is_astray,
            suns.confirmed_sun_count, self._current_path.min_altitude,
        )  # fmt: skip

    def _check_axes(self, now: float, position: op.Equatorial) -> None:
        """Check that stopped axes rest and that axes moved by hand do move."""
        mount, by_hand = self._mount, self._mount.wanted.hand_moves
        if self._end_watch.ending is None and not by_hand:
            self._stalls.clear()
            return
        status, axes = mount.cache.last_value(op.GetStatus), self._axis_sample(now, position)
        self._end_watch.add_sample(axes)
        judged = status is not None and status.aligned and not mount.driver.moves_by_gotos
        ordered = {axis: mount.driver.speed(motion.rate) for axis, motion in by_hand.items()} if judged else {}
        stalled = self._stalls.find_stalled(
            axes, ordered, mount.link.times.typical_rtt * mount.stop_timing.position_reads
        )
        if stalled is not None:
            self._stop(
                f"stopped: axis {stalled} should move, but its position does not change; check the "
                "mount (a stalled motor, a cable?)"
            )

    def _axis_sample(self, now: float, position: op.Equatorial) -> AxisSample:
        """Return a position as readings of the two axes."""
        mount = self._mount
        status = mount.cache.last_value(op.GetStatus)
        return seen.axis_sample(mount.astrometry, status, getattr(mount.driver, "low", False), now, position)

    # --- acting -----------------------------------------------------------------------------------------------------

    def _apply_verdict(self, verdict: Verdict) -> None:
        if verdict.reason:
            self._end_motion(verdict.reason)
        elif verdict.stop_in is not None:
            self._deadline.arm(verdict.stop_in, verdict.limit_name)

    def _deadline_passed(self, limit_name: str) -> None:
        """End a motion that may have reached a limit by its last known speed: no position has arrived since."""
        if self._is_moving:
            self._end_motion(f"{limit_name}, estimated from its speed")

    def _end_motion(self, reason: str) -> None:
        """Stop the motion, whoever began it. If nothing but tracking moves the mount, have that turned off instead."""
        if self._is_moving:
            self._stop(f"stopped at {reason}")
        else:
            self.carried_to_limit.emit(reason)

    def _stop(self, reason: str) -> None:
        self._mount.note(reason)
        self.must_stop.emit(reason)


def blind_reason(motions: MotionState, position_age: float, since_stop: float) -> str:
    """Return why a mount that moves by hand and reports no position must stop; empty if it need not. ``position_age``
    and ``since_stop``: seconds since the last position and since the last such stop. An LX200GPS also reports nothing
    while it seeks home, but that is no motion by hand.
    """
    if motions.hand_moves and position_age > MAX_BLIND_TIME and since_stop > MAX_BLIND_TIME:
        return "it moves but does not report its position"
    return ""


class AxisCourse(Struct, frozen=True):
    """The motion of an axis: commanded speed, time of its first sample, last sample, and degrees moved in between."""

    speed: float
    began_at: float
    last_sample: AxisSample
    distance: float = 0.0

    def updated(self, axis: int, sample: AxisSample) -> AxisCourse:
        """Add a position. The distance is summed step by step, because the reading turns back over a pole."""
        step = abs(wrap180(sample.angles[axis - 1] - self.last_sample.angles[axis - 1]))
        return AxisCourse(self.speed, self.began_at, sample, self.distance + step)


class StallWatch:
    """Finds axes that do not move in spite of an order; call ``find_stalled`` with every position.

    Such a motor is stalled, or the mount reports an old position. Only speeds that a position shows clearly are judged,
    and only after the mount has had time to start.
    """

    def __init__(self) -> None:
        self._courses: dict[int, AxisCourse] = {}

    def clear(self) -> None:
        """Forget all motions: nothing moves by hand."""
        self._courses.clear()

    def find_stalled(self, sample: AxisSample, speeds: Mapping[int, float], round_trip: float) -> int | None:
        """Return an axis that moved too little at its commanded speed (degrees a second, by axis), or None."""
        courses: dict[int, AxisCourse] = {}
        for axis, speed in speeds.items():
            if speed < STALL_MIN_SPEED:
                continue
            before = self._courses.get(axis)
            same = before is not None and before.speed == speed
            courses[axis] = before.updated(axis, sample) if before and same else AxisCourse(speed, sample.time, sample)
        self._courses = courses
        for axis, course in courses.items():
            elapsed = sample.time - course.began_at
            is_slow = course.distance < STALL_MIN_PART * course.speed * elapsed
            if elapsed >= max(STALL_TIME, 3.0 * round_trip) and is_slow:
                return axis
        return None


class OthersWatch:
    """Notices motion that no client ordered: at the hand control, or by the mount itself.

    ``began_at`` and ``last_seen_at`` are the times of the first and the last position that showed it (``began_at``: the
    last position while none shows it). ``is_moving``: the last position showed it; ``just_began``: it was the first.
    """

    def __init__(self) -> None:
        self.began_at = self.last_seen_at = self.watch_closely_until = NEVER
        self.just_began = self.is_moving = False

    def record(self, now: float, is_moving: bool) -> None:
        """Record whether the last two positions show motion that no client ordered."""
        self.just_began, self.is_moving = is_moving and not self.is_moving, is_moving
        if self.just_began or not is_moving:
            self.began_at = now
        if is_moving:
            self.last_seen_at, self.watch_closely_until = now, now + CLOSE_WATCH_TIME


class SkyChange:
    """Notices that site or clock was set: then equal positions before and after mean different altitudes. For a while
    after that the reported position may change at rest. ``changed_at``: loop time of the last such setting at rest.
    """

    def __init__(self, mount: Context) -> None:
        self._mount = mount
        self._last_sky: tuple[op.Place | None, float] = None, 0.0
        self._settles_until = NEVER
        self.changed_at = NEVER

    def has_changed(self, now: float, moved_by_others: bool) -> bool:
        """Whether the present position cannot be compared with the last one, because site or clock was set."""
        mount, (place, ahead) = self._mount, self._last_sky
        site_clock = mount.astrometry.site_clock
        self._last_sky = site_clock.site(), site_clock.unix() - now
        changed = place is not None and (place != self._last_sky[0] or abs(ahead - self._last_sky[1]) > CLOCK_JUMP)
        if changed or any(kind in AT_REST for kind, _ in mount.incoming_settings.pending):
            self._settles_until = now + NEW_SITE_TIME
        if now >= self._settles_until or mount.movement.any_motion:
            return changed
        if changed:
            self.changed_at = now
        return changed or not moved_by_others


class StopDeadline:
    """A timer that calls ``on_passed`` once with the name of a limit, unless it is armed again or disarmed."""

    def __init__(self, loop: asyncio.AbstractEventLoop, on_passed: Callable[[str], None]) -> None:
        self._loop, self._on_passed = loop, on_passed
        self._handle: asyncio.TimerHandle | None = None

    def arm(self, seconds: float, limit_name: str) -> None:
        """Set the deadline to ``seconds`` from now, unless an earlier deadline is set."""
        at = self._loop.time() + max(0.0, seconds)
        if self._handle is not None and self._handle.when() <= at:
            return
        self.disarm()
        self._handle = self._loop.call_at(at, self._fire, limit_name)

    def disarm(self) -> None:
        """Cancel the deadline: no limit is near, or the next position has arrived."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None

    def _fire(self, limit_name: str) -> None:
        self._handle = None
        self._on_passed(limit_name)
