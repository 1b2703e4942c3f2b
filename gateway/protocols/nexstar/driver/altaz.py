"""Slow motion of an alt-az mount on top of its tracking: hand motion below 0.1 degrees a second, and guiding.

A rate sent to one motor replaces the tracking of both axes. So the driver suspends tracking and sends each motor a
variable rate, the sum of its tracking rate and the added rates (``NexStar.added_rates``, one entry per ordered axis).
Tracking resumes when the last entry is removed. The tracking rates are calculated once, from the mount's azimuth and
altitude and the latitude: below 80 degrees of altitude they change by less than a tenth in a minute.
"""

from __future__ import annotations

from gateway.astro.spherical import az_alt_rates_by_dec, az_alt_rates_by_ha
from gateway.core.errors import Busy, Refused, Unsupported
from gateway.core.operations import Direction, Move, Pulse, Pulsed, Tracking
from gateway.protocols.base.driver import BY_HAND_MESSAGE, SLEWING_MESSAGE, Send, Steps
from gateway.protocols.nexstar.counting import SIDEREAL
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.pointing import axis_command, stop_current_motion
from gateway.protocols.nexstar.driver.state import MOTORS, NexStar, stop_command

Pair = tuple[float, float]

#: At this speed (degrees a second) and above, tracking makes no visible difference to the motion.
MAX_SLOW_SPEED = 0.1
#: Seconds: the line's pause after an acknowledgement; the longest delay assumed between the commands to both motors,
#: and the delay assumed before the first measurement.
LINE_PAUSE, MAX_MOTOR_DELAY, DEFAULT_MOTOR_DELAY = 0.03, 0.5, 0.1


def can_add_rates(mount: NexStar) -> bool:
    """Whether the mount's tracking mode is alt-az and it has variable rates (hand controls from 1.6 on)."""
    return tracking.native_mode(mount) is Tracking.ALTAZ and not mount.german and mount.supports("rate_azm_pos")


def moves_on_tracking(mount: NexStar, operation: Move) -> bool:
    """Whether to move on top of tracking. Without a latitude the axis moves as on a mount that does not track."""
    return can_add_rates(mount) and mount.site is not None and mount.speed(operation.rate) < MAX_SLOW_SPEED


def move(mount: NexStar, operation: Move) -> Steps:
    """Move an axis on top of tracking. Return False, with nothing moved, if the mount does not track."""
    axis, sign = operation.axis, operation.sense
    if mount.goto is not None:
        yield from stop_current_motion(mount)
    mount.parked = False
    yield from _read_az_alt(mount)
    yield from tracking.suspend(mount)
    if mount.suspended_mode is not Tracking.ALTAZ:
        return False
    speed = mount.speed(operation.rate)
    mount.moving[axis] = max(speed, mount.moving.get(axis, 0.0))  # until it has the new rate
    yield from _add_rates(mount, axis, _rates_for_axis(axis, sign * speed))
    mount.moving[axis] = speed
    return True


def pulse(mount: NexStar, operation: Pulse) -> Steps:
    """Guide along a motor axis, or in right ascension or declination with both motors; the caller ends the pulse.

    The motors do not track while the commands are sent, so faster rates make up for the lost tracking. If the gateway
    sends a command late, a longer pulse makes up for what the first motor loses. A pulse shorter than twice the delay
    between the two motors' commands becomes longer and slower. Raises Refused in motion, Unsupported without site.
    """
    direction = operation.direction
    if mount.goto is not None:
        raise Refused(SLEWING_MESSAGE)
    if mount.moving:
        raise Refused(BY_HAND_MESSAGE)
    if mount.site is None:
        raise Unsupported("Guiding on top of alt-az tracking needs the latitude: give it with --site.")
    az_alt = yield from _read_az_alt(mount)
    tracked = mount.suspended_mode is None
    suspend_seconds = yield from tracking.suspend(mount)
    delay = mount.motor_delay
    if delay is None:  # estimate: as long as suspending tracking took, plus the pause after it
        delay = DEFAULT_MOTOR_DELAY if suspend_seconds is None else min(MAX_MOTOR_DELAY, suspend_seconds + LINE_PAUSE)
    lasts = max(operation.ms / 1000.0, 2.0 * delay)
    rate = direction.sense * mount.guide_rates[direction.axis] * SIDEREAL * operation.ms / 1000.0 / lasts
    added = _rates_for_axis(direction.axis, rate)
    if operation.sky:
        first, second = _motor_ratios(direction, az_alt, mount)
        added = rate * first, rate * second
    mount.pulsing.add(direction.axis)
    loses_tracking = tracked and delay > 0.0  # while the commands reach the motors
    began, late = yield from _add_rates(mount, direction.axis, added, lasts if loses_tracking else None)
    extra_seconds = 0.0
    if loses_tracking:
        pulse_speed, tracking_speed = added[direction.axis - 1], mount.tracking_rates[direction.axis - 1]
        net_speed = pulse_speed + tracking_speed * (began - late - mount.suspended_at) / lasts
        extra_seconds = tracking_speed * late / net_speed if abs(net_speed) > abs(pulse_speed) / 2.0 else 0.0
    return Pulsed(lasts + max(-lasts / 2.0, min(lasts / 2.0, extra_seconds)), ends=False, since=began)


def stop_axis(mount: NexStar, axis: int) -> Steps:
    """End the slow motion ordered for an axis; other motion continues.

    If nothing else moves, send both motors rate 0 after hand motion, or their tracking rates after a pulse.
    """
    pulsed = axis in mount.pulsing
    mount.added_rates.pop(axis)
    mount.pulsing.discard(axis)
    mount.moving.pop(axis, None)
    if mount.added_rates or mount.moving or pulsed:
        yield from send_rates(mount, axis)
    if mount.added_rates or mount.moving:
        return
    if not pulsed:
        for number in (axis, 3 - axis):
            yield stop_command(number)
    yield from tracking.resume(mount)


def send_rates(mount: NexStar, first_axis: int) -> Steps:
    """Send the present sum of rates to each axis without fast hand motion, beginning with axis ``first_axis``."""
    for axis in (first_axis, 3 - first_axis):
        if axis not in mount.moving or axis in mount.added_rates:
            yield _rate_command(mount, axis, 0.0, at_once_or_never=False)


def _read_az_alt(mount: NexStar) -> Steps:
    """Read and return azimuth and altitude; store the tracking rates for that position in ``mount.tracking_rates``."""
    answer = yield axis_command(mount)
    az_alt = answer["az"], answer["alt"]
    assert mount.site is not None
    first, second = az_alt_rates_by_ha(*az_alt, mount.site.latitude)
    mount.tracking_rates = first * SIDEREAL, second * SIDEREAL
    return az_alt


def _motor_ratios(direction: Direction, az_alt: Pair, mount: NexStar) -> Pair:
    """Return how far both axes turn for a degree of hour angle, or of declination."""
    assert mount.site is not None
    return (az_alt_rates_by_ha if direction.axis == 1 else az_alt_rates_by_dec)(*az_alt, mount.site.latitude)


def _rates_for_axis(axis: int, rate: float) -> Pair:
    return (rate, 0.0) if axis == 1 else (0.0, rate)


def _add_rates(mount: NexStar, axis: int, added_rates: Pair, duration: float | None = None) -> Steps:
    """Add rates and send the sums. Return when the first motor was sent its rate (loop time), and how late, seconds.

    With ``duration``, both motors track faster for that many seconds, to make up for the tracking lost before.
    """
    before = mount.added_rates.get(axis)
    mount.added_rates[axis] = added_rates
    sent, late = list[float](), list[float]()
    try:
        for number in (axis, 3 - axis):
            if number not in mount.moving or number in mount.added_rates:
                planned = max(mount.now(), mount.next_send_at)
                lost = 0.0 if duration is None else planned - mount.suspended_at
                yield _rate_command(mount, number, lost / (duration or 1.0), at_once_or_never=True)
                sent.append(mount.sent_at)
                late.append(mount.sent_at - planned)
    except Busy:  # it was never sent
        if before is None:
            del mount.added_rates[axis]
            mount.moving.pop(axis, None)
            mount.pulsing.discard(axis)
        if not mount.added_rates and not mount.moving:
            yield from tracking.resume(mount)
        raise
    if len(sent) > 1:
        mount.motor_delay = min(MAX_MOTOR_DELAY, sent[1] - sent[0])
    return sent[0], late[0]


def _rate_command(mount: NexStar, axis: int, catch_up: float, at_once_or_never: bool) -> Send:
    """Return the command of an axis: added rates plus tracking, if that was on, faster by the fraction ``catch_up``."""
    tracks = mount.tracking_rates[axis - 1] if mount.suspended_mode is Tracking.ALTAZ else 0.0
    total = tracks * (1.0 + catch_up) + sum(added[axis - 1] for added in mount.added_rates.values())
    fastest = float(mount.rate_table["fastest"])
    code = tracking.rate_code(min(abs(total), fastest) * 3600.0)
    return Send(
        f"rate_{MOTORS[axis]}_{'pos' if total >= 0.0 else 'neg'}", {"rate": code}, at_once_or_never=at_once_or_never
    )
