"""The mechanics of a simulated mount: two motors as functions of time, with tracking, gotos and hand motion.

It is independent of protocols and clocks: every method takes ``now`` in Unix seconds. Between two calls the axes move
by formula (``axis_motion.py``), not in steps, so nothing depends on how often a caller reads them. Angles are degrees,
rates degrees a second of time. A motor rests, turns at a rate, does a goto, or follows the sky; it accelerates and
brakes between them.
"""

from __future__ import annotations

import math

from gateway.astro.axes import Build, Geometry, Pair, Sky
from gateway.astro.spherical import wrap180, wrap360
from gateway.protocols.mechanics.axis_motion import AxisMotion
from gateway.protocols.mechanics.axis_motor import APPROACH_RATE, Leg


class Mechanics(AxisMotion):
    """A mount. ``suspended_since`` is when a motor was first ordered to do something else than tracking, or None."""

    def __init__(self, build: Build, sky: Sky, now: float, axes: Pair) -> None:
        super().__init__(build, sky, now, axes)
        self.speed = 1.0  # a factor for the speed of gotos
        self.suspended_since: float | None = None
        self._on, self._sense = False, 1

    def axes(self, now: float) -> Pair:
        """Return the positions of the motor axes: the first in [0, 360), the second in [-180, 180)."""
        self.advance(now)
        first, second = self._positions_at(now)
        return wrap360(first), wrap180(second)

    def speeds(self, now: float) -> Pair:
        """Return the speeds of the motor axes, degrees a second."""
        self.advance(now)
        return self._speeds_at(now)

    def truth(self, now: float) -> Pair:
        """Return the true right ascension and declination of date, whatever site and clock the mount believes in."""
        hour_angle, dec = Geometry(self.build, self.true_sky.latitude).sky(*self.axes(now))
        return wrap360(self.true_sky.sidereal(now) - hour_angle), dec

    def runs_on(self, now: float) -> bool:
        """Whether a motor is still changing to its ordered speed, rest included."""
        self.advance(now)
        self._begin_ramps()
        return any(now < motor.ramp.ends for motor in self._axes.values())

    def moving(self, now: float) -> bool:
        """Whether a motor turns for anything but tracking: a goto, hand motion, guiding, or running on afterwards."""
        return self.runs_on(now) or any(motor.ordered for motor in self._axes.values())

    def believed(self, now: float) -> Pair:
        """Return right ascension and declination as the mount believes them; past the pole beyond 90 degrees."""
        axes = self.axes(now)
        if self.slewing(now):
            return self._from_axes(now, axes, self.correction)
        first, second = axes[0] + self.correction[0], axes[1] + self.correction[1]
        hour_angle, dec = self.geometry.unfolded(first, second, self.flipped)
        return wrap360(self.sky.sidereal(now) - hour_angle), dec

    def slewing(self, now: float, axis: int | None = None) -> bool:
        self.advance(now)
        if axis is None:
            return self._axes[1].leg is not None or self._axes[2].leg is not None
        leg = self._axes[axis].leg
        return leg is not None and now < leg.ends

    def tracking(self, now: float) -> bool:
        """Whether the motors follow the sky at this moment. The second motor of a polar mount rests meanwhile."""
        first, second = self._axes[1], self._axes[2]
        if self.slewing(now) or (second.overridden and (second.rate or self.build is Build.ALTAZ)):
            return False
        if first.overridden:
            return first.drive and self.build is not Build.ALTAZ and first.rate * self.geometry.pole > 0
        return self._on and (self.build is Build.ALTAZ or self._sense == self.geometry.pole)

    def pulsing(self, now: float, axis: int) -> bool:
        self.advance(now)
        return self._axes[axis].pulse != 0.0

    def track(self, now: float, on: bool, sense: int = 1) -> None:
        """Turn tracking on or off; hand motion ends, a goto continues. ``sense``: the direction of a polar axis."""
        self.advance(now)
        self._on, self._sense = on, sense
        if not self.slewing(now):
            self._follow(now)

    def set_drive_rate(self, now: float, rate: float) -> None:
        """Track at this rate instead of the sidereal one, on every build; hand motion and gotos continue."""
        self._advance_and_note(now)
        self._drive_rate = rate
        if not any(motor.overridden or motor.leg is not None for motor in self._axes.values()):
            self._follow(now)

    def resume(self, now: float) -> None:
        """Track the position that the mount believes to point at (or rest); earlier orders end."""
        self.advance(now)
        self._follow(now)

    def resume_axis(self, now: float, axis: int) -> None:
        """End the hand motion of one axis. The first of a polar mount tracks again, even if the other still moves."""
        self.move(now, axis, 0.0)
        if axis == 1 and self.build is not Build.ALTAZ and self._axes[1].overridden:
            self._advance_and_note(now)
            self._axes[1].rest()
            self._axes[1].rate = self._sense * self._drive_rate * self._on

    def goto_sky(self, now: float, ra: float, dec: float) -> None:
        """Slew to a sky position, which moves on meanwhile; track it on arrival if tracking is on."""
        self._advance_and_note(now)
        hour_angle = wrap180(self.sky.sidereal(now) - ra)
        self.flipped = self.geometry.other_side(hour_angle)
        self._aim, self._follows_aim = (ra, dec), False
        self._begin_goto(now, self._axes_at_aim(now), fixed=False)

    def goto_axes(self, now: float, first: float, second: float) -> None:
        """Slew to axis positions; track from there if tracking is on."""
        self._advance_and_note(now)
        self._follows_aim = False
        self.flipped = self.build is Build.GERMAN and wrap180(second - 90.0) > 0.0
        self._begin_goto(now, (first, second), fixed=True)

    def goto_axis(self, now: float, axis: int, position: float, slow: bool = False) -> None:
        """Slew one motor alone; it rests at the goal. The other motor keeps its last rate."""
        self._override_tracking(now, axis)
        motor = self._axes[axis]
        fast = APPROACH_RATE * self.speed if slow else None
        motor.leg, motor.goal = self._leg(now, axis, motor.position, position, fast), position

    def cancel(self, now: float) -> None:
        """End a goto at once; track from there if tracking is on."""
        if self.slewing(now):
            self._advance_and_note(now)
            self._end_goto(now)

    def move(self, now: float, axis: int, rate: float, gentle: bool = False) -> None:
        """Move an axis by hand; rate 0 ends it. A ``gentle`` rate adds to a polar mount's tracking, others override it.

        Rate 0 ends hand motion or the goto of this axis and does nothing to an axis that has neither.
        Tracking that was overridden stays off until `track` or `resume`.
        """
        self.advance(now)
        motor = self._axes[axis]
        added = self.build is not Build.ALTAZ and (motor.drive if motor.overridden else self._on)
        if motor.leg is None and added and (gentle or rate == 0.0):
            self._advance_and_note(now)
            motor.added = rate
        elif rate != 0.0:
            self.set_rate(now, axis, rate)
        elif motor.leg is not None and not motor.overridden:
            self._advance_and_note(now)
            motor.leg = None
            if all(other.leg is None for other in self._axes.values()):
                self._end_goto(now)
        elif motor.overridden and not motor.drive:
            self.set_rate(now, axis, 0.0)

    def set_rate(self, now: float, axis: int, rate: float, drive: bool = False) -> None:
        """Turn one motor at a rate instead of tracking. A ``drive`` rate counts as tracking: gentle rates add to it."""
        self._override_tracking(now, axis)
        self._axes[axis].rate, self._axes[axis].drive = max(-self.fastest, min(self.fastest, rate)), drive

    def pulse(self, now: float, axis: int, rate: float, seconds: float) -> None:
        """Add a rate to the motor's other motion for some seconds."""
        self._advance_and_note(now)
        self._axes[axis].pulse, self._axes[axis].pulse_ends = rate, now + seconds

    def sync(self, now: float, ra: float, dec: float) -> None:
        """Correct the axes so that the mount believes to point at this position now."""
        first, second = self.axes(now)
        there = self.geometry.axes(wrap180(self.sky.sidereal(now) - ra), dec, self.flipped)
        self.correct(now, (wrap180(there[0] - first), wrap180(there[1] - second)))

    def correct(self, now: float, correction: Pair) -> None:
        """Set the correction of the believed axis positions, degrees; nothing moves."""
        self._advance_and_note(now)
        self.correction = correction
        self._renew_aim(now)

    def relocate(self, now: float, sky: Sky) -> None:
        """Use another site or clock: the axes stay, the position they are believed to point at changes."""
        self._advance_and_note(now)
        self.sky = sky
        self._renew_aim(now)

    def rebuild(self, now: float, build: Build) -> None:
        """Put a fork on a wedge, or take it off: the tube keeps its direction."""
        if build is self.build:
            return
        self.cancel(now)
        first, second = self.axes(now)
        truth = Geometry(self.build, self.true_sky.latitude).sky(first, second)
        believed = self.geometry.sky(first + self.correction[0], second + self.correction[1])
        self._advance_and_note(now)
        self.build, self.flipped, self._follows_aim = build, False, False
        there = Geometry(build, self.true_sky.latitude).axes(*truth, False)
        assumed = self.geometry.axes(*believed, False)
        self.correction = wrap180(assumed[0] - there[0]), wrap180(assumed[1] - there[1])
        for motor, position in zip(self._axes.values(), there, strict=True):
            motor.position, motor.rate, motor.speed = position, 0.0, 0.0
        self._follow(now)

    def advance(self, now: float) -> None:
        """Carry out, in order of time, the arrivals and the ends of pulses that are due by ``now``."""
        if self._noted:
            self._begin_ramps()  # they decide when a goto ends, whether or not a caller has read the axes meanwhile
        first, second = self._axes[1], self._axes[2]
        while first.leg or second.leg or first.pulse or second.pulse:
            ends = [(motor.pulse_ends, number) for number, motor in self._axes.items() if motor.pulse]
            legs = [motor.leg.ends for motor in self._axes.values() if motor.leg is not None]
            due = min([*ends, (max(legs), 0)] if legs else ends, default=(math.inf, 0))
            if due[0] > now:
                return
            self._note(due[0])
            if due[1]:
                self._axes[due[1]].pulse = 0.0
            else:
                self._end_goto(due[0])

    def _advance_and_note(self, now: float) -> None:
        """Advance to ``now`` and note positions and speeds, so that the next order begins with them."""
        self.advance(now)
        self._note(now)

    def _follow(self, now: float) -> None:
        """Track (or rest) from the present axis positions."""
        self._note(now)
        self.suspended_since = None
        for motor in self._axes.values():
            motor.rest()
        if self.build is not Build.ALTAZ:
            self._axes[1].rate = self._sense * self._drive_rate * self._on
        elif self._on and not self._follows_aim:
            here = self._positions
            self._aim = self._from_axes(now, here, self.correction)
            self.flipped = abs(wrap180(here[1] + self.correction[1])) > 90.0
        self._follows_aim = self._on and self.build is Build.ALTAZ

    def _override_tracking(self, now: float, axis: int) -> None:
        """Override the tracking of one motor; in alt-az the other motor keeps its last rate."""
        self._advance_and_note(now)
        if self._follows_aim:
            before, after = self._axes_at_aim(now), self._axes_at_aim(now + 1.0)
            for motor, p, q in zip(self._axes.values(), before, after, strict=True):
                motor.rate = wrap180(q - p)
            self._follows_aim = False
        self._axes[axis].rest()
        self._axes[axis].overridden = True
        if self.suspended_since is None:
            self.suspended_since = now

    def _leg(self, now: float, axis: int, here: float, there: float, fast: float | None = None) -> Leg:
        slow, distance = APPROACH_RATE * self.speed, self.geometry.travel(axis, here, there)
        return Leg(now, distance, fast or self.fastest * self.speed, slow, self.acceleration * self.speed**2)

    def _begin_goto(self, now: float, there: Pair, fixed: bool) -> None:
        """Begin a goto from the noted axis positions."""
        self.suspended_since = None
        for number, motor in self._axes.items():
            motor.rest()
            motor.leg = self._leg(now, number, motor.position, there[number - 1])
            motor.goal = there[number - 1] if fixed else None

    def _end_goto(self, now: float) -> None:
        """End the goto and track again, unless a motor has another order."""
        for motor in self._axes.values():
            motor.leg = motor.goal = None
        if self.build is Build.GERMAN:  # a goto that was cancelled half way may end on either side
            self.flipped = wrap180(self._axes[2].position + self.correction[1] - 90.0) > 0.0
        if not any(motor.overridden for motor in self._axes.values()):
            self._follow(now)

    def _renew_aim(self, now: float) -> None:
        """After a change of site, clock or correction: track the new position, continue a goto to the same goal."""
        if self._follows_aim:
            self._aim = self._from_axes(now, self._positions, self.correction)
        elif any(motor.leg is not None and motor.goal is None for motor in self._axes.values()):
            self._begin_goto(now, self._axes_at_aim(now), fixed=False)
