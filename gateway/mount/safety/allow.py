"""Whether the observed motion may continue: pure rules over the positions, the orders and the limits.

A moving mount must not pass an altitude limit, come near the Sun, or go past the meridian, where the tube of an
equatorial mount meets its pier. Each rule is a pure function that returns, at every position, how much room remains up
to its limits; all rooms are judged alike. No verdict forbids a motion that leads out of a forbidden region. Gotos are
also checked before they begin, without a margin for their speed (``admission/motions.py``). A motion must be stopped
early enough to end before the limit (``StopTiming``): that depends on the exchange times of the line, the inertia of
motors, and rates that may still grow.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.mount.motion.seen import ObservedMotion, PositionSample
from gateway.mount.motion.wanted import MotionState
from gateway.mount.policy import Limits

#: Positions closer together than this, in seconds, give no reliable rate.
MIN_POSITION_GAP = 0.15
#: Exchanges until a stop takes effect: that of the position, a command already sent, and the first of the stop.
STOP_EXCHANGES = 3
#: Seconds at full speed that a motor runs on after a stop: one that slows down evenly within a second covers half a
#: second's way. Mounts do not report how they slow down; owners see about a second from full speed, and less below it.
RUN_ON = 0.5
#: Exchanges between the stops of the two axes: meanwhile the second axis moves the tube alone.
STOP_GAP_EXCHANGES = 2.0
#: Seconds until motors have reached their speed; the rate that is measured earlier is too low.
RUN_UP_SECONDS = 1.0
#: The part of the commanded speed above which a rate shows an approach; a slower change means moving along the limit.
MIN_APPROACH_PART = 0.2
#: Degrees a second; a faster change is no tracking: the mount is moved, or a coarse position changed by a digit.
MAX_TRACKING_SPEED = 0.1
#: Degrees by which a goto that brakes before a limit covers less than at its last speed.
BRAKING_DEGREES = 0.75
#: Degrees by which positions may show a goto beyond a limit, plus its way in so many seconds: the tube moves between
#: the reads of the two coordinates.
MAX_OVERSHOOT, READ_TIME_ALLOWANCE = 0.1, 0.2
#: Degrees below the lowest point of its paths at which a goto is stopped as astray, if that is below the horizon.
LOST_GOTO_DEGREES = 10.0
#: Degrees by which the Sun must have come nearer before it counts as an approach; less is jitter.
SUN_JITTER_DEGREES = 0.05


class StopTiming(Struct, frozen=True):
    """Timing of a mount in seconds: ``round_trip`` of an exchange (``position_reads`` of them read a position),
    ``position_period`` between two positions, and the ``run_on`` after a stop, as a time at full speed.
    """

    round_trip: float
    position_reads: int
    position_period: float
    run_on: float = RUN_ON

    @property
    def ra_lag(self) -> float:
        """By how many seconds the first coordinate of a position is older than the second."""
        return 2.0 * (self.position_reads - 1) * self.round_trip

    @property
    def position_interval(self) -> float:
        """Seconds between two positions. While the mount moves, each coordinate is read twice."""
        return max(self.position_period, 2.0 * self.position_reads * self.round_trip)

    @property
    def stop_time(self) -> float:
        """Seconds from the reading of a position to the end of the motion, if that position causes a stop."""
        return (STOP_EXCHANGES + self.position_reads - 1) * self.round_trip + self.run_on

    @property
    def reaction(self) -> float:
        """Seconds from the reading of a position to the end of the motion, if only the next position causes a stop."""
        return self.position_interval + self.stop_time

    def reaction_time_after(self, elapsed: float) -> float:
        """Like ``reaction``, if the next position comes as late as the last, which took ``elapsed`` seconds."""
        return max(self.reaction, elapsed + STOP_EXCHANGES * self.round_trip + self.run_on)


def max_rate(rate: float, earlier_rate: float | None, commanded_speed: float, first_at: float, last_at: float) -> float:
    """Return how fast the mount may approach a limit from now on, degrees a second.

    ``rate`` was measured between the last two positions, ``earlier_rate`` before them in the same motion. ``first_at``
    and ``last_at`` are the seconds from the start of the motion to these positions. ``commanded_speed``: 0 if unknown.
    """
    grown = max(0.0, rate - earlier_rate) if earlier_rate is not None else 0.0
    if first_at < RUN_UP_SECONDS and rate > MIN_APPROACH_PART * commanded_speed * _speed_fraction(first_at, last_at):
        return max(rate + grown, commanded_speed)
    return rate + grown


def _speed_fraction(first_elapsed: float, last_elapsed: float) -> float:
    """Return the mean speed of a motor between two times (seconds after its start), as a fraction of full speed."""
    if last_elapsed >= RUN_UP_SECONDS or last_elapsed <= max(0.0, first_elapsed):
        return 1.0
    return (max(0.0, first_elapsed) + last_elapsed) / 2.0 / RUN_UP_SECONDS


class PastMeridianState(Struct, frozen=True):
    """How many degrees the tube is past the meridian, towards the pier; negative on the free side. ``rate``: how fast
    that changes, degrees a second; ``earlier_rate``: the rate before, None if unknown.
    """

    degrees: float
    rate: float
    earlier_rate: float | None = None


class Verdict(Struct, frozen=True):
    """``reason`` says why the motion must end; empty if it may continue.

    It may continue for ``stop_in`` seconds (None: without limit). If no new position arrives in that time, it must
    stop, because it may have reached the limit with the name ``limit_name``.
    """

    reason: str = ""
    stop_in: float | None = None
    limit_name: str = ""


ALLOWED_VERDICT = Verdict()


class CheckedPath(Struct):
    """What admission has found out about the path of a goto.

    ``points`` are the readings of the axes along its possible paths within the limits; None if they are not known. If
    they are empty, the goto is watched like a motion by hand. Below ``min_altitude``, degrees, it is astray and must
    stop. ``allowed``: all its paths keep all limits.
    """

    points: list[Pair] | None = None
    min_altitude: float = -90.0
    allowed: bool = False

    def forget(self) -> None:
        """Forget the last goto: nothing is known of the next one."""
        self.points, self.min_altitude, self.allowed = None, -90.0, False

    def set_points(self, points: list[Pair], zenith: Pair, allowed: bool, lost_margin: float) -> None:
        """Store the axis readings along the paths; none if not ``allowed``, because the tube may be on other paths. The
        goto is astray below the horizon and ``lost_margin`` degrees below all of them. ``zenith``: its axis readings.
        """
        self.points, self.allowed = points if allowed else [], allowed
        self.min_altitude = min(0.0, 90.0 - max(separation(*direction, *zenith) for direction in points) - lost_margin)


class JudgedState(Struct, frozen=True):
    """The state of a mount that the rules judge.

    ``sun_limit`` is the least allowed distance from the Sun, degrees. The first ``own_sun_count`` of the Sun's possible
    positions are by the mount's own coordinates or axes, the others by other sources of site and time.
    ``past_meridian`` is None if unknown or during a goto. ``is_astray``: a position showed the goto off its paths.
    Below ``min_altitude`` a goto must stop.
    """

    observed: ObservedMotion
    limits: Limits
    timing: StopTiming
    moving: MotionState
    sun_limit: float = 0.0
    status: op.Status | None = None
    past_meridian: PastMeridianState | None = None
    is_astray: bool = False
    own_sun_count: int = 1
    min_altitude: float = -90.0

    @property
    def on_checked_path(self) -> bool:
        """Whether only a checked goto moves the mount: no motion by hand has replaced it, and no axis was stopped.

        A goto off its paths does not count: it is watched like a motion by hand.
        """
        return (
            self.moving.slewing and self.moving.ordered_by_client and not self.moving.hand_moves and not self.is_astray
        )

    @property
    def _second_axis_run_on(self) -> float:
        """How far the second axis moves the tube after the first was stopped, degrees; 0 unless both move by hand."""
        seconds = STOP_GAP_EXCHANGES * self.timing.round_trip if len(self.moving.hand_moves) > 1 else 0.0
        return self.observed.sky_speed * seconds

    def max_rate(self, rate: float, earlier_rate: float | None) -> float:
        """Return how fast the mount may approach a limit from now on: at ``rate`` in a goto that no client ordered."""
        observed = self.observed
        if self.moving.slews_by_itself:
            return rate
        assert observed.previous is not None
        assert observed.last is not None
        return max_rate(
            rate,
            earlier_rate,
            observed.ordered_speed,
            observed.previous.time - observed.began_at,
            observed.last.time - observed.began_at,
        )

    def stop_margin(self, rate: float) -> float:
        """Return the degrees of motion until a stop at the next position ends it; 0 for a goto, unless it is astray."""
        if self.on_checked_path or self.moving.slews_by_itself:
            return 0.0
        return rate * self.timing.reaction_time_after(self.observed.elapsed) + self._second_axis_run_on

    def approach_rates(self, last_rates: tuple[float, ...], earlier_rates: tuple[float, ...]) -> list[float]:
        """Return ``max_rate`` for each altitude or Sun; ``earlier_rates`` count only if there are as many of them."""
        known = len(earlier_rates) == len(last_rates)
        return [self.max_rate(rate, earlier_rates[number] if known else None) for number, rate in enumerate(last_rates)]

    def judge(self, room: Room) -> Verdict:
        """Forbid the motion if a stop after the next position would come too late; else allow it for a while.

        A goto from the hand control may brake and end just before the limit, so it is stopped only at the limit.
        """
        left, rate = room.remaining, room.rate
        if left >= room.remaining_before:
            return ALLOWED_VERDICT
        if left < self.stop_margin(rate) - room.tolerance:
            return Verdict(room.reason)
        if rate <= MAX_TRACKING_SPEED or self.on_checked_path:
            return ALLOWED_VERDICT
        if self.moving.slews_by_itself:
            return Verdict(stop_in=(left + BRAKING_DEGREES) / rate - self.timing.round_trip, limit_name=room.limit)
        return Verdict(stop_in=(left - self._second_axis_run_on) / rate - self.timing.stop_time, limit_name=room.limit)


class Room(NamedTuple):
    """The degrees up to the limit named ``limit``, now and at the position before, which may shrink by ``rate`` degrees
    a second. A motion that would go beyond the limit by more than ``tolerance`` must end, for this ``reason``.
    """

    remaining: float
    remaining_before: float
    rate: float
    reason: str
    limit: str
    tolerance: float = 0.0


def judge_motion(state: JudgedState) -> Verdict:
    """Return the verdict that forbids the motion, else the verdict with the earliest deadline for the next position."""
    soonest = ALLOWED_VERDICT
    for rule in (altitude_rooms, sun_rooms, meridian_rooms):
        for room in rule(state):
            verdict = state.judge(room)
            if verdict.reason:
                return verdict
            if verdict.stop_in is not None and (soonest.stop_in is None or verdict.stop_in < soonest.stop_in):
                soonest = verdict
    return soonest


def first_position_deadline(state: JudgedState, now: float, speed: float) -> Verdict:
    """Return a verdict with the deadline for the first position after a motion by hand begins, in any direction.

    The mount must have reported a position before it can reach any limit. ``speed`` is the sum over the moving axes,
    degrees a second. The first stretch of the motion has been checked already (``admission/by_hand.py``).
    """
    last, timing = state.observed.last, state.timing
    if last is None or state.status is None or not state.status.aligned or speed <= MAX_TRACKING_SPEED:
        return Verdict()
    nearest = min(room for room in degrees_to_limits(last, state.limits, state.sun_limit) if room > 0.0)
    seconds = nearest / speed - timing.stop_time - (now - last.time)
    return Verdict(stop_in=max(seconds, timing.position_interval + MIN_POSITION_GAP), limit_name="a limit")


def degrees_to_limits(sample: PositionSample, limits: Limits, sun_limit: float) -> list[float]:
    """Return the degrees from a position to each altitude limit, and to the allowed distance from the Sun."""
    rooms = [room for altitude in sample.altitudes for room in degrees_inside(limits, altitude)]
    return [180.0, *rooms, *(distance - sun_limit for distance in sample.sun_distances)]


def degrees_inside(limits: Limits, altitude: float) -> Pair:
    """Return the degrees of an altitude above the lowest and below the highest limit; infinite without that limit."""
    return (
        altitude - limits.lowest if limits.lowest > -90.0 else inf,
        limits.highest - altitude if limits.highest < 90.0 else inf,
    )


def is_moving_out(limits: Limits, before: float, after: float) -> bool:
    """Whether an altitude is outside the limits, and changes away from them."""
    rooms = zip(degrees_inside(limits, before), degrees_inside(limits, after), strict=True)
    return any(now < min(0.0, then) for then, now in rooms)


def altitude_rooms(state: JudgedState) -> Iterator[Room]:
    """Yield the room up to the altitude limits, by the mount's coordinates and as if its syncs were wrong.

    Motion by arrow keys of programs is also judged by other sources of site and time. For these, and as if the syncs
    were wrong, only limits that somebody has set count (`Limits.without_default_altitudes`). A goto may pass below the
    horizon if nobody has set a limit, but never below its ``min_altitude``.
    """
    observed, before, last = state.observed, state.observed.previous, state.observed.last
    if before is None or last is None:
        return
    goes = state.moving.slewing and state.moving.ordered_by_client and not state.moving.hand_moves
    beyond = (MAX_OVERSHOOT + READ_TIME_ALLOWANCE * observed.sky_speed) * state.on_checked_path
    own, count = last.own_altitude_count, None if state.moving.hand_moves else last.own_altitude_count
    rates = state.approach_rates(observed.rates.altitudes, observed.prev_rates.altitudes)[:count]
    for number, (then, now, rate) in enumerate(zip(before.altitudes, last.altitudes, rates, strict=False)):
        limits = state.limits.without_default_altitudes() if goes or number else state.limits
        if goes:
            reason = f"the altitude limit ({now:.1f} degrees, far below its way)"
            yield Room(now - state.min_altitude, then - state.min_altitude, 0.0, reason, "")
        by = ", by another site or clock" if number >= own else ", if the syncs were wrong" if number else ""
        reason = f"the altitude limit ({now:.1f} degrees{by})"
        for were, left in zip(degrees_inside(limits, then), degrees_inside(limits, now), strict=True):
            yield Room(left, were, rate, reason, "the altitude limit", beyond)


def sun_rooms(state: JudgedState) -> Iterator[Room]:
    """Yield, for each possible position of the Sun, the room up to the allowed distance. The room before is measured
    from ``farthest_from_suns``, not from the last position, so that a slow approach is also noticed.

    A position of the Sun by another source of site and time only ends motion by arrow keys of programs, because a wrong
    source must not end a correct motion.
    """
    observed, last = state.observed, state.observed.last
    if observed.previous is None or last is None:
        return
    count = None if state.moving.hand_moves else state.own_sun_count
    rates = state.approach_rates(observed.rates.sun_distances, observed.prev_rates.sun_distances)[:count]
    for now, far, rate in zip(last.sun_distances, observed.farthest_from_suns, rates, strict=False):
        reason = f"the Sun ({now:.0f} degrees from it)"
        yield Room(now - state.sun_limit, far - SUN_JITTER_DEGREES - state.sun_limit, rate, reason, "the Sun")


def farthest_from_suns(state: JudgedState) -> tuple[float, ...]:
    """Return, for each possible position of the Sun, the greatest distance since the tube came near or last came nearer
    by more than ``SUN_JITTER_DEGREES``; or the present distance if the tube is not near.
    """
    observed = state.observed
    if observed.last is None:
        return ()
    rates = state.approach_rates(observed.rates.sun_distances, observed.prev_rates.sun_distances)
    return tuple(
        now
        if now >= state.sun_limit + state.stop_margin(rate) or now < before - SUN_JITTER_DEGREES
        else max(now, before)
        for now, before, rate in zip(observed.last.sun_distances, observed.farthest_from_suns, rates, strict=True)
    )


def meridian_rooms(state: JudgedState) -> Iterator[Room]:
    """Yield the room up to the hour angle limit. Gotos are exempt, because they may change the pier side."""
    limit, past = state.limits.hour_angle, state.past_meridian
    if limit is None or past is None or past.rate <= 0.0 or state.observed.previous is None or state.moving.slewing:
        return
    reason = f"the hour angle limit ({past.degrees / 15.0:.2f} hours past the meridian)"
    rate = state.max_rate(past.rate, past.earlier_rate)
    yield Room(limit - past.degrees, inf, rate, reason, "the hour angle limit")
