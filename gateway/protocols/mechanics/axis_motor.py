"""One motor axis of a simulated mount: its orders, the course of a goto, and how it accelerates and brakes.

No motor stops at once. Like a real motor it ramps: it changes to the ordered speed at a constant acceleration, and
after a stop order it runs on until it rests. Angles are degrees, times Unix seconds, rates degrees a second of time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from msgspec import Struct

#: Tracking rates besides sidereal, degrees a second.
SOLAR_RATE = 360.0 / 86400.0
LUNAR_RATE = 14.685 / 3600.0
#: The last stretch of a goto, degrees, and its rate, degrees a second.
APPROACH, APPROACH_RATE = 0.5, 0.25
#: Seconds from rest to the fastest rate, and back to rest. Neither maker publishes it; owners see about a second.
#: Limits must allow for what a mount runs on after a stop: half its fastest rate, 2 degrees on a CPC, 4 on an LX200.
RAMP_SECONDS = 1.0
#: A smaller change of speed (degrees a second) takes a real motor milliseconds only: guiding and tracking are exact.
INSTANT = 0.02


class Ramp(NamedTuple):
    """A change of speed that began at ``began``; ``change`` is the excess over the ordered speed at that time."""

    began: float
    change: float
    acceleration: float

    @property
    def ends(self) -> float:
        return self.began + abs(self.change) / self.acceleration

    def speed(self, now: float) -> float:
        """Return the signed excess over the ordered speed, degrees a second."""
        if now >= self.ends:
            return 0.0
        return math.copysign(abs(self.change) - self.acceleration * (now - self.began), self.change)

    def left(self, now: float) -> float:
        """Return how far the motor still runs beyond the ordered position, degrees; negative if it lags behind."""
        speed = self.speed(now)
        return speed * abs(speed) / (2.0 * self.acceleration)


#: No ramp: the motor has the ordered speed.
SETTLED = Ramp(-math.inf, 0.0, 1.0)


class Phase(NamedTuple):
    """A phase of a goto with constant acceleration: its duration in seconds, its first and last speed."""

    seconds: float
    first: float
    last: float


class Leg:
    """The course of a goto on one axis: its distance from the goal as a function of time. The goal may move.

    It begins at rest, accelerates, brakes for the slow approach and comes to rest at the goal. If the motor turned
    before, it still runs on (``run_on`` degrees, until ``ramp_ends``), which shortens the distance by as much.
    """

    def __init__(self, started_at: float, distance: float, fast: float, slow: float, acceleration: float) -> None:
        self.started, self.distance, self.acceleration = started_at, distance, acceleration
        self._rates = fast, slow
        self.set_run_on(0.0, started_at)

    def set_run_on(self, run_on: float, ramp_ends: float) -> None:
        """Count the distance from where the motor would come to rest, and calculate the phases."""
        self._total = self.distance - run_on
        self._phases = _phases(abs(self._total), *self._rates, self.acceleration)
        self.ends = max(ramp_ends, self.started + sum(phase.seconds for phase in self._phases))

    def remaining(self, now: float) -> float:
        """Return the signed degrees to the goal. They never grow, and are exactly 0 from ``ends`` on."""
        if now >= self.ends:
            return 0.0
        left, seconds = abs(self._total), now - self.started
        for phase in self._phases:
            part = min(seconds, phase.seconds)
            if part > 0.0:
                left -= part * (phase.first + 0.5 * (phase.last - phase.first) * part / phase.seconds)
            seconds -= part
        return math.copysign(max(0.0, left), self._total)


def _phases(distance: float, fast: float, slow: float, acceleration: float) -> list[Phase]:
    """Return the phases of a goto: accelerate, constant speed, brake, the approach at ``slow``, brake to rest."""
    near = min(distance, APPROACH)
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
    """One motor: its position and speed at ``since``, and its orders since then.

    ``position`` includes the way that the motor still runs on (``ramp``), as if it changed speed at once.
    """

    position: float
    since: float
    rate: float = 0.0
    added: float = 0.0  # a slow hand rate on top of tracking
    pulse: float = 0.0
    pulse_ends: float = -math.inf
    overridden: bool = False  # an ordered rate overrides tracking
    drive: bool = False  # that rate is itself a tracking rate
    leg: Leg | None = None
    goal: float | None = None  # of a goto to a fixed position; None: the aim on the sky
    speed: float = 0.0  # its true speed at ``since``
    acceleration: float = math.inf  # how fast that can change
    ramp: Ramp = SETTLED

    def rest(self) -> None:
        """Forget every order except a guide pulse."""
        self.overridden = self.drive = False
        self.rate, self.added, self.leg, self.goal = 0.0, 0.0, None, None

    def ramp_from(self, now: float, ordered: float, quickest: float) -> float:
        """Begin to change from ``speed`` to the ordered speed. Return how far the motor runs on meanwhile, degrees.

        No speed exceeds ``quickest``, although following the sky at the zenith would need any speed in azimuth.
        """
        change = max(-quickest, min(quickest, self.speed)) - max(-quickest, min(quickest, ordered))
        settled = abs(change) <= INSTANT or math.isinf(self.acceleration)
        self.ramp = SETTLED if settled else Ramp(now, change, self.acceleration)
        run_on = self.ramp.left(now)
        self.position += run_on
        if self.leg is not None:
            self.leg.set_run_on(run_on, max(now, self.ramp.ends))
        return run_on

    @property
    def ordered(self) -> bool:
        """Whether it has an order other than tracking: a goto, hand motion, guiding."""
        return bool(
            self.leg is not None or self.added or self.pulse or (self.overridden and not self.drive and self.rate)
        )
