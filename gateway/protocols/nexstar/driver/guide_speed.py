"""Guiding at the guide rate with motor commands, for motors that do not time guide pulses themselves.

A hand-control key is used if it turns at exactly that speed, because it adds to tracking; otherwise a variable rate.
A variable rate replaces tracking, so the right-ascension motor gets the sum of both, and at the end its drive rate
instead of rate 0. The declination motor just turns and stops.
"""

from __future__ import annotations

from gateway.core.errors import Busy
from gateway.protocols.base.driver import Remark, Send, Steps
from gateway.protocols.nexstar.counting import SIDEREAL
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.state import AXES, NexStar, rate_zero

#: Steps of a variable rate per degree a second: it is counted in quarter arcseconds a second.
_STEPS = 4 * 3600
#: A deviation from the requested speed by more than this fraction is remarked in the log.
REMARK_FROM = 0.1


def begin(mount: NexStar, axis: int, sign: int, fraction: float) -> Steps:
    """Turn a motor at a fraction of the sidereal rate on top of equatorial tracking; return the actual fraction."""
    asked = fraction * SIDEREAL
    key = mount.exact_key(asked)
    side = "pos" if sign > 0 else "neg"
    if key is not None:
        if axis == 1 and mount.drive == "replaced":
            yield from tracking.keep_rate(mount)
        yield Send(f"slew_{AXES[axis]}_{side}", {"rate": key}, prompt=True)
        return mount.key_speed(key) / SIDEREAL
    drive = tracking.drive_speed(mount) if axis == 1 else 0.0
    steps = round((drive + sign * asked) * _STEPS)
    side = "pos" if steps >= 0 else "neg"
    before, mount.drive = mount.drive, "replaced" if axis == 1 else mount.drive  # a stop must know before
    try:
        yield Send(f"rate_{AXES[axis]}_{side}", {"rate": abs(steps)}, prompt=True)
    except Busy:  # it was never sent
        mount.drive = before
        raise
    turns = abs(steps / _STEPS - drive)
    if abs(turns - asked) > REMARK_FROM * asked:
        yield Remark(
            f"guiding at {turns * 3600:.2f} instead of {asked * 3600:.2f} arcseconds a second: "
            "these motors count quarters of an arcsecond"
        )
    return turns / SIDEREAL


def end(mount: NexStar, axis: int) -> Steps:
    """Stop the motor. If the rate had replaced tracking, send the drive rate instead, so that no tracking is lost."""
    if axis == 1 and mount.drive == "replaced":
        yield from tracking.keep_rate(mount)
        return
    yield rate_zero(axis)


def pulse_seconds(ms: int, asked: float, turns: float) -> float:
    """Return the seconds a pulse must last at its actual speed to move as far as was requested."""
    return ms / 1000.0 * (asked / turns if turns > 0.0 else 1.0)


def motor_pulse(ms: int, fraction: float) -> tuple[int, int]:
    """Return percentage and hundredths of a second of a pulse; the percentage makes up for the rounding of the time."""
    ticks = max(1, -(-ms // 10))
    return max(0, min(100, round(100.0 * fraction * ms / (10.0 * ticks)))), ticks
