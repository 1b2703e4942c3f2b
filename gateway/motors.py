"""One motor axis of a simulated mount: what it has been told, and its way to a goal.

Angles are degrees, times Unix seconds, rates degrees a second of time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

#: What a drive keeps up with besides the stars, degrees a second.
SOLAR_RATE = 360.0 / 86400.0
LUNAR_RATE = 14.685 / 3600.0
#: The last stretch of a goto, in degrees, and how fast it is done.
APPROACH, APPROACH_RATE = 0.5, 0.25


class Leg(NamedTuple):
    """One axis on its way to a goal that may itself move: how far it still is from it."""

    started: float
    distance: float
    fast: float
    slow: float

    @property
    def _far_for(self) -> float:
        return max(0.0, abs(self.distance) - APPROACH) / self.fast

    @property
    def ends(self) -> float:
        return self.started + self._far_for + min(abs(self.distance), APPROACH) / self.slow

    def remaining(self, now: float) -> float:
        """Signed degrees left, shrinking without a turn, exactly 0 from ``ends`` on."""
        near = now - self.started - self._far_for
        if now >= self.ends:
            return 0.0
        left = min(abs(self.distance), APPROACH) - near * (self.slow if near > 0 else self.fast)
        return math.copysign(max(0.0, left), self.distance)


@dataclass(slots=True)
class Axis:
    """One motor: where it was at ``since``, and what it has been told since."""

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

    def rest(self) -> None:
        """Forget every order but a guide pulse."""
        self.taken = self.drive = False
        self.rate, self.added, self.leg, self.goal = 0.0, 0.0, None, None
