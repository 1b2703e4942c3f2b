"""Motion by hand, its rates, and guiding.

Motor directions: positive is west on the first axis (on an equatorial mount in the southern hemisphere: east) and up on
the second axis of a fork, on a wedge towards the elevated pole. On a German mount the second axis is reversed on one
side of the pier, as on a Celestron. A variable rate of the right ascension motor replaces tracking; a motion in a sky
direction is added to tracking.
"""

from __future__ import annotations

import math

from gateway.astro.spherical import az_alt_rates_by_dec, az_alt_rates_by_ha
from gateway.core import operations as op
from gateway.core.errors import Refused, Unsupported
from gateway.protocols.base.driver import BY_HAND_MESSAGE, SLEWING_MESSAGE, Remark, Steps
from gateway.protocols.lx200.driver.dialect import schedule_arrow_check
from gateway.protocols.lx200.driver.drive import note_drive_rate, restore_drive_rate, set_drive_hertz
from gateway.protocols.lx200.driver.ends import (
    MOUNT_AXES,
    count_motion,
    end_motion,
    restore_rates_later,
    send_guide_rate,
    set_max_speed,
)
from gateway.protocols.lx200.driver.pointing import horizontal_position, is_beyond_pole
from gateway.protocols.lx200.driver.speeds import DRIVE_RATES, SPEEDS, Speed, nearest, nearest_total_speed, ratio_error
from gateway.protocols.lx200.driver.state import Lx200Driver, ask, rate_command
from gateway.protocols.lx200.reply_rules import PAUSE_AFTER_COMMAND

MAX_PULSE_MS = 9999  # milliseconds: the four digits of :Mg
RATE_TOLERANCE = 0.01  # guide rates that differ by less, in fractions of sidereal, count as equal
_REMARK_THRESHOLD = math.log(1.1)  # of the ratio of actual and requested speed: a greater deviation is logged


def _direction_letter(mount: Lx200Driver, axis: int, sense: int) -> Steps:
    """Return the letter (n, s, e, w) of the sky direction in which a motor moves with this sense, +1 or -1."""
    if axis == 2 and mount.equatorial and not mount.german and mount.southern:  # lifting is towards the southern pole
        sense = -sense
    elif axis == 2 and mount.german:  # the motor's sense is reversed on one side of the pier
        sense = -sense if (yield from is_beyond_pole(mount)) is not mount.southern else sense
    if axis == 2:
        return "n" if sense > 0 else "s"
    if mount.equatorial and mount.southern:
        sense = -sense
    return "w" if sense > 0 else "e"


def move(mount: Lx200Driver, operation: op.Move) -> Steps:
    """Move in a sky direction by :Mn :Ms :Me :Mw. A tap becomes a guide pulse if the telescope times pulses (:Mg)."""
    if operation.ms is not None and mount.times_pulses:
        rate = None if mount.supports("Rg") else 1.0
        return (yield from _send_pulse(mount, operation.axis, operation.direction.value, operation.ms, rate))
    speed = yield from _choose_speed(mount, operation.rate)
    yield from _begin_motion(mount, operation.axis, operation.direction.value, operation.rate, speed)


def move_axis(mount: Lx200Driver, operation: op.MoveAxis) -> Steps:
    """Move in a motor direction. A variable rate in right ascension is the total speed, tracking included."""
    axis, rate = operation.axis, operation.rate
    letter = yield from _direction_letter(mount, axis, operation.sense)
    tracks = mount.equatorial and not mount.in_land_mode and mount.tracking is not op.Tracking.OFF
    if axis != 1 or rate.degrees is None or rate.key is not None or rate.name is not None or not tracks:
        speed = yield from _choose_speed(mount, rate)
        yield from _begin_motion(mount, axis, letter, rate, speed)
        return
    west = rate.degrees if letter == "w" else -rate.degrees
    speed = nearest_total_speed(mount.model_speeds, west, _tracking_speed(mount))
    yield from _log_speed_deviation(west, speed.deg_per_s)
    if speed.hertz is not None:
        yield from note_drive_rate(mount)
        mount.drive_rate_changed = True
        yield from set_drive_hertz(mount, speed.hertz)
    else:
        yield from restore_drive_rate(mount)
    if speed.west is not None:
        letter = "w" if speed.west else "e"
    yield from _begin_motion(mount, axis, letter, rate, speed)


def _tracking_speed(mount: Lx200Driver) -> float:
    """Return the current tracking speed, degrees per second."""
    rate = mount.drive_rate
    factor = 1.0 if rate is None else rate.factor if rate.factor is not None else DRIVE_RATES[rate.name or "sidereal"]
    return factor * SPEEDS["RG"]


def _choose_speed(mount: Lx200Driver, rate: op.Rate) -> Steps:
    """Return the speed nearest to a variable rate; None for a named rate or a hand-control key."""
    if rate.name is not None or rate.degrees is None:
        return None
    speed = nearest(mount.model_speeds, rate.degrees)
    yield from _log_speed_deviation(rate.degrees, speed.deg_per_s)
    return speed


def _log_speed_deviation(requested_speed: float, actual_speed: float) -> Steps:
    if ratio_error(requested_speed, actual_speed) > _REMARK_THRESHOLD:
        yield Remark(
            f"a motion at {abs(requested_speed) * 3600:.5g} arcseconds per second is done at "
            f"{actual_speed * math.copysign(3600, requested_speed):.5g}: this mount has no nearer speed",
            "speed",
        )


def _begin_motion(mount: Lx200Driver, axis: int, letter: str, rate: op.Rate, speed: Speed | None) -> Steps:
    """Begin a motion by hand at ``speed``; None: at ``rate``. For a speed that the drive itself has, press no key."""
    mount.check_movable()
    old = mount.moving.get(axis)
    by_drive = speed is not None and speed.command is None
    if old and (old != letter or by_drive):
        yield from ask(mount, f"Q{old}")
    if by_drive:
        mount.moving[axis], mount.parked = "", False
        return
    yield from (_send_named_rate(mount, axis, rate) if speed is None else _send_chosen_rate(mount, axis, speed))
    count_motion(mount, axis)
    yield from ask(mount, f"M{letter}")
    mount.moving[axis], mount.parked = letter, False
    yield from schedule_arrow_check(mount, axis)


def _send_named_rate(mount: Lx200Driver, axis: int, rate: op.Rate) -> Steps:
    """Send the command of a named rate or hand-control key, and first the :Sw or :Rg that it needs."""
    command = rate_command(mount, rate)
    mount.rate_sent = command
    if command == "RS" and not mount.dialect:
        yield from _send_max_speed(mount, axis, rate.degrees if rate.name == "max" else None)
    elif command == "RG" and not mount.dialect:
        yield from send_guide_rate(mount, mount.guide_rate)
    yield from ask(mount, command)


def _send_chosen_rate(mount: Lx200Driver, axis: int, speed: Speed) -> Steps:
    """Set the rate of a chosen speed, and the values that it needs (``:Rg :Sw :RA :RE``)."""
    if speed.guide is not None:
        yield from send_guide_rate(mount, speed.guide)
    if speed.command == "RS" and speed.axis_rate is None and not mount.dialect:
        yield from _send_max_speed(mount, axis, speed.max_speed)
    assert speed.command is not None
    mount.rate_sent = speed.command
    yield from ask(mount, speed.command)
    if speed.axis_rate is not None:
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=speed.axis_rate)
        mount.axes_with_rate.add(axis)


def _send_max_speed(mount: Lx200Driver, axis: int, speed: float | None) -> Steps:
    """Set the speed of :RS, degrees per second (None: as at power-on), also in place of this axis's :RA or :RE rate."""
    yield from set_max_speed(mount, speed)
    if axis in mount.axes_with_rate:
        fastest = float(mount.max_speed_sent or mount.facts["max_rate"])
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=fastest)
        mount.axes_with_rate.discard(axis)


def set_guide_rate(mount: Lx200Driver, operation: op.SetGuideRate) -> Steps:
    """Set the guide rate, a fraction of sidereal (1 at most); send :Rg if the model has it and the rate differs."""
    mount.guide_rate, mount.guide_rate_requested = min(1.0, operation.rate), True
    yield from send_guide_rate(mount, mount.guide_rate)


def stop_axis(mount: Lx200Driver, operation: op.StopAxis) -> Steps:
    """End the motion of an axis by :Qn :Qs :Qe or :Qw; if its direction is unknown, by both commands of the axis."""
    pulse_letter, move_letter = mount.pulsing.pop(operation.axis, None), mount.moving.pop(operation.axis, None)
    known_letter = move_letter or pulse_letter
    if move_letter != "" or pulse_letter:
        letters = [known_letter] if known_letter else (["e", "w"] if operation.axis == 1 else ["n", "s"])
        for letter in letters:
            yield from end_motion(mount, f"Q{letter}", (operation.axis,), known_letter is not None)
    if operation.axis == 1:
        yield from restore_drive_rate(mount)
    yield from restore_rates_later(mount)


def abort_motion(mount: Lx200Driver, _: op.AbortMotion) -> Steps:
    """:Q - stop all motion, and restore the rates that a motion has changed."""
    was_moving = mount.goto is not None or mount.seeking or bool(mount.moving or mount.pulsing)
    mount.goto = None
    mount.moving.clear()
    mount.pulsing.clear()
    mount.pulse_shares.clear()
    yield from end_motion(mount, "Q", MOUNT_AXES, was_moving)
    mount.seeking = False
    yield from restore_drive_rate(mount)
    yield from restore_rates_later(mount)


# --- guiding ----------------------------------------------------------------------------------------------------


def pulse(mount: Lx200Driver, operation: op.Pulse) -> Steps:
    """Send a guide pulse by :Mg, at most 9999 ms; without :Mg begin a motion that the caller ends. Return Pulsed;
    None if nothing was sent because the pulse rounds to 0 ms. Raises Refused during a goto.
    """
    if operation.sky and not mount.equatorial and operation.ms > 0:
        return (yield from _pulse_both_axes(mount, operation.direction, operation.ms))
    return (yield from _send_pulse(mount, operation.direction.axis, operation.direction.value, operation.ms, None))


def _pulse_both_axes(mount: Lx200Driver, direction: op.Direction, ms: int) -> Steps:
    """Guide in RA or declination with both motors of an alt-az mount, each as long as its part of the motion takes."""
    horizon = (yield from horizontal_position(mount, op.HorizontalPosition())) if mount.site is not None else None
    if horizon is None or mount.site is None or not mount.times_pulses:
        raise Unsupported(
            "Guiding in right ascension and declination needs the latitude and, of an alt-az Meade, :GZ#, :GA# and :Mg."
        )
    ratios = az_alt_rates_by_ha if direction.axis == 1 else az_alt_rates_by_dec
    shares = ratios(horizon.az, horizon.alt, mount.site.latitude)
    piece, now = min(ms, int(MAX_PULSE_MS / max(1.0, *map(abs, shares)))), mount.now()
    for axis, share in enumerate(shares, 1):
        last = mount.pulse_shares.get(axis, (0.0, now))  # the new :Mg replaces it, so its remaining time is added
        total = direction.sense * share * piece + math.copysign(max(0.0, last[1] - now) * 1000.0, last[0])
        letter = {(1, True): "w", (1, False): "e", (2, True): "n", (2, False): "s"}[axis, total >= 0.0]
        if (
            pulsed := (yield from _send_pulse(mount, axis, letter, round(min(MAX_PULSE_MS, abs(total))), None))
        ) is not None:
            mount.pulse_shares[axis] = total, mount.now() + pulsed.seconds
    ends = max((ends for _, ends in mount.pulse_shares.values()), default=now)
    return op.Pulsed(max(0.0, ends - mount.now()), ends=True, left=ms - piece)


def pulse_axis(mount: Lx200Driver, operation: op.PulseAxis) -> Steps:
    """Like ``pulse``, in a motor direction and at a rate that is a fraction of sidereal (None: the guide rate)."""
    letter = yield from _direction_letter(mount, operation.axis, operation.sense)
    return (yield from _send_pulse(mount, operation.axis, letter, operation.ms, operation.rate))


def _select_pulse_rate(mount: Lx200Driver, fraction: float) -> Steps:
    """Select and return the slowest pulse rate not below ``fraction``, else the fastest; as fractions of sidereal."""
    if not (pulses := mount.dialect.get("pulses")):
        return 1.0
    speeds = {name: mount.speeds.get(name, SPEEDS["RG"]) / SPEEDS["RG"] for name in pulses["rates"]}
    command = next((name for name, speed in speeds.items() if speed > fraction - RATE_TOLERANCE), pulses["rates"][-1])
    if pulses["send"]:
        if mount.moving:  # motion and pulse would both get the rate that is sent last
            raise Refused(BY_HAND_MESSAGE)
        mount.rate_sent = command
        yield from ask(mount, command)
    return speeds[command]


def _send_pulse(mount: Lx200Driver, axis: int, letter: str, ms: int, rate: float | None) -> Steps:
    """Send a guide pulse, shorter or longer in proportion if the guide rate is fixed. Raises Refused during a goto."""
    mount.check_movable()
    if mount.goto is not None:
        raise Refused(SLEWING_MESSAGE)
    fraction = mount.guide_rate if rate is None else rate
    shorter = 1.0 if mount.supports("Rg") else fraction / (yield from _select_pulse_rate(mount, fraction))
    yield from send_guide_rate(mount, fraction)
    ms = round(ms * shorter)
    if ms <= 0:
        return None
    if mount.times_pulses:
        piece = min(ms, MAX_PULSE_MS)
        count_motion(mount, axis)
        yield from ask(mount, "Mg", direction=letter, ms=piece)
        mount.pulses_end_at = max(mount.pulses_end_at, mount.now() + piece / 1000.0)
        yield from restore_rates_later(mount)
        return op.Pulsed(piece / 1000.0, ends=True, left=round((ms - piece) / shorter))
    yield from ask(mount, "RG")
    count_motion(mount, axis)
    mount.pulsing[axis] = letter  # before the command, so that a stop meanwhile ends the pulse
    yield from ask(mount, f"M{letter}")
    return op.Pulsed(max(0.0, ms / 1000.0 - PAUSE_AFTER_COMMAND), ends=False)  # the line has paused since the command
