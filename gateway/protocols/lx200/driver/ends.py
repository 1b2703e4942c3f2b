"""How a motion ends on a Meade: the end command is sent twice, and changed rates are restored a moment later.

A Meade acknowledges no end command, so the first may be lost. It is repeated when the line is free, but not if a newer
motion has begun on the same axes, or if the mount was at rest. A telescope that is computing accepts only :Q#; other
repetitions wait until it accepts them. No Meade reports its fastest rate, the rates of its axes or its guide rate, and
changed rates would affect its own hand control: so the gateway restores those at power-on, or those that a program has
set since. For an OnStep, which reports the rate of its arrows, that rate is restored.
"""

from __future__ import annotations

import contextlib

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core.errors import Busy
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Remark, Schedule, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds until an end command is repeated.
REPEAT_AFTER = 0.3
#: Both axes of the mount; the focuser has a number of its own.
MOUNT, FOCUSER = (1, 2), 3
#: Seconds after a motion until rates are restored: a program that moves again at once finds its rate unchanged.
RESTORE_AFTER = 1.0
#: Guide rates that differ by less than this fraction of sidereal are equal: :Rg has tenths of an arcsecond.
SAME = 0.003


class EndAgain(Operation, frozen=True):
    """Internal: send an end command again unless a newer motion has begun. It is as urgent as a stop."""

    survives_abort = True

    command: str


def count_motion(mount: Lx200Driver, *axes: int) -> None:
    """Count a motion that is about to begin on these axes."""
    for axis in axes:
        mount.motions_begun[axis] = mount.motions_begun.get(axis, 0) + 1


def end(mount: Lx200Driver, command: str, axes: tuple[int, ...], moved: bool) -> Steps:
    """Send the command that ends the motion of these axes, and repeat it later if they were known to move."""
    if moved:
        mount.ended[command] = {axis: mount.motions_begun.get(axis, 0) for axis in axes}
    yield from ask(mount, command)
    if moved:
        yield Schedule(REPEAT_AFTER, EndAgain(command), urgent=True, not_while_busy=command != "Q")


def repeat_end(mount: Lx200Driver, operation: EndAgain) -> Steps:
    """Repeat an end command. A busy telescope has received a newer command: the repetition is dropped."""
    begun = mount.ended.pop(operation.command, None)
    if begun is not None and all(mount.motions_begun.get(axis, 0) == number for axis, number in begun.items()):
        with contextlib.suppress(Busy):
            yield from ask(mount, operation.command)


# --- rates that a motion has changed --------------------------------------------------------------------------------


class PutBack(Operation, frozen=True):
    """Internal: restore the rates that a motion has changed, unless something moves again."""

    survives_abort = True


def restore_rates_later(mount: Lx200Driver) -> Steps:
    """Schedule the restoration of the rates if any was changed."""
    if _changed(mount):
        yield Schedule(RESTORE_AFTER, PutBack(), not_while_busy=True)


def restore_rates(mount: Lx200Driver, _: PutBack) -> Steps:
    """Restore the rates. During a manual motion nothing is done: its end schedules this again."""
    if mount.moving or mount.pulsing or not _changed(mount):
        return
    if mount.goto is not None or mount.seeking or mount.now() < mount.pulses_until:
        yield Schedule(RESTORE_AFTER, PutBack(), not_while_busy=True)
        return
    if mount.keys_rate is not None:
        if mount.pulses_before not in (None, mount.keys_rate):  # a slow rate of the keys is that of pulses, too
            yield from ask(mount, mount.pulses_before or "")
        yield from ask(mount, mount.keys_rate)
        mount.rate_sent = None
        return
    for axis in sorted(mount.free_axes):
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=float(mount.facts["max_rate"]))
        mount.free_axes.discard(axis)
    yield from set_fastest(mount, None)
    yield from use_guide_rate(mount, mount.guide_rate)
    yield Remark(
        f"the gateway sets hand-control speeds that a motion has changed to {mount.facts['max_rate']} degrees a "
        f"second, and {mount.guide_rate:.0%} of sidereal for guiding: this Meade does not report the earlier ones"
    )


def set_fastest(mount: Lx200Driver, degrees: float | None) -> Steps:
    """:Sw - set the speed of :RS and of gotos, degrees per second; None: the value at power-on."""
    usual = int(mount.facts["max_rate"])
    lowest, highest = mount.facts["max_rates"]
    wanted = usual if degrees is None else int(max(lowest, min(highest, degrees)))
    if mount.supports("Sw") and wanted != (mount.fastest or usual):
        yield from ask(mount, "Sw", rate=wanted)
        mount.fastest = wanted


def use_guide_rate(mount: Lx200Driver, fraction: float) -> Steps:
    """:Rg - set the guide rate if the model has :Rg and the last value sent was different; it cannot be read."""
    if _guide_rate_differs(mount, fraction):
        yield from ask(mount, "Rg", rate=min(1.0, fraction) * SIDEREAL_ARCSECONDS)
        mount.guide_rate_sent = fraction


def _guide_rate_differs(mount: Lx200Driver, fraction: float) -> bool:
    return mount.supports("Rg") and abs(fraction - mount.guide_rate_sent) > SAME


def _changed(mount: Lx200Driver) -> bool:
    if mount.keys_rate is not None:
        return mount.rate_sent not in (None, mount.keys_rate)
    fastest_differs = mount.fastest not in (None, mount.facts["max_rate"])
    return _guide_rate_differs(mount, mount.guide_rate) or bool(mount.free_axes) or fastest_differs
