"""Where the two motors of a simulated mount are, by formula: the orders are given in ``mount.py``.

A motor's place is what it was told (rest, a rate, a goto, following the sky) less what it still runs on or lags behind
(``motors.Ramp``). An order is first noted, with place and speed of that moment; at the next look the ramps begin that
lead from those speeds to the ordered ones. So every motion is continuous, whatever is ordered in whatever order.
"""

from __future__ import annotations

import math

from gateway.astro.axes import Build, Geometry, Pair, Sky
from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS, Axis

#: Seconds over which an ordered motion is compared with itself to find its speed: a power of two, so that it is exact.
_STEP = 2.0**-7
#: The aim of axes of which none goes by it: to reckon it takes longer than all the rest.
_NOWHERE: Pair = (math.nan, math.nan)


class AxisMotion:
    """The motors of a mount. ``correction`` is what a sync adds to the axes before they are believed.

    ``sky`` is the site and clock that the mount believes in. ``ground`` is where and when it really stands: nothing
    that it is told ever changes that. ``acceleration`` is in degrees a second squared; infinite for motors without
    ramps, whose arithmetic is plain.
    """

    def __init__(self, build: Build, sky: Sky, now: float, axes: Pair) -> None:
        self.build, self.sky, self.ground = build, sky, sky
        self.fastest = 4.0  # degrees a second
        self.acceleration = self.fastest / RAMP_SECONDS
        self.correction: Pair = (0.0, 0.0)
        self.flipped = False
        self._drive_rate = SIDEREAL_RATE  # what tracking keeps up with
        self._axes = {1: Axis(axes[0], now), 2: Axis(axes[1], now)}
        self._aim: Pair = (0.0, 0.0)
        self._held = False  # in alt-az both axes follow the aim
        self._noted = False  # an order may have been given since

    @property
    def geometry(self) -> Geometry:
        return Geometry(self.build, self.sky.latitude)

    @property
    def _positions(self) -> Pair:
        return self._axes[1].position, self._axes[2].position

    def _where(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered(now)
        return first - self._axes[1].ramp.left(now), second - self._axes[2].ramp.left(now)

    def _speeds(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered_speeds(now)
        return first + self._axes[1].ramp.speed(now), second + self._axes[2].ramp.speed(now)

    def _ordered(self, now: float) -> Pair:
        """Where they would be if every change of speed had been done at once, from where they then came to."""
        first, second = self._axes[1], self._axes[2]
        follows = self._held or (first.leg and first.goal is None) or (second.leg and second.goal is None)
        aimed = self._aimed(now) if follows else _NOWHERE
        return self._ordered_one(first, aimed[0], now), self._ordered_one(second, aimed[1], now)

    def _ordered_one(self, motor: Axis, aim: float, now: float) -> float:
        if motor.leg is not None:
            return (aim if motor.goal is None else motor.goal) - motor.leg.remaining(now)
        if self._held:
            return aim + (motor.added + motor.pulse) * (now - motor.since)
        return motor.position + (motor.added + motor.pulse + motor.rate) * (now - motor.since)

    def _ordered_speeds(self, now: float) -> Pair:
        before, after = self._ordered(now), self._ordered(now + _STEP)
        return wrap180(after[0] - before[0]) / _STEP, wrap180(after[1] - before[1]) / _STEP

    def _aimed(self, now: float) -> Pair:
        """The axes that point at the aim, by what the mount believes."""
        ra, dec = self._aim
        if self._held:
            ra += (SIDEREAL_RATE - self._drive_rate) * (now - self._axes[1].since)
        first, second = self.geometry.axes(wrap180(self.sky.sidereal(now) - ra), dec, self.flipped)
        return first - self.correction[0], second - self.correction[1]

    def _from_axes(self, now: float, axes: Pair, correction: Pair) -> Pair:
        hour_angle, dec = self.geometry.sky(axes[0] + correction[0], axes[1] + correction[1])
        return wrap360(self.sky.sidereal(now) - hour_angle), dec

    def _note(self, now: float) -> None:
        """Note where the axes are and how fast they turn: what they are told next begins with that."""
        here, speeds = self._where(now), self._speeds(now)
        changing = any(motor.added or motor.pulse or now < motor.ramp.ends for motor in self._axes.values())
        for motor, position, speed in zip(self._axes.values(), here, speeds, strict=True):
            quickest = motor.ramp.acceleration if now < motor.ramp.ends else 0.0
            if motor.leg is not None:  # one that was hurried on its way can be hurried to rest
                quickest = max(quickest, motor.leg.acceleration)
            motor.acceleration = max(self.acceleration, quickest)
            motor.position, motor.since, motor.speed = position, now, speed
        if self._held and (changing or self._drive_rate != SIDEREAL_RATE):
            self._aim = self._from_axes(now, here, self.correction)
        self._noted = True

    def _begin_ramps(self) -> None:
        """After an order: change from the noted speeds to those that are ordered now."""
        if not self._noted:
            return
        self._noted = False
        since = self._axes[1].since
        run_on = False
        for motor, told in zip(self._axes.values(), self._ordered_speeds(since), strict=True):
            if motor.leg is None or motor.leg.started == since:  # else it goes on with its way
                quickest = math.sqrt(self.acceleration * motor.acceleration) * RAMP_SECONDS
                run_on = motor.ramp_from(since, told, quickest) != 0.0 or run_on
        if self._held and run_on:
            self._aim = self._from_axes(since, self._positions, self.correction)
            self.flipped = abs(wrap180(self._positions[1] + self.correction[1])) > 90.0
