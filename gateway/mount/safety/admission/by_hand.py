"""Admission of motion by hand and of guide pulses: refuses them if they would soon lead beyond a limit.

Only the first stretch of a motion is checked: as far as it gets before a stop at the next position ends it. Every point
of the stretch must be allowed, because beyond the zenith or the Sun its end may be allowed again. Both directions of
each axis are checked, because the axes may point over the pole or the zenith without the gateway's knowledge. A guide
pulse is checked in the same way.
"""

from __future__ import annotations

from itertools import product
from math import ceil
from typing import NamedTuple

from gateway.astro.spherical import SIDEREAL_RATE, fold_declination, wrap180
from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, PastMeridian, Refused
from gateway.mount.context import Context
from gateway.mount.policy import LIMIT_TOLERANCE, Limits
from gateway.mount.readings.cache import ReadingSource
from gateway.mount.safety.admission.altitudes import AltitudeSource, contradicting_sources, mount_sources
from gateway.mount.safety.admission.contradictions import sun_refusal
from gateway.mount.safety.admission.slew_paths import MAX_AXIS_TURN
from gateway.mount.safety.allow import MIN_POSITION_GAP, is_moving_out
from gateway.mount.safety.hour_angle import angle_from_axes, past_meridian, reports_axes
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.astrometry import Sun
from gateway.protocols.base.driver import BY_HAND_MESSAGE

#: Degrees of axis motion between two points of a stretch that are checked.
CHECK_STEP = 2.0
#: Age in seconds up to which a cached position counts as the start of a motion.
MAX_POSITION_AGE = 6.0


class StretchStart(NamedTuple):
    """The start of a stretch of motion.

    ``alt_sources`` are the sources by which altitudes are calculated. ``axis_angle`` is the angle of the first axis
    west of its middle, degrees; None if it is unknown or the hour angle has no limit. ``suns`` are the possible
    positions of the Sun, by each source.
    """

    position: op.Equatorial
    status: op.Status
    alt_sources: tuple[AltitudeSource, ...] = ()
    axis_angle: float | None = None
    suns: tuple[Sun, ...] = ()

    def past_meridian(self, mount: Context, west_turn: float) -> float | None:
        """Return how far the tube is past the meridian after a ``west_turn`` of axis 1, degrees; None if unknown."""
        return None if self.axis_angle is None else past_meridian(self.axis_angle + west_turn, mount.driver.german)


def reaction_turn(mount: Context, operation: op.Move | op.MoveAxis) -> float:
    """Return the degrees that an axis turns after the last position until a stop at the next one ends the motion."""
    age = mount.cache.age(op.Position, mount.now()) if mount.wanted.hand_moves else 0.0
    return operation.sense * mount.driver.speed(operation.rate) * (mount.stop_timing.reaction + MIN_POSITION_GAP + age)


def pulse_as_motion(pulse: op.Pulse | op.PulseAxis) -> tuple[op.Move | op.MoveAxis, float]:
    """Return a guide pulse as a motion by hand, and how far it turns its axis at most, degrees, with its sign."""
    degrees, guide = SIDEREAL_RATE * pulse.ms / 1000.0, op.Rate(name="guide")
    if isinstance(pulse, op.Pulse):
        return op.Move(pulse.direction, guide), pulse.direction.sense * degrees
    return op.MoveAxis(pulse.axis, pulse.sense, guide), pulse.sense * degrees * (pulse.rate or 1.0)


def check_both_directions(mount: Context, limits: Limits, start: StretchStart, turns: dict[int, float]) -> None:
    """Check turns of each axis by these degrees, either way. Raises the same errors as ``check_turns``."""
    for way in product(*({degrees, -degrees} for degrees in turns.values())):
        check_turns(mount, limits, start, dict(zip(turns, way, strict=True)))


def check_turns(mount: Context, limits: Limits, start: StretchStart, turns: dict[int, float]) -> None:
    """Check a stretch of motion, degrees per axis. Raises BelowHorizon, TooHigh, Contradicted, NearSun or PastMeridian.

    Raises Invalid if the stretch is not finite, or longer than any mount turns: checking it could take for ever.
    """
    if not all(abs(degrees) <= MAX_AXIS_TURN for degrees in turns.values()):
        raise Invalid("It would turn an axis by more than three whole turns.")
    steps = max(1, ceil(max(abs(degrees) for degrees in turns.values()) / CHECK_STEP))
    position, turned = start.position, 0.0
    for step in range(1, steps + 1):
        soon = _after_turns(mount, start, {axis: degrees * step / steps for axis, degrees in turns.items()})
        for source in start.alt_sources:
            before, after = source.altitude(position), source.altitude(soon)
            if is_moving_out(limits if source.is_best_known else limits.without_default_altitudes(), before, after):
                source.check(limits, after)
        for sun in start.suns:
            distance = mount.suns.distance(soon, sun)
            if distance < mount.suns.min_dist and distance < mount.suns.distance(position, sun):
                raise sun_refusal(mount.sources, sun)
        west = turns.get(1, 0.0) * step / steps
        if limits.hour_angle is not None:
            now, then = start.past_meridian(mount, turned), start.past_meridian(mount, west)
            if now is not None and then is not None and then > limits.hour_angle + LIMIT_TOLERANCE and then > now:
                raise PastMeridian
        position, turned = soon, west


def _after_turns(mount: Context, start: StretchStart, turns: dict[int, float]) -> op.Equatorial:
    """Return the position after the axes have turned by ``turns``, degrees."""
    first, second = turns.get(1, 0.0), turns.get(2, 0.0)
    if start.status.equatorial or mount.driver.moves_by_gotos:
        return op.Equatorial(*fold_declination(start.position.ra - first, start.position.dec + second))
    horizon = mount.astrometry.horizontal(start.position)
    return mount.astrometry.equatorial_of(op.Horizontal(*fold_declination(horizon.az + first, horizon.alt + second)))


class HandAdmission:
    """Admits motions by hand, and guide pulses."""

    def __init__(self, mount: Context, readings: ReadingSource, watch: LimitWatch) -> None:
        self._mount, self._readings, self._watch = mount, readings, watch

    async def check_motion(self, operation: op.Move | op.MoveAxis) -> None:
        """Raises one of the errors of ``check_turns`` if a stop could not end the motion in time."""
        mount = self._mount
        start = await self._read_start()
        if start is None:
            return
        limits = mount.policy.limits
        if isinstance(operation, op.Move):
            limits = limits.narrowed(operation.lowest, operation.highest)
        by_hand = {**mount.wanted.hand_moves, operation.axis: operation}
        turns = {axis: reaction_turn(mount, moving) for axis, moving in by_hand.items()}
        start = start._replace(alt_sources=(*start.alt_sources, *contradicting_sources(mount, limits)))
        await self._check_stretch(limits, start, by_hand, turns)

    async def check_pulse(self, pulse: op.Pulse | op.PulseAxis) -> None:
        """Raises one of the errors of ``check_turns`` if a guide pulse leads beyond a limit, or farther beyond it.

        Only Sun positions by the mount's own coordinates or axes count: a wrong clock must not end guiding. Raises
        Refused while somebody else moves the axis, because the pulse would end that motion.
        """
        if self._watch.others_move(pulse.axis if isinstance(pulse, op.PulseAxis) else pulse.direction.axis):
            raise Refused(BY_HAND_MESSAGE)
        start = await self._read_start()
        if start is not None:
            motion, degrees = pulse_as_motion(pulse)
            start = start._replace(suns=tuple(sun for sun in start.suns if sun.confirmed))
            await self._check_stretch(self._mount.policy.limits, start, {motion.axis: motion}, {motion.axis: degrees})

    async def _check_stretch(
        self, limits: Limits, start: StretchStart, hand_moves: dict[int, op.Move | op.MoveAxis], turns: dict[int, float]
    ) -> None:
        try:
            check_both_directions(self._mount, limits, start, turns)
        except Fault:  # a direction is forbidden, so find out in which the motors turn the tube
            for axis, moving in hand_moves.items():
                turns[axis] *= await self._motor_sense(moving, start.status)
            check_turns(self._mount, limits, start, turns)

    async def _read_start(self) -> StretchStart | None:
        """Return the position and status of the mount; None if no limit can be calculated."""
        mount, readings = self._mount, self._mount.cache
        if mount.sources.site() is None:
            return None
        # Clients turn tracking off before a slew, which clears the cached status.
        status: op.Status = readings.last_value(op.GetStatus) or await self._readings.read(op.GetStatus())
        if not status.aligned:
            return None
        position, age = readings.last_value(op.Position), readings.age(op.Position, mount.now())
        if position is None or age > MAX_POSITION_AGE:
            position = await self._readings.read(op.Position())
        elif mount.now() - age < self._watch.at_rest_since and not mount.wanted.hand_moves:  # it was still moving then
            position = await self._readings.read_now(op.Position())
        turned = await self._axis_angle(position) if self._watch.hour_angle.has_limit else None
        return StretchStart(position, status, tuple(mount_sources(mount)), turned, tuple(mount.suns.suns_to_avoid()))

    async def _axis_angle(self, position: op.Equatorial) -> float | None:
        """Return how far the first axis is turned from its middle, west positive; None if unknown."""
        mount = self._mount
        if reports_axes(mount):
            return angle_from_axes(mount, await self._readings.read(op.AxisPosition()))
        side = await self._readings.tube_side() if mount.driver.german else None
        return self._watch.hour_angle.axis_angle(mount.astrometry.sidereal_time() - position.ra, side)

    async def _motor_sense(self, operation: op.Move | op.MoveAxis, status: op.Status) -> int:
        """Return -1 if the motor turns the tube against the order, as in the south or beyond pole or zenith; else 1."""
        mount, by_motor = self._mount, isinstance(operation, op.MoveAxis)
        if mount.driver.moves_by_gotos:
            return 1
        pole = -1 if status.equatorial and mount.astrometry.site().latitude < 0 else 1
        if operation.axis == 1:
            return pole if by_motor else 1
        takes_directions = not mount.driver.implementation(op.AxisPosition)  # a Meade
        if status.equatorial and not by_motor and not takes_directions:
            return 1  # the driver handles this
        return (1 if takes_directions else pole) * (
            -1 if await is_beyond_pole_or_zenith(mount, self._readings, self._watch) else 1
        )


async def is_beyond_pole_or_zenith(mount: Context, readings: ReadingSource, watch: LimitWatch) -> bool:
    """Whether the tube has been driven over the pole or the zenith, so that it points the other way round."""
    if not mount.driver.implementation(op.AxisPosition):
        return not watch.observed.upright
    axes: op.Horizontal = await readings.read(op.AxisPosition())
    return abs(wrap180(axes.alt)) > 90.0


async def find_pointings(mount: Context, readings: ReadingSource, watch: LimitWatch) -> set[bool]:
    """Return in which of two ways the axes may point now: the usual (False), the other (True), or both if unknown.

    The other way is the west side of the pier in the north, and beyond the pole or zenith on a fork. On a German mount
    both are possible during a goto, without a reported pier side, if the side contradicts the declination axis (it may
    be that of the last goto, or of a hand control synced in the other way), or if the pole may have been passed unseen.
    """
    site = mount.astrometry.site_clock.site()
    if not mount.driver.german or site is None:
        return {False, not mount.driver.german and await is_beyond_pole_or_zenith(mount, readings, watch)}
    # during a goto the mount reports the pier side of the target
    under_way = mount.movement.slewing and await readings.read_now(op.Slewing())
    side = None if under_way else await readings.tube_side()
    axes_reported = mount.driver.implementation(op.AxisPosition) is not None
    if side is None or not (axes_reported or watch.observed.upright):
        return {False, True}
    reported_west = (side == "W") == (site.latitude >= 0.0)
    if not axes_reported:
        return {reported_west}
    axes: op.Horizontal = await readings.read(op.AxisPosition())
    return {reported_west, wrap180(axes.alt - 90.0) > 0.0}
