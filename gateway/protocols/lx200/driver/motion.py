"""Arrows, guiding, tracking, drive rates, accessories.

Motor sense is kept: a motor's positive sense is west on the first axis (east in the south), north on the second.
"""

from __future__ import annotations

from gateway.driver import Later, Steps
from gateway.errors import Unsupported
from gateway.operations import (
    Backlash,
    Focus,
    Halt,
    Move,
    MoveAxis,
    Operation,
    PeriodicError,
    Pulse,
    PulseAxis,
    Rate,
    SetGuideRate,
    SetTracking,
    Stop,
    Tracking,
    TrackRate,
)
from gateway.protocols.lx200.driver.identify import own_mode
from gateway.protocols.lx200.driver.state import SIDEREAL, SPEEDS, Meade, ask, rate_command

SIDEREAL_HERTZ = 60.16427
_DRIVES = {"sidereal": "TQ", "solar": "TS", "lunar": "TL"}
#: Faster than that an LX200GPS takes degrees a second; slower ones are its guide rate.
_FREE_FROM = 0.1


def _letter(mount: Meade, axis: int, sense: int) -> str:
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
    yield from _move(mount, operation.axis, _letter(mount, operation.axis, operation.sense), operation.rate)


def _move(mount: Meade, axis: int, letter: str, rate: Rate) -> Steps:
    old = mount.moving.get(axis)
    if old is not None and old != letter:
        yield from ask(mount, f"Q{old}")
    yield from _choose(mount, axis, rate)
    yield from ask(mount, f"M{letter}")
    mount.moving[axis], mount.parked = letter, False


def _choose(mount: Meade, axis: int, rate: Rate) -> Steps:
    """Set the rate: freely on an LX200GPS, else the nearest of the four that is not above it."""
    if rate.key is None and rate.name is None and mount.model == "lx200gps":
        degrees = rate.degrees or 0.0
        if degrees >= _FREE_FROM:
            yield from ask(mount, "RS")
            yield from ask(mount, "RA" if axis == 1 else "RE", rate=min(SPEEDS["RS"], degrees))
        else:
            yield from ask(mount, "Rg", rate=min(SIDEREAL, degrees * 3600.0))
            yield from ask(mount, "RG")
    else:
        yield from ask(mount, rate_command(rate))


def halt(mount: Meade, operation: Halt) -> Steps:
    """:Q… of the arrow that was pressed; both of the axis when none is known to be."""
    letter = mount.moving.pop(operation.axis, None)
    letters = [letter] if letter else (["e", "w"] if operation.axis == 1 else ["n", "s"])
    for one in letters:
        yield from ask(mount, f"Q{one}")


def stop(mount: Meade, _: Stop) -> Steps:
    """:Q"""
    mount.goto = None
    mount.moving.clear()
    mount.pulsing.clear()
    yield from ask(mount, "Q")


# --- guiding ----------------------------------------------------------------------------------------------------


class EndPulse(Operation, frozen=True):
    """Internal: a guide pulse timed by the gateway is over. Ranks as a stop."""

    axis: int


def pulse(mount: Meade, operation: Pulse) -> Steps:
    """:Mg where the model has it, else guide rate for that long."""
    yield from _pulse(mount, operation.direction.axis, operation.direction.value, operation.ms)


def pulse_axis(mount: Meade, operation: PulseAxis) -> Steps:
    """The same by motor sense."""
    yield from _pulse(mount, operation.axis, _letter(mount, operation.axis, operation.sense), operation.ms)


def _pulse(mount: Meade, axis: int, letter: str, ms: int) -> Steps:
    if mount.knows("Mg") and mount.product:
        yield from ask(mount, "Mg", direction=letter, ms=min(ms, 9999))
        return
    yield from ask(mount, "RG")
    yield from ask(mount, f"M{letter}")
    mount.pulsing[axis] = letter
    yield Later(ms / 1000.0, EndPulse(axis), urgent=True)


def end_pulse(mount: Meade, operation: EndPulse) -> Steps:
    """:Q…, unless a stop already did it."""
    letter = mount.pulsing.get(operation.axis)
    if letter is not None:
        yield from ask(mount, f"Q{letter}")
        mount.pulsing.pop(operation.axis, None)


# --- tracking ---------------------------------------------------------------------------------------------------


def set_tracking(mount: Meade, operation: SetTracking) -> Steps:
    """:AL and back, only on models that report :GW - elsewhere these letters destroy the alignment."""
    wanted = own_mode(mount) if operation.on else Tracking.OFF
    if wanted is mount.tracking:
        return
    if not mount.tells_status:
        raise Unsupported("The mount keeps tracking: switching it off would destroy its alignment.")
    yield from ask(mount, "AL" if not operation.on else {"A": "AA", "P": "AP", "G": "AP"}[mount.home_letter])
    mount.tracking = wanted


def track_rate(mount: Meade, operation: TrackRate) -> Steps:
    """:TQ :TS :TL, any other one in hertz."""
    if operation.name is not None:
        yield from ask(mount, _DRIVES[operation.name])
    else:
        yield from ask(mount, "TM")
        yield from ask(mount, "ST", hertz=(operation.factor or 1.0) * SIDEREAL_HERTZ)


def set_guide_rate(mount: Meade, operation: SetGuideRate) -> Steps:
    """:Rg on an LX200GPS."""
    if not mount.knows("Rg"):
        raise Unsupported("This model has one guide rate only.")
    yield from ask(mount, "Rg", rate=operation.rate * SIDEREAL)


# --- accessories ------------------------------------------------------------------------------------------------


def backlash(mount: Meade, operation: Backlash) -> Steps:
    """:$BA :$BZ on an LX200GPS."""
    command = "$BZ" if operation.axis == 1 else "$BA"
    if not mount.knows(command):
        raise Unsupported("This model has no adjustable backlash.")
    yield from ask(mount, command, value=operation.value)


def periodic_error(mount: Meade, operation: PeriodicError) -> Steps:
    """:$QZ :$QA on an LX200GPS, the toggle elsewhere."""
    if operation.axis is not None and mount.knows("$QZ+"):
        yield from ask(mount, f"$Q{'Z' if operation.axis == 1 else 'A'}{'+' if operation.on else '-'}")
    elif mount.model != "autostar":
        yield from ask(mount, "$Q")
    else:
        raise Unsupported("This model has no periodic error correction over the line.")


def focus(mount: Meade, operation: Focus) -> Steps:
    """:F"""
    if operation.direction and mount.knows("F"):
        yield from ask(mount, "F", speed=operation.speed)
    yield from ask(mount, {1: "F+", -1: "F-", 0: "FQ"}[operation.direction])


