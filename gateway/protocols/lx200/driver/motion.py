"""Arrows, their rates, and guiding.

Motor sense is kept: positive is west on the first axis (east in the south); on the second it lifts the tube of a fork,
towards the elevated pole where it stands on a wedge. On a Meade that is a German mount the second one turns with the
side of the pier, as the motors of a German hand control do.
"""

from __future__ import annotations

from gateway.driver import Steps
from gateway.errors import Refused
from gateway.operations import Halt, Move, MoveAxis, Pulse, PulseAxis, Pulsed, Rate, SetGuideRate, Stop
from gateway.protocols.lx200.driver.ends import MOUNT, begins, end
from gateway.protocols.lx200.driver.pier import beyond_pole
from gateway.protocols.lx200.driver.state import SIDEREAL, SPEEDS, Meade, ask, rate_command

#: Faster than that an LX200GPS takes degrees a second; slower ones are its guide rate.
_FREE_FROM = 0.1
LONGEST_PULSE = 9999  # milliseconds: the four digits of :Mg


def _letter(mount: Meade, axis: int, sense: int) -> Steps:
    if axis == 2 and mount.equatorial and not mount.german and mount.southern:  # it lifts the tube to the southern pole
        sense = -sense
    elif axis == 2 and mount.german:  # its second motor turns the tube the other way on one side of the pier
        sense = -sense if (yield from beyond_pole(mount)) is not mount.southern else sense
    if axis == 2:
        return "n" if sense > 0 else "s"
    if mount.equatorial and mount.southern:
        sense = -sense
    return "w" if sense > 0 else "e"


def move(mount: Meade, operation: Move) -> Steps:
    """:M… in a sky direction."""
    yield from _move(mount, operation.direction.axis, operation.direction.value, operation.rate)


def move_axis(mount: Meade, operation: MoveAxis) -> Steps:
    """:M… by motor sense."""
    letter = yield from _letter(mount, operation.axis, operation.sense)
    yield from _move(mount, operation.axis, letter, operation.rate)


def _move(mount: Meade, axis: int, letter: str, rate: Rate) -> Steps:
    old = mount.moving.get(axis)
    if old is not None and old != letter:
        yield from ask(mount, f"Q{old}")
    yield from _choose(mount, axis, rate)
    begins(mount, axis)
    yield from ask(mount, f"M{letter}")
    mount.moving[axis], mount.parked = letter, False


def _choose(mount: Meade, axis: int, rate: Rate) -> Steps:
    """Set the rate: freely on an LX200GPS, else the nearest of the four that is not above it."""
    if rate.key is None and rate.name is None and mount.knows("RA"):
        yield from _choose_freely(mount, axis, rate.degrees or 0.0)
        return
    command = rate_command(rate)
    if command == "RS":
        yield from _fastest(mount, axis, rate.degrees if rate.name == "max" else None)
    elif command == "RG":
        yield from set_guide_rate(mount, SetGuideRate(axis, mount.guide_rate))
    yield from ask(mount, command)


def _choose_freely(mount: Meade, axis: int, degrees: float) -> Steps:
    """Degrees a second by :RA or :RE, slow ones as the guide rate."""
    if degrees >= _FREE_FROM:
        yield from ask(mount, "RS")
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=min(SPEEDS["RS"], degrees))
        mount.free_axes.add(axis)
    else:
        yield from _guide_at(mount, degrees * 3600.0 / SIDEREAL)
        yield from ask(mount, "RG")


def _fastest(mount: Meade, axis: int, degrees: float | None) -> Steps:
    """:Sw when another speed than the last one is wanted for :RS; a rate of this axis' own is taken back."""
    lowest, highest = mount.facts["max_rates"]
    wanted = int(max(lowest, min(highest, mount.facts["max_rate"] if degrees is None else degrees)))
    if wanted != (mount.fastest or mount.facts["max_rate"]):
        yield from ask(mount, "Sw", rate=wanted)
        mount.fastest = wanted
    if axis in mount.free_axes:
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=float(wanted))
        mount.free_axes.discard(axis)


def set_guide_rate(mount: Meade, operation: SetGuideRate) -> Steps:
    """The fraction of sidereal that :RG and guide pulses mean: :Rg where the model has it and it is another one."""
    mount.guide_rate = min(1.0, operation.rate)
    if mount.knows("Rg"):
        yield from _guide_at(mount, mount.guide_rate)


def _guide_at(mount: Meade, fraction: float) -> Steps:
    """:Rg, which no Meade tells again: it is sent whenever it differs from what was sent last."""
    if abs(fraction - mount.guides_at) > 1e-6:
        yield from ask(mount, "Rg", rate=min(1.0, fraction) * SIDEREAL)
        mount.guides_at = fraction


def halt(mount: Meade, operation: Halt) -> Steps:
    """:Q… of the arrow that was pressed; both of the axis when none is known to be."""
    pulsed, moved = mount.pulsing.pop(operation.axis, None), mount.moving.pop(operation.axis, None)
    letter = moved or pulsed
    letters = [letter] if letter else (["e", "w"] if operation.axis == 1 else ["n", "s"])
    for one in letters:
        yield from end(mount, f"Q{one}", (operation.axis,), letter is not None)


def stop(mount: Meade, _: Stop) -> Steps:
    """:Q"""
    moved = mount.goto is not None or mount.seeking or bool(mount.moving or mount.pulsing)
    mount.goto = None
    mount.moving.clear()
    mount.pulsing.clear()
    yield from end(mount, "Q", MOUNT, moved)
    mount.seeking = False


# --- guiding ----------------------------------------------------------------------------------------------------


def pulse(mount: Meade, operation: Pulse) -> Steps:
    """-> Pulsed. :Mg where the model has it, four digits at most; else guide rate, which has to be ended."""
    return (yield from _pulse(mount, operation.direction.axis, operation.direction.value, operation.ms, None))


def pulse_axis(mount: Meade, operation: PulseAxis) -> Steps:
    """-> Pulsed. The same by motor sense, at a rate of its own where the model takes one."""
    letter = yield from _letter(mount, operation.axis, operation.sense)
    return (yield from _pulse(mount, operation.axis, letter, operation.ms, operation.rate))


def _pulse(mount: Meade, axis: int, letter: str, ms: int, rate: float | None) -> Steps:
    if mount.goto is not None:
        raise Refused("The mount is slewing: the guide pulse is dropped.")
    if mount.knows("Rg"):
        yield from _guide_at(mount, mount.guide_rate if rate is None else rate)
    if mount.knows("Mg") and mount.product:
        piece = min(ms, LONGEST_PULSE)
        begins(mount, axis)
        yield from ask(mount, "Mg", direction=letter, ms=piece)
        return Pulsed(piece / 1000.0, ends=True, left=ms - piece)
    yield from ask(mount, "RG")
    begins(mount, axis)
    yield from ask(mount, f"M{letter}")
    mount.pulsing[axis] = letter
    return Pulsed(ms / 1000.0, ends=False)
