"""One motor axis of a simulated mount: its orders, the course of a goto, and how it accelerates and brakes.

Like a real motor, it changes to the ordered speed at a constant acceleration (a ramp), and runs on for a while after a
stop order. Angles are degrees, times Unix seconds, rates degrees a second of time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from msgspec import Struct

#: Tracking rates besides sidereal, degrees a second.
SOLAR_RATE = 360.0 / 86400.0
LUNAR_RATE = 14.685 / 3600.0
#: The last stretch of a goto, degrees, and its rate, degrees a second.
APPROACH_DISTANCE, APPROACH_RATE = 0.5, 0.25
#: Seconds from rest to the fastest rate, and back to rest. Neither maker publishes it; owners see about a second.
#: Limits must allow for the distance after a stop: half the fastest rate times this, 2 degrees on a CPC, 4 on an LX200.
RAMP_SECONDS = 1.0
#: A smaller change of speed (degrees a second) happens at once, because a real motor needs only milliseconds for it.
INSTANT_SPEED_CHANGE = 0.02


class Ramp(NamedTuple):
    """A change to the ordered speed at a constant acceleration, which began at ``began_at``. ``initial_excess`` is the
    excess over the ordered speed at that time, degrees a second, negative if the motor was slower.
    """

    began_at: float
    initial_excess: float
    acceleration: float

    @property
    def ends_at(self) -> float:
        return self.began_at + abs(self.initial_excess) / self.acceleration

    def speed(self, now: float) -> float:
        """Return by how much the speed still differs from the ordered one: actual minus ordered, degrees a second."""
        if now >= self.ends_at:
            return 0.0
        return math.copysign(abs(self.initial_excess) - self.acceleration * (now - self.began_at), self.initial_excess)

    def remaining_run_on(self, now: float) -> float:
        """Return how far the motor is still going to run beyond the ordered position, degrees; negative if it lags."""
        speed = self.speed(now)
        return speed * abs(speed) / (2.0 * self.acceleration)


#: No ramp: the motor has the ordered speed.
NO_RAMP = Ramp(-math.inf, 0.0, 1.0)


class Phase(NamedTuple):
    """A phase of a goto with constant acceleration: its duration, and the speeds at its beginning and end."""

    seconds: float
    first_speed: float
    last_speed: float


class AxisGoto:
    """A goto of one axis: the distance from the goal as a function of time. The goal may move with the sky.

    The axis accelerates from rest, brakes for the slow approach and comes to rest at the goal. A motor that turned
    before still runs on for ``run_on`` degrees, until ``ramp_ends``; the goto meanwhile covers the rest of the way.
    """

    def __init__(self, started_at: float, distance: float, fast: float, slow: float, acceleration: float) -> None:
        self.started_at, self.distance, self.acceleration = started_at, distance, acceleration
        self._rates = fast, slow
        self.set_run_on(0.0, started_at)

    def set_run_on(self, run_on: float, ramp_ends: float) -> None:
        """Subtract how far the motor still runs on from the distance to the goal, and calculate the phases."""
        self._goto_distance = self.distance - run_on
        self._phases = _plan_goto(abs(self._goto_distance), *self._rates, self.acceleration)
        self.ends_at = max(ramp_ends, self.started_at + sum(phase.seconds for phase in self._phases))

    def remaining(self, now: float) -> float:
        """Return the signed distance to the goal, degrees. It never grows, and is exactly 0 from ``ends_at`` on."""
        if now >= self.ends_at:
            return 0.0
        left, seconds = abs(self._goto_distance), now - self.started_at
        for phase in self._phases:
            part = min(seconds, phase.seconds)
            if part > 0.0:
                left -= part * (phase.first_speed + 0.5 * (phase.last_speed - phase.first_speed) * part / phase.seconds)
            seconds -= part
        return math.copysign(max(0.0, left), self._goto_distance)


def _plan_goto(distance: float, fast: float, slow: float, acceleration: float) -> list[Phase]:
    """Return the phases of a goto: accelerate, constant speed, brake, approach at the rate ``slow``, brake to rest."""
    near = min(distance, APPROACH_DISTANCE)
    far = distance - near
    if math.isinf(acceleration):
        return [Phase(far / fast, fast, fast), Phase(near / slow, slow, slow)]
    end = slow * slow / (2.0 * acceleration)  # how far it takes from rest to the slow speed
    if distance <= 2.0 * end:
        peak = math.sqrt(acceleration * distance)
        return [Phase(peak / acceleration, 0.0, peak), Phase(peak / acceleration, peak, 0.0)]
    peak = max(slow, min(fast, math.sqrt(acceleration * far + slow * slow / 2.0)))
    up = peak * peak / (2.0 * acceleration)
    steady = max(0.0, far - up - (up - end))
    creeping = distance - steady - up - (up - end) - end
    corners = (0.0, peak), (peak, peak), (peak, slow), (slow, slow), (slow, 0.0)
    seconds = peak / acceleration, steady / peak, (peak - slow) / acceleration, creeping / slow, slow / acceleration
    return [Phase(time, *ends) for time, ends in zip(seconds, corners, strict=True)]


class Axis(Struct):
    """One motor: its position and speed at the time ``since``, and its orders since then."""

    position: float  # at ``since``, as if the motor had changed to the ordered speed at once: see ``ramp``
    since: float  # Unix seconds
    rate: float = 0.0  # the ordered rate: tracking, or instead of tracking
    added_rate: float = 0.0  # a slow hand rate on top of tracking
    pulse: float = 0.0  # the rate of a guide pulse on top of the others
    pulse_ends_at: float = -math.inf  # Unix seconds
    overrides: bool = False  # ``rate`` overrides tracking
    drive: bool = False  # a ``rate`` that overrides tracking is itself a tracking rate
    goto: AxisGoto | None = None  # the goto under way
    goal: float | None = None  # of a goto to a fixed position; None: the target is on the sky
    speed: float = 0.0  # the true speed at ``since``
    acceleration: float = math.inf  # how fast the speed can change, degrees a second squared
    ramp: Ramp = NO_RAMP  # the change to the ordered speed

    def clear_orders(self) -> None:
        """Clear all orders except a guide pulse."""
        self.overrides = self.drive = False
        self.rate, self.added_rate, self.goto, self.goal = 0.0, 0.0, None, None

    def ramp_from(self, now: float, ordered_speed: float, max_speed: float) -> float:
        """Begin to change from ``speed`` to the ordered speed. Return how far the motor runs on meanwhile, degrees.

        Speeds are cut off at ``max_speed``: tracking near the zenith would need an unlimited speed in azimuth.
        """
        change = max(-max_speed, min(max_speed, self.speed)) - max(-max_speed, min(max_speed, ordered_speed))
        settled = abs(change) <= INSTANT_SPEED_CHANGE or math.isinf(self.acceleration)
        self.ramp = NO_RAMP if settled else Ramp(now, change, self.acceleration)
        run_on = self.ramp.remaining_run_on(now)
        self.position += run_on
        if self.goto is not None:
            self.goto.set_run_on(run_on, max(now, self.ramp.ends_at))
        return run_on

    @property
    def has_order(self) -> bool:
        """Whether it has an order other than tracking: a goto, hand motion, guiding."""
        return bool(
            self.goto is not None or self.added_rate or self.pulse or (self.overrides and not self.drive and self.rate)
        )
