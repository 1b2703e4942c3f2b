"""How a motion ends on a Meade: its end is sent twice, and what it has changed is put back a moment after it.

A Meade acknowledges no end, so the first may have been lost. The second one follows when the line is free for it, and
not at all when something newer was begun meanwhile on what it ends, or when nothing was known to move. So it costs the
first one no time, no goto is cut off by it, and a program that hammers stops at a mount at rest does not load the line
twice. A telescope that calculates hears :Q# alone: the second one of any other end waits until it hears again.

No Meade tells its fastest rate, the rates of its axes or its guide rate: left as they are, its own hand control, and a
goto, would go at them. Put back is what the telescope has at power-on, or what a program has set since.
"""

from __future__ import annotations

import contextlib

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core.errors import Busy
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Schedule, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds from the first to the second.
AGAIN = 0.3
#: Both axes of the mount; the focuser has a number of its own.
MOUNT, FOCUSER = (1, 2), 3
#: Seconds after the end of a motion; so a program that presses again at once finds its rate still there.
AFTER = 1.0
#: Guide rates nearer to each other than this part of sidereal are one: :Rg has tenths of an arcsecond.
SAME = 0.003


class EndAgain(Operation, frozen=True):
    """Internal: this command once more, unless something newer was begun. Ranks as a stop; no stop takes it back."""

    survives_abort = True

    command: str


def begins(mount: Lx200Driver, *axes: int) -> None:
    """Something is about to be set moving on these axes."""
    for axis in axes:
        mount.begun[axis] = mount.begun.get(axis, 0) + 1


def end(mount: Lx200Driver, command: str, axes: tuple[int, ...], moved: bool) -> Steps:
    """Send what ends the motion of these axes; ``moved`` tells whether there was any that is known of."""
    if moved:
        mount.ended[command] = {axis: mount.begun.get(axis, 0) for axis in axes}
    yield from ask(mount, command)
    if moved:
        yield Schedule(AGAIN, EndAgain(command), urgent=True, heard=command != "Q")


def end_again(mount: Lx200Driver, operation: EndAgain) -> Steps:
    """The second one. A telescope that is busy with itself has been given something newer to do."""
    begun = mount.ended.pop(operation.command, None)
    if begun is not None and all(mount.begun.get(axis, 0) == number for axis, number in begun.items()):
        with contextlib.suppress(Busy):
            yield from ask(mount, operation.command)


# --- what a motion has changed --------------------------------------------------------------------------------------


class PutBack(Operation, frozen=True):
    """Internal: the rates are to be what they were, unless something moves again."""

    survives_abort = True


def put_back_later(mount: Lx200Driver) -> Steps:
    """Have it done, where anything was changed."""
    if _changed(mount):
        yield Schedule(AFTER, PutBack(), heard=True)


def put_back(mount: Lx200Driver, _: PutBack) -> Steps:
    """Not while something moves: its end sees to it."""
    if mount.moving or mount.pulsing or not _changed(mount):
        return
    if mount.goto is not None or mount.seeking or mount.now() < mount.pulses_until:
        yield Schedule(AFTER, PutBack(), heard=True)
        return
    for axis in sorted(mount.free_axes):
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=float(mount.facts["max_rate"]))
        mount.free_axes.discard(axis)
    yield from at_most(mount, None)
    yield from guide_at(mount, mount.guide_rate)


def at_most(mount: Lx200Driver, degrees: float | None) -> Steps:
    """:Sw when :RS, which is the speed of a goto as well, is to be so many degrees a second; None: as at power-on."""
    usual = int(mount.facts["max_rate"])
    lowest, highest = mount.facts["max_rates"]
    wanted = usual if degrees is None else int(max(lowest, min(highest, degrees)))
    if mount.supports("Sw") and wanted != (mount.fastest or usual):
        yield from ask(mount, "Sw", rate=wanted)
        mount.fastest = wanted


def guide_at(mount: Lx200Driver, fraction: float) -> Steps:
    """:Rg where the model has it, when it differs from what was sent last: no Meade tells it again."""
    if _guides_otherwise(mount, fraction):
        yield from ask(mount, "Rg", rate=min(1.0, fraction) * SIDEREAL_ARCSECONDS)
        mount.guides_at = fraction


def _guides_otherwise(mount: Lx200Driver, fraction: float) -> bool:
    return mount.supports("Rg") and abs(fraction - mount.guides_at) > SAME


def _changed(mount: Lx200Driver) -> bool:
    fastest_differs = mount.fastest not in (None, mount.facts["max_rate"])
    return _guides_otherwise(mount, mount.guide_rate) or bool(mount.free_axes) or fastest_differs
