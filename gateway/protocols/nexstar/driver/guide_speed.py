"""How fast guiding is: the guide rate on the motors that do not keep one for what they are told.

A key of the hand control is taken where it turns just so fast, for it adds to tracking; else a variable rate. That one
takes the place of tracking, so the motor in right ascension is told the sum of both, and at the end its drive rate
instead of rest. The other motor just turns and rests.
"""

from __future__ import annotations

from gateway.core.errors import Busy
from gateway.protocols.base.driver import Remark, Send, Steps
from gateway.protocols.nexstar.counting import SIDEREAL
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.state import AXES, NexStar, rest

#: A variable rate is a number of quarter arcseconds a second, or one of the three codes of a drive.
_STEPS = 4 * 3600
#: What is off by more than that part of what was asked is said.
SAID_FROM = 0.1


def begin(mount: NexStar, axis: int, sign: int, fraction: float) -> Steps:
    """Turn a motor at a fraction of the sidereal rate on top of equatorial tracking -> the fraction it turns at."""
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
    before, mount.drive = mount.drive, "replaced" if axis == 1 else mount.drive  # a stop must know of it before
    try:
        yield Send(f"rate_{AXES[axis]}_{side}", {"rate": abs(steps)}, prompt=True)
    except Busy:  # it was never sent
        mount.drive = before
        raise
    turns = abs(steps / _STEPS - drive)
    if abs(turns - asked) > SAID_FROM * asked:
        yield Remark(
            f"guiding at {asked * 3600:.2f} arcseconds a second goes as {turns * 3600:.2f}: "
            "these motors count quarters of an arcsecond"
        )
    return turns / SIDEREAL


def end(mount: NexStar, axis: int) -> Steps:
    """Rest; where tracking was replaced, the drive rate at once, so that no moment of it is lost."""
    if axis == 1 and mount.drive == "replaced":
        yield from tracking.keep_rate(mount)
        return
    yield rest(axis)


def lasts(ms: int, asked: float, turns: float) -> float:
    """Seconds that a pulse lasts at the speed that it really has, to lead as far as was asked."""
    return ms / 1000.0 * (asked / turns if turns > 0.0 else 1.0)


def motor_pulse(ms: int, fraction: float) -> tuple[int, int]:
    """Percent and hundredths of a second that come nearest to a pulse; whole hundredths are made up for in percent."""
    ticks = max(1, -(-ms // 10))
    return max(0, min(100, round(100.0 * fraction * ms / (10.0 * ticks)))), ticks
