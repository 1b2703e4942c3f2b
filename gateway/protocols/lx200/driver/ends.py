"""How a motion ends on a Meade: the end command is sent twice, and changed rates are restored a moment later.

A Meade acknowledges no end command, so the first may be lost. The gateway repeats it when the line is free, unless a
newer motion has begun on the same axes or the mount was at rest. A telescope that is computing accepts only :Q#, so any
other repetition waits. Rates that a motion has changed would affect the hand control. No Meade reports its fastest
rate, the rates of its axes or its guide rate. So the gateway restores the values at power-on, or those that a program
has set since then. An OnStep reports the rate of its arrows: the gateway restores the reported rate.
"""

from __future__ import annotations

import contextlib

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core.errors import Busy
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Remark, Schedule, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds until an end command is repeated.
REPEAT_DELAY = 0.3
#: Both axes of the mount; the focuser has a number of its own.
MOUNT_AXES, FOCUSER_AXIS = (1, 2), 3
#: Seconds after a motion until rates are restored: a program that moves again at once finds its rate unchanged.
RESTORE_DELAY = 1.0
#: Guide rates that differ by less than this fraction of sidereal are equal: :Rg has tenths of an arcsecond.
GUIDE_RATE_TOLERANCE = 0.003


class RepeatEnd(Operation, frozen=True):
    """Internal: send an end command again unless a newer motion has begun. It is as urgent as a stop."""

    survives_abort = True

    command: str


def count_motion(mount: Lx200Driver, *axes: int) -> None:
    """Increase the number of motions begun on each of these axes; called before a motion."""
    for axis in axes:
        mount.motions_begun[axis] = mount.motions_begun.get(axis, 0) + 1


def end_motion(mount: Lx200Driver, command: str, axes: tuple[int, ...], was_moving: bool) -> Steps:
    """Send the command that ends the motion of these axes, and repeat it later if they were known to move."""
    if was_moving:
        mount.motions_at_end[command] = {axis: mount.motions_begun.get(axis, 0) for axis in axes}
    yield from ask(mount, command)
    if was_moving:
        yield Schedule(REPEAT_DELAY, RepeatEnd(command), urgent=True, not_while_busy=command != "Q")


def repeat_end(mount: Lx200Driver, operation: RepeatEnd) -> Steps:
    """Send an end command again, unless its axes have begun another motion or the telescope is busy."""
    begun = mount.motions_at_end.pop(operation.command, None)
    if begun is not None and all(mount.motions_begun.get(axis, 0) == number for axis, number in begun.items()):
        with contextlib.suppress(Busy):
            yield from ask(mount, operation.command)


# --- rates that a motion has changed --------------------------------------------------------------------------------


class RestoreRates(Operation, frozen=True):
    """Internal: restore the rates that a motion has changed, unless something moves again."""

    survives_abort = True


def restore_rates_later(mount: Lx200Driver) -> Steps:
    """Schedule the restoration of the rates if any was changed."""
    if _rates_changed(mount):
        yield Schedule(RESTORE_DELAY, RestoreRates(), not_while_busy=True)


def restore_rates(mount: Lx200Driver, _: RestoreRates) -> Steps:
    """Restore the changed rates. During a motion by hand or a pulse do nothing: its end schedules this again."""
    if mount.moving or mount.pulsing or not _rates_changed(mount):
        return
    if mount.goto is not None or mount.seeking or mount.now() < mount.pulses_end_at:
        yield Schedule(RESTORE_DELAY, RestoreRates(), not_while_busy=True)
        return
    if mount.keypad_rate is not None:
        if mount.old_pulse_rate not in (None, mount.keypad_rate):  # a slow rate of the keys is that of pulses, too
            yield from ask(mount, mount.old_pulse_rate or "")
        yield from ask(mount, mount.keypad_rate)
        mount.rate_sent = None
        return
    for axis in sorted(mount.axes_with_rate):
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=float(mount.facts["max_rate"]))
        mount.axes_with_rate.discard(axis)
    yield from set_max_speed(mount, None)
    yield from send_guide_rate(mount, mount.guide_rate)
    yield Remark(
        f"the gateway sets hand-control speeds that a motion has changed to {mount.facts['max_rate']} degrees a "
        f"second, and {mount.guide_rate:.0%} of sidereal for guiding: this Meade does not report the earlier ones"
    )


def set_max_speed(mount: Lx200Driver, speed: float | None) -> Steps:
    """:Sw - set the speed of :RS and of gotos, degrees per second; None: the value at power-on."""
    usual = int(mount.facts["max_rate"])
    lowest, highest = mount.facts["max_rates"]
    wanted = usual if speed is None else int(max(lowest, min(highest, speed)))
    if mount.supports("Sw") and wanted != (mount.max_speed_sent or usual):
        yield from ask(mount, "Sw", rate=wanted)
        mount.max_speed_sent = wanted


def send_guide_rate(mount: Lx200Driver, fraction: float) -> Steps:
    """:Rg - set the guide rate, a fraction of sidereal, if the model has :Rg and the value sent last was different."""
    if _guide_rate_differs(mount, fraction):
        yield from ask(mount, "Rg", rate=min(1.0, fraction) * SIDEREAL_ARCSEC_PER_S)
        mount.guide_rate_sent = fraction


def _guide_rate_differs(mount: Lx200Driver, fraction: float) -> bool:
    return mount.supports("Rg") and abs(fraction - mount.guide_rate_sent) > GUIDE_RATE_TOLERANCE


def _rates_changed(mount: Lx200Driver) -> bool:
    if mount.keypad_rate is not None:
        return mount.rate_sent not in (None, mount.keypad_rate)
    fastest_differs = mount.max_speed_sent not in (None, mount.facts["max_rate"])
    return _guide_rate_differs(mount, mount.guide_rate) or bool(mount.axes_with_rate) or fastest_differs
