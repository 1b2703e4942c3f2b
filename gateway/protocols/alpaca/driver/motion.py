"""Motion by hand, stopping, guiding, and tracking.

The positive sense of the first motor is west (east in the southern hemisphere). That of the second lifts the tube; on a
German mount it is reversed on the west side of the pier. ``MoveAxis`` is assumed to count the same way until a motion
shows the opposite. A stop sends rate 0 to both axes besides ``AbortSlew``, which in older servers ends
gotos only. Some servers stop tracking too, so the driver reads it after every motion. On some servers the rate of
``MoveAxis`` replaces tracking, on others it is added: so for slow motion the driver turns tracking off, and sends the
sum of both rates.
"""

from __future__ import annotations

from contextlib import suppress

from gateway.astro.spherical import az_alt_rates_by_ha
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Refused, Silence, Unsupported
from gateway.protocols.alpaca.driver.contradictions import expect_direction
from gateway.protocols.alpaca.driver.identify import read_status
from gateway.protocols.alpaca.driver.pointing import (
    MAX_WAIT,
    pier_side,
    resume_tracking,
    schedule_tracking_check,
    send_order,
    stop_current_motion,
)
from gateway.protocols.alpaca.driver.state import SIDEREAL_RATE, SLOW_MOTION_LIMIT, AlpacaDriver, read_member
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.driver import SLEWING_MESSAGE, Remark, Schedule, Send, Steps, Wait

#: How many times the driver checks whether an order has had an effect, and the seconds between two checks.
MAX_CHECKS, CHECK_PERIOD = 4, 0.5
#: A speed that differs from the requested one by more than this fraction is reported in the log.
REMARK_THRESHOLD = 0.1
#: The longest guide pulse of one request, milliseconds; a longer one is split, because no request ends a pulse.
MAX_PULSE_MS = 500
#: ASCOM's numbers of the directions, and of the tracking rates. ``RATE_FACTORS`` has the tracking rates in the order
#: of their numbers, as multiples of the sidereal rate.
NUMBER_BY_DIRECTION = {"n": 0, "s": 1, "e": 2, "w": 3}
NUMBER_BY_RATE = {"sidereal": 0, "lunar": 1, "solar": 2}
RATE_FACTORS = (1.0, 14.685 / 15.041067, 15.0 / 15.041067, 15.0369 / 15.041067)
#: Tracking rates whose multiples of the sidereal rate differ by less than this count as the same.
FACTOR_TOLERANCE = 0.0005


def tube_side(mount: AlpacaDriver, axis: int) -> Steps:
    """Return the tube's side of the pier if the direction of this axis depends on it, else an empty text.

    If the server does not report the side, it follows from the target of the last goto, unless that was stopped.
    """
    if not mount.german or axis != 2:
        return ""
    with suppress(Unsupported):
        return (yield from pier_side(mount, op.PierSide()))
    return mount.goto_side


def convert_sense(mount: AlpacaDriver, axis: int, sense: int, side: str) -> int:
    """Convert a sense on the sky (+1: west, north or up) to the sense of the motor, or back."""
    south = mount.equatorial and mount.southern and (axis == 1 or not mount.german)
    return -sense if south != (side == "W") else sense


def move(mount: AlpacaDriver, operation: op.Move) -> Steps:
    """Move in a direction on the sky. If the mount supports guide pulses, a move for a fixed time is sent as one."""
    if operation.ms is not None and mount.times_pulses:
        return (yield from pulse(mount, op.Pulse(operation.direction, operation.ms, sky=True)))
    side = yield from tube_side(mount, operation.axis)
    sense = convert_sense(mount, operation.axis, operation.sense, side)
    return (yield from _start_axis(mount, operation.axis, sense, side, operation.rate, True))


def move_axis(mount: AlpacaDriver, operation: op.MoveAxis) -> Steps:
    """Move an axis in its motor's sense. A rate by name or key is added to tracking; one in degrees replaces it."""
    side = yield from tube_side(mount, operation.axis)
    on_sky = operation.rate.key is not None or operation.rate.name is not None
    yield from _start_axis(mount, operation.axis, operation.sense, side, operation.rate, on_sky)


def _start_axis(mount: AlpacaDriver, axis: int, sense: int, side: str, rate: op.Rate, adds_to_tracking: bool) -> Steps:
    """Begin to move an axis in its motor's ``sense``, at its speed nearest to ``rate``. Raises Fault."""
    if not mount.ranges.get(axis):
        raise Unsupported(f"The server of this mount reports that axis {axis} cannot be moved by hand.")
    if mount.goto is not None:
        yield from stop_current_motion(mount)
    mount.following_speeds.pop(axis, None)
    if adds_to_tracking and mount.moves_by_pulses(rate):
        plus, minus = ("w", "e") if axis == 1 else ("n", "s")
        mount.pulse_directions[axis] = op.Direction(plus if convert_sense(mount, axis, sense, side) > 0 else minus)
        mount.hand_rates[axis], mount.parked, mount.moved_by_hand = 0.0, False, True
        return (yield from continue_pulses(mount, ContinuePulses(axis)))
    follows = mount.tracks and mount.supports("set_tracking") and (axis == 1 or not mount.equatorial)
    if follows and mount.requested_speed(rate) < SLOW_MOTION_LIMIT:
        return (yield from _start_slow_motion(mount, axis, sense * mount.requested_speed(rate), side, adds_to_tracking))
    mount.slow_speeds.pop(axis, None)
    speed, asked = mount.fit(axis, rate), rate.degrees if rate.name is None else None
    if asked is not None and abs(speed - asked) > REMARK_THRESHOLD * asked:
        text = f"a motion at {asked:.4g} degrees a second is done at {speed:.4g}: this mount has no nearer speed"
        yield Remark(text, "speed")
    known = "" if mount.hides_pier_side else side  # every arrow is compared on a side that is not told
    expected = convert_sense(mount, axis, sense, side)
    yield from _send_rate(mount, axis, sense * mount.moveaxis_sign(axis, known) * speed)
    expect_direction(mount, axis, expected, known)


def _start_slow_motion(mount: AlpacaDriver, axis: int, speed: float, side: str, adds_to_tracking: bool) -> Steps:
    """Turn tracking off and move an axis at a slow speed, degrees a second. With ``adds_to_tracking`` the speed of
    tracking is added, and the other axis of an alt-az mount follows the sky. Raises Refused if no rate is near the sum.
    """
    rates = (yield from _sky_following_speeds(mount, side)) if adds_to_tracking else {axis: 0.0}
    ideal_rates = {
        number: follows + (speed if number == axis else mount.slow_speeds.get(number, 0.0))
        for number, follows in rates.items()
    }
    possible = {number: mount.nearest_rate(number, rate) for number, rate in ideal_rates.items()}
    error = abs(possible[axis] - ideal_rates[axis])
    if adds_to_tracking and error > abs(speed) / 2.0:
        raise Refused("The server lists no speed near this one on top of tracking.")
    if error > REMARK_THRESHOLD * abs(speed):
        text = f"a motion at {abs(speed):.4g} degrees a second is {error:.4g} off: this mount has no nearer speed"
        yield Remark(text, "speed")
    if not mount.tracking_paused:
        yield from send_order(mount, "set_tracking", on=False)
        mount.tracking_paused = True
        yield from _resume_hand_motion(mount)
    mount.slow_speeds[axis] = speed
    for number, rate in possible.items():
        if number != axis and number not in mount.slow_speeds:
            if number in mount.hand_rates and number not in mount.following_speeds:
                continue  # it is moved faster
            mount.following_speeds[number] = rate
        yield from _send_rate(mount, number, mount.moveaxis_sign(number, "" if mount.hides_pier_side else side) * rate)
    return None


def _resume_hand_motion(mount: AlpacaDriver) -> Steps:
    """Repeat the rates of the axes that move: turning tracking on or off may have ended their motion."""
    for axis in sorted(mount.hand_rates.keys() - mount.pulse_directions.keys()):
        yield from _send_rate(mount, axis, mount.hand_rates[axis])


def _sky_following_speeds(mount: AlpacaDriver, side: str) -> Steps:
    """Return axis -> the speed at which it follows the sky, degrees a second in the motor's sense; on an equatorial
    mount only the first axis. Raises Unsupported if the server of an alt-az mount reports no position or latitude.
    """
    if mount.equatorial:
        return {1: convert_sense(mount, 1, 1, side) * SIDEREAL_RATE}
    place = []
    for member in ("azimuth", "altitude", "sitelatitude"):
        place.append((yield from read_member(mount, member)))
    if None in place:
        raise Unsupported("Slow arrows on top of alt-az tracking need azimuth, altitude and latitude from the server.")
    first, second = az_alt_rates_by_ha(*place)
    return {1: first * SIDEREAL_RATE, 2: second * SIDEREAL_RATE}


def _send_rate(mount: AlpacaDriver, axis: int, rate: float) -> Steps:
    """Send a MoveAxis rate, degrees a second. If it is refused, turn paused tracking on again. Raises Fault."""
    mount.hand_rates[axis], mount.parked, mount.moved_by_hand = rate, False, True
    try:
        yield Send("moveaxis", {"axis": axis - 1, "rate": rate}, timeout=MAX_WAIT, at_once_or_never=True)
    except (Silence, NoAnswer):
        raise NoAnswer from None  # it may move: the stop that follows must know
    except Fault as fault:
        mount.hand_rates.pop(axis, None)
        mount.slow_speeds.pop(axis, None)
        if not mount.slow_speeds:
            yield from resume_tracking(mount)
        mount.parked = isinstance(fault, Parked)
        if isinstance(fault, Refused) and not mount.parked:
            raise Refused(f'The mount refused this. Its server says: "{fault}"') from None
        raise


def stop_axis(mount: AlpacaDriver, operation: op.StopAxis) -> Steps:
    """End the hand motion of an axis. If both axes move slowly (tracking is off), move this one at the sky's rate."""
    axis = operation.axis
    if not mount.may_be_moving(axis):
        return
    mount.pulse_directions.pop(axis, None)
    if (
        mount.slow_speeds.pop(axis, None) is not None and mount.slow_speeds
    ):  # the other axis is still moved: this axis follows the sky
        rates = yield from _sky_following_speeds(mount, "")
        mount.following_speeds[axis] = mount.nearest_rate(axis, rates.get(axis, 0.0))
        yield from _send_rate(mount, axis, mount.moveaxis_sign(axis, "") * mount.following_speeds[axis])
        return
    was_moving = axis in mount.hand_rates
    for number in sorted({axis, *(() if mount.slow_speeds else mount.following_speeds)}):
        yield Send("moveaxis", {"axis": number - 1, "rate": 0.0})
        mount.following_speeds.pop(number, None)
        mount.hand_rates.pop(number, None)
    if mount.tracking_paused and not mount.slow_speeds:
        yield from resume_tracking(mount)
        yield from _resume_hand_motion(mount)
    elif was_moving and not mount.hand_rates:
        yield from schedule_tracking_check(mount)


def abort_motion(mount: AlpacaDriver, _: op.AbortMotion) -> Steps:
    """End every motion. Axes that are moved by hand stop first, because ``AbortSlew`` may take long. A parked mount
    counts as stopped. After a refusal the driver reads whether the mount slews. Raises NoAnswer; Refused if it moves.
    """
    slewed = mount.goto is not None
    mount.give_up_goto()
    orders = {axis: _stop_axis(axis) for axis in sorted(mount.hand_rates)} | {0: Send("abortslew", timeout=MAX_WAIT)}
    orders |= {axis: _stop_axis(axis) for axis in (1, 2) if mount.may_be_moving(axis)}
    failed: dict[int, Fault] = {}
    for axis, send in orders.items():
        try:
            yield send
            mount.hand_rates.pop(axis, None)
        except Parked:
            mount.hand_rates.pop(axis, None)
        except Fault as fault:
            if axis in mount.hand_rates or not isinstance(fault, Unsupported) or (slewed and axis == 0):
                failed[axis] = fault
    if any(isinstance(fault, NoAnswer | Silence) for fault in failed.values()):
        raise NoAnswer
    if failed and (failed.keys() & mount.hand_rates.keys() or (yield from read_member(mount, "slewing", True))):
        raise Refused(f'The stop was refused. The server says: "{next(iter(failed.values()))}"')
    yield from resume_tracking(mount)
    yield from schedule_tracking_check(mount)


def _stop_axis(axis: int) -> Send:
    return Send("moveaxis", {"axis": axis - 1, "rate": 0.0}, timeout=MAX_WAIT)


# --- guiding ----------------------------------------------------------------------------------------------------------


def pulse(mount: AlpacaDriver, operation: op.Pulse) -> Steps:
    """Send a guide pulse and return Pulsed. ASCOM's directions are those on the sky. A declination pulse in the motor's
    sense is therefore sent in the opposite direction while the tube of a German mount is west of the pier.
    """
    direction = operation.direction
    if direction.axis == 2 and not operation.sky and mount.german:
        sense = convert_sense(mount, 2, direction.sense, (yield from tube_side(mount, 2)))
        direction = op.Direction.NORTH if sense > 0 else op.Direction.SOUTH
    return (yield from _send_pulse(mount, direction, operation.ms))


def pulse_axis(mount: AlpacaDriver, operation: op.PulseAxis) -> Steps:
    """Send a guide pulse in a motor's sense. The server uses its guide rate, so another rate scales the duration."""
    sense = convert_sense(mount, operation.axis, operation.sense, (yield from tube_side(mount, operation.axis)))
    directions = {(1, 1): "w", (1, -1): "e", (2, 1): "n", (2, -1): "s"}
    default = mount.guide_rates[operation.axis - 1]
    ms = operation.ms * (default if operation.rate is None else operation.rate) / default
    return (yield from _send_pulse(mount, op.Direction(directions[operation.axis, sense]), round(ms)))


def _send_pulse(mount: AlpacaDriver, direction: op.Direction, ms: int) -> Steps:
    if mount.goto is not None:
        raise Refused(SLEWING_MESSAGE)
    if ms <= 0:
        return None
    piece = min(ms, MAX_PULSE_MS)
    with suppress(Silence):  # some servers answer when the pulse has ended
        values = {"direction": NUMBER_BY_DIRECTION[direction.value], "ms": piece}
        yield Send("pulseguide", values, timeout=max(MAX_WAIT, piece / 1000.0), at_once_or_never=True)
    return op.Pulsed(piece / 1000.0, ends=True, left=ms - piece, since=mount.sent_at)


class ContinuePulses(op.Operation, frozen=True):
    """Internal: send the next guide pulse of a motion by hand that consists of pulses."""

    axis: int


def continue_pulses(mount: AlpacaDriver, operation: ContinuePulses) -> Steps:
    """Send a guide pulse, and the next when it ends, until the motion by hand is stopped."""
    if (direction := mount.pulse_directions.get(operation.axis)) is not None:
        yield Schedule(MAX_PULSE_MS / 1000.0, operation)
        yield from _send_pulse(mount, direction, MAX_PULSE_MS)


def guide_rate(mount: AlpacaDriver, operation: op.GuideRate) -> Steps:
    """Return the guide rate as a fraction of sidereal."""
    yield from ()
    return mount.guide_rates[operation.axis - 1]


def set_guide_rate(mount: AlpacaDriver, operation: op.SetGuideRate) -> Steps:
    name = "set_guideraterightascension" if operation.axis == 1 else "set_guideratedeclination"
    yield from send_order(mount, name, rate=operation.rate * SIDEREAL_RATE)
    first, second = mount.guide_rates
    mount.guide_rates = (operation.rate, second) if operation.axis == 1 else (first, operation.rate)


# --- tracking ---------------------------------------------------------------------------------------------------------


def set_tracking(mount: AlpacaDriver, operation: op.SetTracking) -> Steps:
    """Turn tracking on or off. A parked mount is unparked before tracking is turned on. If the client waits for the
    outcome (``operation.heard``), raises Refused for an order that has no effect.
    """
    if mount.tracking_paused:  # for slow motion, after which it is turned on if that is wanted
        mount.tracks = operation.on
        return
    if operation.on and mount.parked:
        yield from send_order(mount, "unpark")
        mount.parked = False
    if (yield from read_member(mount, "tracking")) is not operation.on:  # what is so is not sent again
        yield from send_order(mount, "set_tracking", on=operation.on)
    mount.tracks, mount.tracking_stale_until = operation.on, mount.now()
    for _look in range(MAX_CHECKS if operation.heard else 0):
        yield from read_status(mount)
        if mount.tracks is operation.on:
            return
        yield Wait(CHECK_PERIOD)
    if operation.heard:
        state = "on" if operation.on else "off"
        raise Refused(f"The mount did not turn tracking {state}: it reports the same as before.")


def unpark(mount: AlpacaDriver, _: op.Unpark) -> Steps:
    """Unpark, and turn tracking on if the server can do that."""
    yield from send_order(mount, "unpark")
    mount.parked = False
    if mount.supports("set_tracking"):
        yield from send_order(mount, "set_tracking", on=True)
        mount.tracks = True


def emulate_sleep(mount: AlpacaDriver, _: op.Hibernate) -> Steps:
    """Turn tracking off instead of hibernating: Alpaca has no request for that."""
    yield from set_tracking(mount, op.SetTracking(on=False))


def emulate_wake(mount: AlpacaDriver, _: op.Wake) -> Steps:
    """Turn tracking on instead of waking the mount: Alpaca has no request for that."""
    yield from set_tracking(mount, op.SetTracking(on=True))


def track_rate(mount: AlpacaDriver, operation: op.TrackRate) -> Steps:
    """Set the tracking rate. Raises Unsupported for a rate that the mount does not have."""
    factor = operation.factor or 1.0
    near = (name for name, number in NUMBER_BY_RATE.items() if abs(RATE_FACTORS[number] - factor) < FACTOR_TOLERANCE)
    name = operation.name or next(near, "")
    possible = yield from read_member(mount, "trackingrates", [0])
    if name not in NUMBER_BY_RATE or (isinstance(possible, list) and NUMBER_BY_RATE[name] not in possible):
        raise Unsupported(f"This mount does not track at the {name or f'{factor:g} times sidereal'} rate.")
    yield from send_order(mount, "set_trackingrate", rate=NUMBER_BY_RATE[name])


def drive_rate(mount: AlpacaDriver, _: op.DriveRate) -> Steps:
    """Return the tracking rate as a multiple of sidereal; 1.0 if it is not reported."""
    number = yield from read_member(mount, "trackingrate", 0)
    return RATE_FACTORS[number] if number in range(len(RATE_FACTORS)) else 1.0
