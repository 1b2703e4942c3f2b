"""Positions of the two motors of a simulated mount, by formula; the orders are given in ``mount.py``.

A motor's position is the ordered one (rest, a rate, a goto, following the sky) less what it still runs on or lags
behind (``axis_motor.Ramp``). An order first notes the present position and speed; at the next reading the ramps begin
that lead from the noted speeds to the ordered ones. So every motion is continuous, whatever the sequence of orders.
"""

from __future__ import annotations

import math

from gateway.astro.axes import Build, Geometry, Pair, Sky
from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS, Axis

#: Seconds between the two positions whose difference gives the ordered speed: a power of two, for exact arithmetic.
_STEP = 2.0**-7
#: Stands for the aim when no axis needs it, because calculating it takes longer than everything else.
_NOWHERE: Pair = (math.nan, math.nan)


class AxisMotion:
    """The motors of a mount. ``correction`` is what a sync adds to the axis positions to get the believed ones.

    ``sky`` is the site and clock that the mount believes in. ``true_sky`` is its true site and clock, which no command
    changes. ``acceleration`` is in degrees a second squared; infinite for motors without ramps, whose speed changes at
    once.
    """

    def __init__(self, build: Build, sky: Sky, now: float, axes: Pair) -> None:
        self.build, self.sky, self.true_sky = build, sky, sky
        self.fastest = 4.0  # degrees a second
        self.acceleration = self.fastest / RAMP_SECONDS
        self.correction: Pair = (0.0, 0.0)
        self.flipped = False
        self._drive_rate = SIDEREAL_RATE  # the rate of tracking
        self._axes = {1: Axis(axes[0], now), 2: Axis(axes[1], now)}
        self._aim: Pair = (0.0, 0.0)  # right ascension and declination
        self._follows_aim = False  # in alt-az both axes follow the aim
        self._noted = False  # positions and speeds are noted; the ramps of the next order have not begun

    @property
    def geometry(self) -> Geometry:
        return Geometry(self.build, self.sky.latitude)

    @property
    def _positions(self) -> Pair:
        return self._axes[1].position, self._axes[2].position

    def _positions_at(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered(now)
        return first - self._axes[1].ramp.left(now), second - self._axes[2].ramp.left(now)

    def _speeds_at(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered_speeds(now)
        return first + self._axes[1].ramp.speed(now), second + self._axes[2].ramp.speed(now)

    def _ordered(self, now: float) -> Pair:
        """Return both positions without the ramps: as if every change of speed had been completed at once."""
        first, second = self._axes[1], self._axes[2]
        follows = self._follows_aim or (first.leg and first.goal is None) or (second.leg and second.goal is None)
        aimed = self._axes_at_aim(now) if follows else _NOWHERE
        return self._ordered_one(first, aimed[0], now), self._ordered_one(second, aimed[1], now)

    def _ordered_one(self, motor: Axis, aim: float, now: float) -> float:
        if motor.leg is not None:
            return (aim if motor.goal is None else motor.goal) - motor.leg.remaining(now)
        if self._follows_aim:
            return aim + (motor.added + motor.pulse) * (now - motor.since)
        return motor.position + (motor.added + motor.pulse + motor.rate) * (now - motor.since)

    def _ordered_speeds(self, now: float) -> Pair:
        before, after = self._ordered(now), self._ordered(now + _STEP)
        return wrap180(after[0] - before[0]) / _STEP, wrap180(after[1] - before[1]) / _STEP

    def _axes_at_aim(self, now: float) -> Pair:
        """Return the axis positions that point at the aim, by the site, clock and correction the mount believes in."""
        ra, dec = self._aim
        if self._follows_aim:
            ra += (SIDEREAL_RATE - self._drive_rate) * (now - self._axes[1].since)
        first, second = self.geometry.axes(wrap180(self.sky.sidereal(now) - ra), dec, self.flipped)
        return first - self.correction[0], second - self.correction[1]

    def _from_axes(self, now: float, axes: Pair, correction: Pair) -> Pair:
        hour_angle, dec = self.geometry.sky(axes[0] + correction[0], axes[1] + correction[1])
        return wrap360(self.sky.sidereal(now) - hour_angle), dec

    def _note(self, now: float) -> None:
        """Note positions and speeds of the axes: the next order begins with them."""
        here, speeds = self._positions_at(now), self._speeds_at(now)
        changing = any(motor.added or motor.pulse or now < motor.ramp.ends for motor in self._axes.values())
        for motor, position, speed in zip(self._axes.values(), here, speeds, strict=True):
            quickest = motor.ramp.acceleration if now < motor.ramp.ends else 0.0
            if motor.leg is not None:  # a motor with a faster acceleration during a goto can also brake with it
                quickest = max(quickest, motor.leg.acceleration)
            motor.acceleration = max(self.acceleration, quickest)
            motor.position, motor.since, motor.speed = position, now, speed
        if self._follows_aim and (changing or self._drive_rate != SIDEREAL_RATE):
            self._aim = self._from_axes(now, here, self.correction)
        self._noted = True

    def _begin_ramps(self) -> None:
        """After an order, begin the ramps from the noted speeds to the ordered ones."""
        if not self._noted:
            return
        self._noted = False
        since = self._axes[1].since
        run_on = False
        for motor, ordered in zip(self._axes.values(), self._ordered_speeds(since), strict=True):
            if motor.leg is None or motor.leg.started == since:  # else it continues its goto
                quickest = math.sqrt(self.acceleration * motor.acceleration) * RAMP_SECONDS
                run_on = motor.ramp_from(since, ordered, quickest) != 0.0 or run_on
        if self._follows_aim and run_on:
            self._aim = self._from_axes(since, self._positions, self.correction)
            self.flipped = abs(wrap180(self._positions[1] + self.correction[1])) > 90.0
