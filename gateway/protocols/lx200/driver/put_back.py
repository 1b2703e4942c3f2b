"""What a motion by hand has changed on the telescope is put back a moment after it.

No Meade tells its fastest rate, the rates of its axes or its guide rate: left as they are, its own hand control, and a
goto, would go at them. Put back is what the telescope has at power-on, or what a program has set since.
"""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Schedule, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds after the end of a motion; so a program that presses again at once finds its rate still there.
AFTER = 1.0
#: Guide rates nearer to each other than this part of sidereal are one: :Rg has tenths of an arcsecond.
SAME = 0.003


class PutBack(Operation, frozen=True):
    """Internal: the rates are to be what they were, unless something moves again."""

    survives_abort = True


def later(mount: Lx200Driver) -> Steps:
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
    if mount.knows("Sw") and wanted != (mount.fastest or usual):
        yield from ask(mount, "Sw", rate=wanted)
        mount.fastest = wanted


def guide_at(mount: Lx200Driver, fraction: float) -> Steps:
    """:Rg where the model has it, when it differs from what was sent last: no Meade tells it again."""
    if _guides_otherwise(mount, fraction):
        yield from ask(mount, "Rg", rate=min(1.0, fraction) * SIDEREAL_ARCSECONDS)
        mount.guides_at = fraction


def _guides_otherwise(mount: Lx200Driver, fraction: float) -> bool:
    return mount.knows("Rg") and abs(fraction - mount.guides_at) > SAME


def _changed(mount: Lx200Driver) -> bool:
    fastest_differs = mount.fastest not in (None, mount.facts["max_rate"])
    return _guides_otherwise(mount, mount.guide_rate) or bool(mount.free_axes) or fastest_differs
