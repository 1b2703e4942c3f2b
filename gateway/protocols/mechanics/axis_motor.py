"""One motor axis of a simulated mount: what it has been told, its way to a goal, and how it gathers and loses speed.

No motor stops at once. A real one ramps: told another speed, it changes to it at a constant acceleration, and told to
stop it runs on meanwhile. Angles are degrees, times Unix seconds, rates degrees a second of time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from msgspec import Struct

#: What a drive keeps up with besides the stars, degrees a second.
SOLAR_RATE = 360.0 / 86400.0
LUNAR_RATE = 14.685 / 3600.0
#: The last stretch of a goto, in degrees, and how fast it is done.
APPROACH, APPROACH_RATE = 0.5, 0.25
#: Seconds from rest to the fastest rate, and back to rest. Neither maker publishes it; owners see about a second, and
#: what a stop costs by it (half of the fastest rate, in degrees: 2 of a CPC, 4 of an LX200) is what limits must allow.
RAMP_SECONDS = 1.0
#: A change of speed up to this, in degrees a second, takes a real motor milliseconds: guiding and tracking are exact.
INSTANT = 0.02


class Ramp(NamedTuple):
    """A change of speed since ``began``: by how much the motor was faster then than it was told to be."""

    began: float
    change: float
    acceleration: float

    @property
    def ends(self) -> float:
        return self.began + abs(self.change) / self.acceleration

    def speed(self, now: float) -> float:
        """By how much the motor is still faster than it was told to be, signed."""
        if now >= self.ends:
            return 0.0
        return math.copysign(abs(self.change) - self.acceleration * (now - self.began), self.change)

    def left(self, now: float) -> float:
        """How far it will get beyond what it was told from now on, degrees; negative where it lags behind."""
        speed = self.speed(now)
        return speed * abs(speed) / (2.0 * self.acceleration)


#: The motor turns as it was told.
SETTLED = Ramp(-math.inf, 0.0, 1.0)


class Phase(NamedTuple):
    """A stretch of a way: its seconds, and the speeds at both ends."""

    seconds: float
    first: float
    last: float


class Leg:
    """One axis on its way to a goal that may itself move: how far it still is from it.

    It begins at rest, gathers speed, loses it for the slow approach and comes to rest at the goal. What a motor that
    turned before still runs on (``run_on`` degrees, until ``ramp_ends``) is added to that: the way is so much shorter.
    """

    def __init__(self, started: float, distance: float, fast: float, slow: float, acceleration: float) -> None:
        self.started, self.distance, self.acceleration = started, distance, acceleration
        self._rates = fast, slow
        self.set_run_on(0.0, started)

    def set_run_on(self, run_on: float, ramp_ends: float) -> None:
        """From where the way is reckoned: where the motor would come to rest."""
        self._way = self.distance - run_on
        self._phases = _phases(abs(self._way), *self._rates, self.acceleration)
        self.ends = max(ramp_ends, self.started + sum(phase.seconds for phase in self._phases))

    def remaining(self, now: float) -> float:
        """Signed degrees left, shrinking without a turn, exactly 0 from ``ends`` on."""
        if now >= self.ends:
            return 0.0
        left, seconds = abs(self._way), now - self.started
        for phase in self._phases:
            part = min(seconds, phase.seconds)
            if part > 0.0:
                left -= part * (phase.first + 0.5 * (phase.last - phase.first) * part / phase.seconds)
            seconds -= part
        return math.copysign(max(0.0, left), self._way)


def _phases(distance: float, fast: float, slow: float, acceleration: float) -> list[Phase]:
    """Faster and slower again, the last stretch at ``slow``."""
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
    """One motor: where it was at ``since`` and how fast, and what it has been told since.

    ``position`` is where it would have been told from if it could change its speed at once: it includes what it still
    runs on (``ramp``).
    """

    position: float
    since: float
    rate: float = 0.0
    added: float = 0.0  # a slow hand rate on top of tracking
    pulse: float = 0.0
    pulse_ends: float = -math.inf
    taken: bool = False  # tracking is overridden by a rate given from outside
    drive: bool = False  # that rate is itself a tracking rate
    leg: Leg | None = None
    goal: float | None = None  # of a goto to a fixed position; None: the aim on the sky
    speed: float = 0.0  # how fast it really turned at ``since``
    acceleration: float = math.inf  # how fast it can change that
    ramp: Ramp = SETTLED

    def rest(self) -> None:
        """Forget every order but a guide pulse."""
        self.taken = self.drive = False
        self.rate, self.added, self.leg, self.goal = 0.0, 0.0, None, None

    def ramp_from(self, now: float, told: float, quickest: float) -> float:
        """Begin to change from ``speed`` to what was told -> how far it runs on, degrees.

        Nothing is quicker than ``quickest``, though in the zenith the azimuth would have to be.
        """
        change = max(-quickest, min(quickest, self.speed)) - max(-quickest, min(quickest, told))
        settled = abs(change) <= INSTANT or math.isinf(self.acceleration)
        self.ramp = SETTLED if settled else Ramp(now, change, self.acceleration)
        run_on = self.ramp.left(now)
        self.position += run_on
        if self.leg is not None:
            self.leg.set_run_on(run_on, max(now, self.ramp.ends))
        return run_on

    @property
    def ordered(self) -> bool:
        """Whether it was told anything but tracking: a goto, a hand rate, guiding."""
        return bool(self.leg is not None or self.added or self.pulse or (self.taken and not self.drive and self.rate))
