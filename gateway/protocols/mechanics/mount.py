"""The mechanics of a simulated mount: two motors as functions of time, with tracking, gotos and hand motion.

It is independent of protocols and clocks: every method takes ``now`` in Unix seconds and calculates the axes. A motor
rests, turns at a rate, does a goto, or follows the sky. Its position is the ordered position minus the distance that it
still runs on or lags behind (``axis_motor.Ramp``), so every motion is continuous. Angles are degrees, rates degrees a
second of time.
"""

from __future__ import annotations

import math

from gateway.astro.axes import Build, Geometry, Observer, Pair
from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.protocols.mechanics.axis_motor import APPROACH_RATE, RAMP_SECONDS, Axis, AxisGoto

#: Seconds between two positions whose difference gives the ordered speed: a power of two, for exact arithmetic.
_DIFFERENCE_STEP = 2.0**-7
#: Used instead of the axis positions at the target if no axis follows it: the calculation would take long.
_NO_TARGET: Pair = (math.nan, math.nan)


class Mechanics:
    """The mechanics of a mount, and what it believes of its pointing. ``axes`` are the axis positions at ``now``."""

    def __init__(self, build: Build, sky: Observer, now: float, axes: Pair) -> None:
        #: Its build; the site and clock with which it calculates; the true site and clock, which no command changes.
        self.build, self.sky, self.true_sky = build, sky, sky
        self.max_rate = 4.0  # degrees a second
        self.acceleration = self.max_rate / RAMP_SECONDS  # degrees a second squared; infinite: speeds change at once
        self.sync_correction: Pair = (0.0, 0.0)  # by syncs: believed minus true axis positions, degrees
        self.flipped = False  # it points in the second of two possible ways: past the pole or the zenith
        self._drive_rate = SIDEREAL_RATE  # the rate of tracking, degrees a second
        self._axes = {1: Axis(axes[0], now), 2: Axis(axes[1], now)}
        self._target: Pair = (0.0, 0.0)  # right ascension and declination that are tracked, or the target of a goto
        self._follows_target = False  # an alt-az mount tracks: both axes follow the target
        self._state_noted = False  # ``_note_state`` has run for the next order, ``_begin_ramps`` has not
        self.speedup = 1.0  # a factor for the speed of gotos
        #: When a motor was first ordered to do something other than tracking; None while no such order is in force.
        self.suspended_since: float | None = None
        self._tracks, self._tracking_sense = False, 1  # tracking, and its direction on a polar axis

    def axes(self, now: float) -> Pair:
        """Return the positions of the motor axes: the first in [0, 360), the second in [-180, 180)."""
        self.advance(now)
        first, second = self._positions_at(now)
        return wrap360(first), wrap180(second)

    def speeds(self, now: float) -> Pair:
        """Return the speeds of the motor axes, degrees a second."""
        self.advance(now)
        return self._speeds_at(now)

    def true_position(self, now: float) -> Pair:
        """Return the true right ascension and declination of date, whatever site and clock the mount believes in."""
        hour_angle, dec = Geometry(self.build, self.true_sky.latitude).ha_dec_of_axes(*self.axes(now))
        return wrap360(self.true_sky.lst(now) - hour_angle), dec

    def is_ramping(self, now: float) -> bool:
        """Whether a motor is still changing to its ordered speed, or to rest."""
        self.advance(now)
        self._begin_ramps()
        return any(now < motor.ramp.ends_at for motor in self._axes.values())

    def is_moving(self, now: float) -> bool:
        """Whether a motor turns for anything but tracking: a goto, hand motion, guiding, or running on afterwards."""
        return self.is_ramping(now) or any(motor.has_order for motor in self._axes.values())

    def believed_position(self, now: float) -> Pair:
        """Return right ascension and declination as the mount believes them; past the pole dec is beyond ±90."""
        axes = self.axes(now)
        if self.slewing(now):
            return self._sky_position(now, axes, self.sync_correction)
        first, second = axes[0] + self.sync_correction[0], axes[1] + self.sync_correction[1]
        hour_angle, dec = self.geometry.unfolded_ha_dec(first, second, self.flipped)
        return wrap360(self.sky.lst(now) - hour_angle), dec

    def slewing(self, now: float, axis: int | None = None) -> bool:
        """Whether a goto of this axis, or of any if ``axis`` is None, is under way."""
        self.advance(now)
        if axis is None:
            return self._axes[1].goto is not None or self._axes[2].goto is not None
        leg = self._axes[axis].goto
        return leg is not None and now < leg.ends_at

    def arrival_time(self, now: float) -> float:
        """Return when the goto ends; ``now`` if there is none."""
        return max([now, *(motor.goto.ends_at for motor in self._axes.values() if motor.goto is not None)])

    def tracking(self, now: float) -> bool:
        """Whether the mount follows the sky at this moment. While a polar mount tracks, its second motor rests."""
        first, second = self._axes[1], self._axes[2]
        if self.slewing(now) or (second.overrides and (second.rate or self.build is Build.ALTAZ)):
            return False
        if first.overrides:
            return first.drive and self.build is not Build.ALTAZ and first.rate * self.geometry.pole_sign > 0
        return self._tracks and (self.build is Build.ALTAZ or self._tracking_sense == self.geometry.pole_sign)

    def pulsing(self, now: float, axis: int) -> bool:
        self.advance(now)
        return self._axes[axis].pulse != 0.0

    def track(self, now: float, on: bool, sense: int = 1) -> None:
        """Turn tracking on or off; hand motion ends, a goto continues. ``sense``: the direction of a polar axis."""
        self.advance(now)
        self._tracks, self._tracking_sense = on, sense
        if not self.slewing(now):
            self._track_or_rest(now)

    def set_drive_rate(self, now: float, rate: float) -> None:
        """Track at this rate instead of the sidereal rate, on every build; hand motion and gotos continue."""
        self._advance_and_note(now)
        self._drive_rate = rate
        if not any(motor.overrides or motor.goto is not None for motor in self._axes.values()):
            self._track_or_rest(now)

    def resume_tracking(self, now: float) -> None:
        """End all orders; track the position where the mount believes it points, or rest if tracking is off."""
        self.advance(now)
        self._track_or_rest(now)

    def resume_axis(self, now: float, axis: int) -> None:
        """End the hand motion of an axis. The first of a polar mount then tracks, even if the second still moves."""
        self.move(now, axis, 0.0)
        if axis == 1 and self.build is not Build.ALTAZ and self._axes[1].overrides:
            self._advance_and_note(now)
            self._axes[1].clear_orders()
            self._axes[1].rate = self._tracking_sense * self._drive_rate * self._tracks

    def goto_sky(self, now: float, ra: float, dec: float) -> None:
        """Slew to right ascension and declination, degrees; track on arrival if tracking is on."""
        self._advance_and_note(now)
        hour_angle = wrap180(self.sky.lst(now) - ra)
        self.flipped = self.geometry.is_flipped(hour_angle)
        self._target, self._follows_target = (ra, dec), False
        self._begin_goto(now, self._axes_on_target(now), to_axes=False)

    def goto_axes(self, now: float, first: float, second: float) -> None:
        """Slew to axis positions; track from there if tracking is on."""
        self._advance_and_note(now)
        self._follows_target = False
        self.flipped = self.build is Build.GERMAN and wrap180(second - 90.0) > 0.0
        self._begin_goto(now, (first, second), to_axes=True)

    def goto_axis(self, now: float, axis: int, position: float, slowly: bool = False) -> None:
        """Slew a single motor, ``slowly`` at the approach rate; it rests at the goal. The other keeps its last rate."""
        self._suspend_tracking(now, axis)
        motor = self._axes[axis]
        fast = APPROACH_RATE * self.speedup if slowly else None
        motor.goto, motor.goal = self._make_axis_goto(now, axis, motor.position, position, fast), position

    def stop_goto(self, now: float) -> None:
        """End a goto at once; track from there if tracking is on."""
        if self.slewing(now):
            self._advance_and_note(now)
            self._end_goto(now)

    def move(self, now: float, axis: int, rate: float, additive: bool = False) -> None:
        """Move an axis by hand. An ``additive`` rate is added to a polar mount's tracking, others override it.

        Rate 0 ends hand motion or the goto of this axis and does nothing to an axis that has neither.
        Tracking that was overridden stays off until `track` or `resume_tracking`.
        """
        self.advance(now)
        motor = self._axes[axis]
        added = self.build is not Build.ALTAZ and (motor.drive if motor.overrides else self._tracks)
        if motor.goto is None and added and (additive or rate == 0.0):
            self._advance_and_note(now)
            motor.added_rate = rate
        elif rate != 0.0:
            self.set_rate(now, axis, rate)
        elif motor.goto is not None and not motor.overrides:
            self._advance_and_note(now)
            motor.goto = None
            if all(other.goto is None for other in self._axes.values()):
                self._end_goto(now)
        elif motor.overrides and not motor.drive:
            self.set_rate(now, axis, 0.0)

    def set_rate(self, now: float, axis: int, rate: float, is_drive_rate: bool = False) -> None:
        """Turn a motor at a rate instead of tracking. With ``is_drive_rate`` it counts as tracking."""
        self._suspend_tracking(now, axis)
        self._axes[axis].rate, self._axes[axis].drive = max(-self.max_rate, min(self.max_rate, rate)), is_drive_rate

    def pulse(self, now: float, axis: int, rate: float, seconds: float) -> None:
        """Add a rate to the motor's other motion for some seconds."""
        self._advance_and_note(now)
        self._axes[axis].pulse, self._axes[axis].pulse_ends_at = rate, now + seconds

    def sync(self, now: float, ra: float, dec: float) -> None:
        """Correct the axes so that the mount believes that it points at this position now."""
        first, second = self.axes(now)
        target = self.geometry.to_axes(wrap180(self.sky.lst(now) - ra), dec, self.flipped)
        self.correct(now, (wrap180(target[0] - first), wrap180(target[1] - second)))

    def correct(self, now: float, correction: Pair) -> None:
        """Set the correction of the believed axis positions, degrees; nothing moves."""
        self._advance_and_note(now)
        self.sync_correction = correction
        self._renew_target(now)

    def relocate(self, now: float, sky: Observer) -> None:
        """Use another site or clock: the axes stay, but their believed position on the sky changes."""
        self._advance_and_note(now)
        self.sky = sky
        self._renew_target(now)

    def set_build(self, now: float, build: Build) -> None:
        """Put a fork mount on a wedge, or take it off. The tube keeps its direction."""
        if build is self.build:
            return
        self.stop_goto(now)
        first, second = self.axes(now)
        truth = Geometry(self.build, self.true_sky.latitude).ha_dec_of_axes(first, second)
        believed = self.geometry.ha_dec_of_axes(first + self.sync_correction[0], second + self.sync_correction[1])
        self._advance_and_note(now)
        self.build, self.flipped, self._follows_target = build, False, False
        actual = Geometry(build, self.true_sky.latitude).to_axes(*truth, False)
        assumed = self.geometry.to_axes(*believed, False)
        self.sync_correction = wrap180(assumed[0] - actual[0]), wrap180(assumed[1] - actual[1])
        for motor, position in zip(self._axes.values(), actual, strict=True):
            motor.position, motor.rate, motor.speed = position, 0.0, 0.0
        self._track_or_rest(now)

    def advance(self, now: float) -> None:
        """Advance to ``now``: carry out the arrivals of gotos and ends of guide pulses until then, in order."""
        if self._state_noted:
            self._begin_ramps()  # they decide when a goto ends, whether or not a caller has read the axes meanwhile
        first, second = self._axes[1], self._axes[2]
        while first.goto or second.goto or first.pulse or second.pulse:
            ends = [(motor.pulse_ends_at, number) for number, motor in self._axes.items() if motor.pulse]
            legs = [motor.goto.ends_at for motor in self._axes.values() if motor.goto is not None]
            due = min([*ends, (max(legs), 0)] if legs else ends, default=(math.inf, 0))
            if due[0] > now:
                return
            self._note_state(due[0])
            if due[1]:
                self._axes[due[1]].pulse = 0.0
            else:
                self._end_goto(due[0])

    def _advance_and_note(self, now: float) -> None:
        """Advance to ``now``, and note positions and speeds, with which the next order begins."""
        self.advance(now)
        self._note_state(now)

    def _track_or_rest(self, now: float) -> None:
        """Track from the present axis positions, or rest if tracking is off."""
        self._note_state(now)
        self.suspended_since = None
        for motor in self._axes.values():
            motor.clear_orders()
        if self.build is not Build.ALTAZ:
            self._axes[1].rate = self._tracking_sense * self._drive_rate * self._tracks
        elif self._tracks and not self._follows_target:
            positions = self._positions
            self._target = self._sky_position(now, positions, self.sync_correction)
            self.flipped = abs(wrap180(positions[1] + self.sync_correction[1])) > 90.0
        self._follows_target = self._tracks and self.build is Build.ALTAZ

    def _suspend_tracking(self, now: float, axis: int) -> None:
        """Begin an order that overrides tracking of a motor. On an alt-az mount the other motor keeps its last rate."""
        self._advance_and_note(now)
        if self._follows_target:
            before, after = self._axes_on_target(now), self._axes_on_target(now + 1.0)
            for motor, p, q in zip(self._axes.values(), before, after, strict=True):
                motor.rate = wrap180(q - p)
            self._follows_target = False
        self._axes[axis].clear_orders()
        self._axes[axis].overrides = True
        if self.suspended_since is None:
            self.suspended_since = now

    def _make_axis_goto(self, now: float, axis: int, start: float, end: float, fast: float | None = None) -> AxisGoto:
        slow, distance = APPROACH_RATE * self.speedup, self.geometry.axis_travel(axis, start, end)
        return AxisGoto(now, distance, fast or self.max_rate * self.speedup, slow, self.acceleration * self.speedup**2)

    def _begin_goto(self, now: float, goal: Pair, to_axes: bool) -> None:
        """Begin a goto from the noted axis positions; ``to_axes``: to axis positions instead of a target on the sky."""
        self.suspended_since = None
        for number, motor in self._axes.items():
            motor.clear_orders()
            motor.goto = self._make_axis_goto(now, number, motor.position, goal[number - 1])
            motor.goal = goal[number - 1] if to_axes else None

    def _end_goto(self, now: float) -> None:
        """End the goto and track again, unless a motor has another order."""
        for motor in self._axes.values():
            motor.goto = motor.goal = None
        if self.build is Build.GERMAN:  # a goto that was cancelled half way may end on either side
            self.flipped = wrap180(self._axes[2].position + self.sync_correction[1] - 90.0) > 0.0
        if not any(motor.overrides for motor in self._axes.values()):
            self._track_or_rest(now)

    def _renew_target(self, now: float) -> None:
        """After a change of site, clock or correction: track the new position, continue a goto to the same goal."""
        if self._follows_target:
            self._target = self._sky_position(now, self._positions, self.sync_correction)
        elif any(motor.goto is not None and motor.goal is None for motor in self._axes.values()):
            self._begin_goto(now, self._axes_on_target(now), to_axes=False)

    # --- positions by formula ---------------------------------------------------------------------------------------

    @property
    def geometry(self) -> Geometry:
        return Geometry(self.build, self.sky.latitude)

    @property
    def _positions(self) -> Pair:
        return self._axes[1].position, self._axes[2].position

    def _positions_at(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered_positions(now)
        return first - self._axes[1].ramp.remaining_run_on(now), second - self._axes[2].ramp.remaining_run_on(now)

    def _speeds_at(self, now: float) -> Pair:
        self._begin_ramps()
        first, second = self._ordered_speeds(now)
        return first + self._axes[1].ramp.speed(now), second + self._axes[2].ramp.speed(now)

    def _ordered_positions(self, now: float) -> Pair:
        """Return both axis positions without ramps, as if the motors had changed to the ordered speeds at once."""
        first, second = self._axes[1], self._axes[2]
        follows = self._follows_target or (first.goto and first.goal is None) or (second.goto and second.goal is None)
        aimed = self._axes_on_target(now) if follows else _NO_TARGET
        return self._ordered_position(first, aimed[0], now), self._ordered_position(second, aimed[1], now)

    def _ordered_position(self, motor: Axis, target: float, now: float) -> float:
        if motor.goto is not None:
            return (target if motor.goal is None else motor.goal) - motor.goto.remaining(now)
        if self._follows_target:
            return target + (motor.added_rate + motor.pulse) * (now - motor.since)
        return motor.position + (motor.added_rate + motor.pulse + motor.rate) * (now - motor.since)

    def _ordered_speeds(self, now: float) -> Pair:
        before, after = self._ordered_positions(now), self._ordered_positions(now + _DIFFERENCE_STEP)
        return wrap180(after[0] - before[0]) / _DIFFERENCE_STEP, wrap180(after[1] - before[1]) / _DIFFERENCE_STEP

    def _axes_on_target(self, now: float) -> Pair:
        """Return the axis positions that point at the target, with the mount's site, clock and correction."""
        ra, dec = self._target
        if self._follows_target:
            ra += (SIDEREAL_RATE - self._drive_rate) * (now - self._axes[1].since)
        first, second = self.geometry.to_axes(wrap180(self.sky.lst(now) - ra), dec, self.flipped)
        return first - self.sync_correction[0], second - self.sync_correction[1]

    def _sky_position(self, now: float, axes: Pair, correction: Pair) -> Pair:
        hour_angle, dec = self.geometry.ha_dec_of_axes(axes[0] + correction[0], axes[1] + correction[1])
        return wrap360(self.sky.lst(now) - hour_angle), dec

    def _note_state(self, now: float) -> None:
        """Note positions and speeds of the axes at ``now``, with which the next order begins."""
        positions, speeds = self._positions_at(now), self._speeds_at(now)
        changing = any(motor.added_rate or motor.pulse or now < motor.ramp.ends_at for motor in self._axes.values())
        for motor, position, speed in zip(self._axes.values(), positions, speeds, strict=True):
            quickest = motor.ramp.acceleration if now < motor.ramp.ends_at else 0.0
            if motor.goto is not None:  # a motor with a faster acceleration during a goto can also brake with it
                quickest = max(quickest, motor.goto.acceleration)
            motor.acceleration = max(self.acceleration, quickest)
            motor.position, motor.since, motor.speed = position, now, speed
        if self._follows_target and (changing or self._drive_rate != SIDEREAL_RATE):
            self._target = self._sky_position(now, positions, self.sync_correction)
        self._state_noted = True

    def _begin_ramps(self) -> None:
        """After an order, begin the ramps from the noted speeds to the ordered ones."""
        if not self._state_noted:
            return
        self._state_noted = False
        since = self._axes[1].since
        run_on = False
        for motor, ordered in zip(self._axes.values(), self._ordered_speeds(since), strict=True):
            if motor.goto is None or motor.goto.started_at == since:  # else it continues its goto
                quickest = math.sqrt(self.acceleration * motor.acceleration) * RAMP_SECONDS
                run_on = motor.ramp_from(since, ordered, quickest) != 0.0 or run_on
        if self._follows_target and run_on:
            self._target = self._sky_position(since, self._positions, self.sync_correction)
            self.flipped = abs(wrap180(self._positions[1] + self.sync_correction[1])) > 90.0
