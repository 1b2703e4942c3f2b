"""Hand motion, stopping, guiding: the only place where a sky direction becomes a motor direction.

Fast motion overrides tracking on the mount, so the driver suspends tracking first and resumes it after the last axis
has stopped. On hand controls before 1.6, which have no pass-through, hand motion is a chain of small gotos. Motors that
do not time guide pulses are guided with a hand-control key if it turns at exactly the guide rate, else with a variable
rate. A variable rate replaces tracking, so the right-ascension motor gets the sum of both.
"""

from __future__ import annotations

from gateway.astro.spherical import fold_declination, wrap180
from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, Unsupported
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps
from gateway.protocols.nexstar.counting import SIDEREAL
from gateway.protocols.nexstar.driver import altaz, tracking
from gateway.protocols.nexstar.driver.pointing import AfterGoto, pier_side, require_alignment, stop_current_motion
from gateway.protocols.nexstar.driver.state import GENTLE_KEYS, MOTORS, NexStar, SmallGotoMotion, stop_command

FOCUSER = 18
MAX_PULSE_MS = 2550  # milliseconds
#: Seconds between small gotos; how much further ahead their goal may be, in seconds of motion plus degrees.
STEP_INTERVAL, LEAD_SECONDS, LEAD_DEGREES = 0.6, 0.5, 0.75
_KEY_BY_FOCUS_SPEED = {1: 2, 2: 4, 3: 6, 4: 9}
_RATE_STEPS_PER_DEGREE = 4 * 3600  # of a variable rate: it is counted in quarter arcseconds a second
REMARK_THRESHOLD = 0.1  # a deviation from the requested speed by more than this fraction is logged


def motor_sense(mount: NexStar, direction: op.Direction) -> int:
    """Return +1 or -1, the motor direction for a sky direction. Positive on axis 1 is west, but east in EQ south.

    Positive on axis 2 moves the tube of a fork towards the pole to which its base is tilted: south in EQ south. The
    reversal of a German mount's axis 2 by the pier side is not included: see ``_is_reversed``.
    """
    southern = tracking.native_mode(mount) is op.Tracking.EQ_SOUTH
    if southern and (direction.axis == 1 or not mount.german):
        return -direction.sense
    return direction.sense


def _is_reversed(mount: NexStar, direction: op.Direction) -> Steps:
    """Return whether to turn against ``motor_sense``: in declination, on the W side or beyond the pole, not both."""
    if direction.axis == 1:
        return False
    if not mount.german:
        return mount.reports_beyond_pole
    try:
        reported = yield from pier_side(mount, op.PierSide())
    except Fault:
        return mount.reports_beyond_pole
    west = mount.tube_side(reported) == "W"
    # without p both follow from the same axis reading
    return west != (mount.reports_beyond_pole and mount.supports("p"))


def move(mount: NexStar, operation: op.Move) -> Steps:
    """Move in a direction on the sky, on either pier side. In alt-az turn one axis; slow motions add to tracking."""
    pulse_instead = operation.ms is not None and mount.times_pulses
    if not pulse_instead and altaz.moves_on_tracking(mount, operation) and (yield from altaz.move(mount, operation)):
        return None
    by_sky = mount.moves_by_gotos  # the small gotos lead over the sky
    sign = operation.direction.sense if by_sky else motor_sense(mount, operation.direction)
    if mount.goto is not None:
        yield from stop_current_motion(mount)  # during a goto ``p`` already returns the side of its goal
    if not mount.moves_by_gotos and (yield from _is_reversed(mount, operation.direction)):
        sign = -sign
    if pulse_instead:
        return (yield from pulse_axis(mount, op.PulseAxis(operation.axis, sign, operation.ms or 0)))
    yield from move_axis(mount, op.MoveAxis(operation.axis, sign, operation.rate))


def move_axis(mount: NexStar, operation: op.MoveAxis) -> Steps:
    """Move an axis by ``P``, before 1.6 by small gotos. Suspend tracking first, unless it is equatorial and the rate is
    that of key 1 or 2, or the guide rate. Raises Busy, with the old state restored, if the command was not sent.
    """
    axis, rate = operation.axis, operation.rate
    if mount.goto is not None:
        yield from stop_current_motion(mount)
    asked, done = (rate.degrees or 0.0) if rate.key is None else 0.0, mount.speed(rate)
    if abs(done - asked) > REMARK_THRESHOLD * asked > 0.0:
        text = f"a motion at {asked:.3g} degrees a second is done at {done:.3g}: this mount has no nearer speed"
        yield Remark(text, "speed")
    if mount.moves_by_gotos:
        yield from require_alignment(mount)
        mount.small_goto_motions[axis] = SmallGotoMotion(operation.sense * mount.speed(rate), mount.now())
        return (yield from send_small_goto(mount, NextSmallGoto()))
    tracks = mount.suspended_mode is None and (mount.tracking or op.Tracking.OFF).equatorial
    if rate.name == "guide" and tracks:  # guiding is relative to tracking
        yield from _move_at_guide_rate(mount, axis, operation.sense)
        return
    side = "pos" if operation.sense > 0 else "neg"
    variable = mount.variable_rate(rate)
    gentle = variable is None and mount.key_for(rate) in GENTLE_KEYS
    mount.parked = False
    if not (gentle and tracks):
        yield from tracking.suspend(mount)
    before = dict(mount.moving)
    mount.added_rates.pop(axis, None)
    mount.moving[axis] = max(mount.speed(rate), mount.moving.get(axis, 0.0))  # until it has the new rate
    try:
        if variable is not None:
            yield Send(
                f"rate_{MOTORS[axis]}_{side}", {"rate": tracking.rate_code(variable * 3600.0)}, at_once_or_never=True
            )
        else:
            yield Send(f"slew_{MOTORS[axis]}_{side}", {"rate": mount.key_for(rate)}, at_once_or_never=True)
    except Busy:  # it was never sent
        mount.moving = before
        if not before and mount.suspended_mode is not None:
            yield from tracking.resume(mount)
        raise
    mount.moving[axis] = mount.speed(rate)


def _move_at_guide_rate(mount: NexStar, axis: int, sign: int) -> Steps:
    """Move at the guide rate, on top of equatorial tracking."""
    mount.parked = False
    before = dict(mount.moving)
    mount.moving[axis] = max(mount.guide_rates[axis] * SIDEREAL, mount.moving.get(axis, 0.0))
    try:
        yield from begin_guiding(mount, axis, sign, mount.guide_rates[axis])
    except Busy:  # it was never sent
        mount.moving = before
        raise
    mount.moving[axis] = mount.guide_rates[axis] * SIDEREAL


def stop_axis(mount: NexStar, operation: op.StopAxis) -> Steps:
    """End hand motion of an axis by rate 0; resume tracking, once, when no axis moves any more."""
    stepped = mount.small_goto_motions.pop(operation.axis, None)
    if mount.moves_by_gotos:
        if stepped is not None:
            yield Send("M")  # the last small goto may lead far in azimuth; the other axis continues with its next goto
        return
    if operation.axis in mount.added_rates:
        yield from altaz.stop_axis(mount, operation.axis)
        return
    replaced = mount.drive == "replaced" and operation.axis == 1
    yield from end_guiding(mount, operation.axis)
    mount.moving.pop(operation.axis, None)
    mount.pulsing.discard(operation.axis)
    yield from _end_timed_pulses(mount, [operation.axis])
    if mount.added_rates:
        yield from altaz.send_rates(mount, operation.axis)
    elif mount.moving:
        return
    elif mount.suspended_mode is not None:
        yield from tracking.resume(mount)
    elif not replaced and (operation.axis == 1 or mount.rate.name != "sidereal"):
        yield from tracking.resend_rate(mount)


def abort_motion(mount: NexStar, _: op.AbortMotion) -> Steps:
    """End hand motion by rate 0 to both axes, the faster axis first, and a goto by ``M``; tracking stays as it was."""
    mount.small_goto_motions.clear()
    mount.pulsing.clear()
    mount.added_rates.clear()
    going = mount.goto
    if going is not None:
        mount.home_state = 0 if going.purpose == "home" else mount.home_state
        yield Send("M")
        mount.goto = None
    if not mount.moves_by_gotos:
        for axis in sorted(MOTORS, key=lambda axis: -mount.moving.get(axis, 0.0)):
            yield stop_command(axis)
    mount.moving.clear()
    if going is None:
        yield Send("M")
    yield from _end_timed_pulses(mount, [1, 2])
    yield from (
        tracking.resume(mount) if mount.suspended_mode is not None or going is not None else tracking.resend_rate(mount)
    )
    if going is not None and mount.rate.name != "sidereal":
        yield Schedule(0.0, AfterGoto(then=""))  # the hand control now tracks at the sidereal rate


def _end_timed_pulses(mount: NexStar, axes: list[int]) -> Steps:
    """End pulses that the motors time themselves: a pulse of rate 0 replaces a running pulse."""
    for axis in axes:
        if mount.pulse_ends.pop(axis, 0.0) > mount.now():
            yield Send("pulse", {"device": 15 + axis, "rate": 0, "ticks": 1})


# --- hand controls before 1.6 -----------------------------------------------------------------------------------


class NextSmallGoto(op.Operation, frozen=True):
    """Internal: the next small goto of a motion on a hand control without pass-through."""


def send_small_goto(mount: NexStar, _: NextSmallGoto) -> Steps:
    """Read the position (``E``), send a goto a little ahead of it (``R``), and repeat until the motion is stopped."""
    if not mount.small_goto_motions:
        return
    answer = yield Send("E")
    ra, dec = answer["ra"], fold_declination(0.0, answer["dec"])[1]
    west, north = _small_goto_degrees(mount, 1, -ra), _small_goto_degrees(mount, 2, dec)
    yield Send("R", {"ra": ra - west, "dec": max(-90.0, min(90.0, dec + north))})
    yield Schedule(STEP_INTERVAL, NextSmallGoto())


def _small_goto_degrees(mount: NexStar, axis: int, position: float) -> float:
    """Return how far the next small goto leads from ``position``, degrees, so that the axis keeps its mean speed.

    Each goal is counted from the start of the motion, so slow gotos and rounding to 20 arcseconds do not add up.
    The distance is limited, for mounts that cannot keep up.
    """
    step = mount.small_goto_motions.get(axis)
    if step is None:
        return 0.0
    if step.start_position is None:
        step.start_position = position
    due = step.speed * (mount.now() - step.started_at + STEP_INTERVAL) - wrap180(position - step.start_position)
    most = abs(step.speed) * (STEP_INTERVAL + LEAD_SECONDS) + LEAD_DEGREES
    return max(-most, min(most, due))


# --- guiding ----------------------------------------------------------------------------------------------------


def pulse(mount: NexStar, operation: op.Pulse) -> Steps:
    """Send a guide pulse; return Pulsed, None if 0 ms. With ``sky`` north is that on the sky, else one motor sense."""
    by_sky = operation.sky
    if operation.ms > 0 and altaz.can_add_rates(mount) and (by_sky or not mount.times_pulses):
        return (yield from altaz.pulse(mount, operation))
    if tracking.native_mode(mount) is None and not (mount.moves_by_gotos or mount.times_pulses):
        raise Unsupported("Guiding needs the tracking mode, which this hand control does not report: give --mode.")
    axis, sign = operation.direction.axis, motor_sense(mount, operation.direction)
    if by_sky and not mount.moves_by_gotos and (yield from _is_reversed(mount, operation.direction)):
        sign = -sign
    return (yield from pulse_axis(mount, op.PulseAxis(axis, sign, operation.ms)))


def pulse_axis(mount: NexStar, operation: op.PulseAxis) -> Steps:
    """Send a guide pulse to one motor and return Pulsed: by AUX 0x26 if both motors have it, at most 2.55 s at a time;
    else on equatorial tracking by a rate that the caller has to end. Return None if time or rate is 0. Raises Fault.
    """
    axis, sign = operation.axis, operation.sense
    fraction = mount.guide_rates[axis] if operation.rate is None else operation.rate
    if operation.ms <= 0 or fraction <= 0.0:
        return None
    if (fault := mount.guiding_refusal()) is not None:
        raise fault
    if mount.times_pulses:
        piece = min(operation.ms, MAX_PULSE_MS)
        percent, ticks = pulse_arguments(piece, fraction)
        mount.pulse_ends[axis] = mount.now() + piece / 1000.0
        yield Send("pulse", {"device": 15 + axis, "rate": sign * percent, "ticks": ticks}, at_once_or_never=True)
        return op.Pulsed(piece / 1000.0, ends=True, left=operation.ms - piece)
    mount.pulsing.add(axis)
    turns = yield from begin_guiding(mount, axis, sign, fraction)
    longer = fraction / turns if turns > 0.0 else 1.0  # at its actual speed it moves as far as was requested
    return op.Pulsed(operation.ms / 1000.0 * longer, ends=False, since=mount.sent_at)


# --- mechanics --------------------------------------------------------------------------------------------------


def set_backlash(mount: NexStar, operation: op.Backlash) -> Steps:
    """Set the backlash compensation by AUX 0x10 and 0x11."""
    for side in {1: ("pos",), -1: ("neg",)}.get(operation.sense, ("pos", "neg")):
        yield Send(f"set_backlash_{side}", {"device": 15 + operation.axis, "value": operation.value})


def switch_pec(mount: NexStar, operation: op.PeriodicError) -> Steps:
    """Turn PEC on (also for None) or off by AUX 0x0D on the right-ascension motor, the only one with it."""
    if not mount.has_part("pec"):
        raise Unsupported("This mount has no periodic error correction.")
    if operation.axis == 2:
        raise Unsupported("Only the right-ascension motor has a periodic error correction.")
    yield Send("pec_playback", {"device": 16, "on": int(operation.on is not False)})


def focus(mount: NexStar, operation: op.Focus) -> Steps:
    """Move a focuser on the mount's bus like an axis (AUX 0x24, 0x25); its positions increase outwards."""
    if not mount.has_focuser:
        raise Unsupported("No focuser answers on this mount.")
    rate = _KEY_BY_FOCUS_SPEED[operation.speed] if operation.direction else 0
    yield Send("move_neg" if operation.direction > 0 else "move_pos", {"device": FOCUSER, "rate": rate})


# --- guiding with motor commands -------------------------------------------------------------------------------------


def begin_guiding(mount: NexStar, axis: int, sign: int, fraction: float) -> Steps:
    """Turn a motor at a fraction of the sidereal rate on top of equatorial tracking; return the actual fraction."""
    asked = fraction * SIDEREAL
    key = mount.exact_key(asked)
    side = "pos" if sign > 0 else "neg"
    if key is not None:
        if axis == 1 and mount.drive == "replaced":
            yield from tracking.resend_rate(mount)
        yield Send(f"slew_{MOTORS[axis]}_{side}", {"rate": key}, at_once_or_never=True)
        return mount.key_speed(key) / SIDEREAL
    drive = tracking.drive_speed(mount) if axis == 1 else 0.0
    steps = round((drive + sign * asked) * _RATE_STEPS_PER_DEGREE)
    side = "pos" if steps >= 0 else "neg"
    before, mount.drive = mount.drive, "replaced" if axis == 1 else mount.drive  # set first, for a stop meanwhile
    try:
        yield Send(f"rate_{MOTORS[axis]}_{side}", {"rate": abs(steps)}, at_once_or_never=True)
    except Busy:  # it was never sent
        mount.drive = before
        raise
    turns = abs(steps / _RATE_STEPS_PER_DEGREE - drive)
    if abs(turns - asked) > REMARK_THRESHOLD * asked:
        yield Remark(
            f"guiding at {turns * 3600:.2f} instead of {asked * 3600:.2f} arcseconds a second: "
            "these motors count quarters of an arcsecond"
        )
    return turns / SIDEREAL


def end_guiding(mount: NexStar, axis: int) -> Steps:
    """Stop the motor. If the rate had replaced tracking, send the drive rate instead, so that no tracking is lost."""
    if axis == 1 and mount.drive == "replaced":
        yield from tracking.resend_rate(mount)
        return
    yield stop_command(axis)


def pulse_arguments(ms: int, fraction: float) -> tuple[int, int]:
    """Return percentage and hundredths of a second of a pulse; the percentage makes up for the rounding of the time."""
    ticks = max(1, -(-ms // 10))
    return max(0, min(100, round(100.0 * fraction * ms / (10.0 * ticks)))), ticks
