"""Arrows, their rates, and guiding.

Motor sense is kept: positive is west on the first axis (east in the south); on the second it lifts the tube of a fork,
towards the elevated pole where it stands on a wedge. On a Meade that is a German mount the second one turns with the
side of the pier, as the motors of a German hand control do. A variable rate of the motor in right ascension takes the
place of tracking, an arrow of the sky does not.
"""

from __future__ import annotations

import math

from gateway.core import operations as op
from gateway.core.errors import Refused
from gateway.protocols.base.driver import SLEWING, Remark, Steps
from gateway.protocols.lx200.driver.drive import drive_at, put_drive_back
from gateway.protocols.lx200.driver.ends import MOUNT, at_most, begins, end, guide_at, put_back_later
from gateway.protocols.lx200.driver.pointing import beyond_pole
from gateway.protocols.lx200.driver.speeds import SPEEDS, Speed, instead_of_tracking, nearest, off
from gateway.protocols.lx200.driver.state import Lx200Driver, ask, rate_command

LONGEST_PULSE = 9999  # milliseconds: the four digits of :Mg
#: What is off by more than this part of what was asked is said.
_SAID_FROM = math.log(1.1)
_NAMED_DRIVES = {"sidereal": 1.0, "solar": 0.99727, "lunar": 0.97633}


def _letter(mount: Lx200Driver, axis: int, sense: int) -> Steps:
    if axis == 2 and mount.equatorial and not mount.german and mount.southern:  # it lifts the tube to the southern pole
        sense = -sense
    elif axis == 2 and mount.german:  # its second motor turns the tube the other way on one side of the pier
        sense = -sense if (yield from beyond_pole(mount)) is not mount.southern else sense
    if axis == 2:
        return "n" if sense > 0 else "s"
    if mount.equatorial and mount.southern:
        sense = -sense
    return "w" if sense > 0 else "e"


def move(mount: Lx200Driver, operation: op.Move) -> Steps:
    """:M… in a sky direction."""
    speed = yield from _speed(mount, operation.rate)
    yield from _move(mount, operation.axis, operation.direction.value, operation.rate, speed)


def move_axis(mount: Lx200Driver, operation: op.MoveAxis) -> Steps:
    """:M… by motor sense. A variable rate in right ascension counts from rest, where the mount tracks."""
    axis, rate = operation.axis, operation.rate
    letter = yield from _letter(mount, axis, operation.sense)
    tracks = mount.equatorial and not mount.land and mount.tracking is not op.Tracking.OFF
    if axis != 1 or rate.degrees is None or rate.key is not None or rate.name is not None or not tracks:
        speed = yield from _speed(mount, rate)
        yield from _move(mount, axis, letter, rate, speed)
        return
    west = rate.degrees if letter == "w" else -rate.degrees
    speed = instead_of_tracking(mount.abilities, west, _drive(mount))
    yield from _say(west, speed.degrees)
    if speed.hertz is not None:
        mount.driven = True
        yield from drive_at(mount, speed.hertz)
    else:
        yield from put_drive_back(mount)
    if speed.west is not None:
        letter = "w" if speed.west else "e"
    yield from _move(mount, axis, letter, rate, speed)


def _drive(mount: Lx200Driver) -> float:
    """What it tracks at, degrees a second."""
    rate = mount.rate
    factor = 1.0 if rate is None else rate.factor if rate.factor is not None else _NAMED_DRIVES[rate.name or "sidereal"]
    return factor * SPEEDS["RG"]


def _speed(mount: Lx200Driver, rate: op.Rate) -> Steps:
    """The nearest to so many degrees a second; None for a rate that has a name, or is one of the telescope's keys."""
    if rate.name is not None or rate.degrees is None:
        return None
    speed = nearest(mount.abilities, rate.degrees)
    yield from _say(rate.degrees, speed.degrees)
    return speed


def _say(asked: float, done: float) -> Steps:
    if off(asked, done) > _SAID_FROM:
        yield Remark(
            f"{abs(asked) * 3600:.5g} arcseconds a second go as {done * math.copysign(3600, asked):.5g}: "
            "no other speed of this Meade is nearer"
        )


def _move(mount: Lx200Driver, axis: int, letter: str, rate: op.Rate, speed: Speed | None) -> Steps:
    """``speed`` of None is the one of its name; one without a command is tracking itself, at another rate."""
    old = mount.moving.get(axis)
    none = speed is not None and speed.command is None
    if old and (old != letter or none):
        yield from ask(mount, f"Q{old}")
    if none:
        mount.moving[axis], mount.parked = "", False
        return
    yield from (_named(mount, axis, rate) if speed is None else _chosen(mount, axis, speed))
    begins(mount, axis)
    yield from ask(mount, f"M{letter}")
    mount.moving[axis], mount.parked = letter, False


def _named(mount: Lx200Driver, axis: int, rate: op.Rate) -> Steps:
    """One of the four rates by its name."""
    command = rate_command(rate)
    if command == "RS":
        yield from _fastest(mount, axis, rate.degrees if rate.name == "max" else None)
    elif command == "RG":
        yield from guide_at(mount, mount.guide_rate)
    yield from ask(mount, command)


def _chosen(mount: Lx200Driver, axis: int, speed: Speed) -> Steps:
    """The rate, and before or behind it what it is to mean."""
    if speed.guide is not None:
        yield from guide_at(mount, speed.guide)
    if speed.command == "RS" and speed.free is None:
        yield from _fastest(mount, axis, speed.fastest)
    assert speed.command is not None
    yield from ask(mount, speed.command)
    if speed.free is not None:
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=speed.free)
        mount.free_axes.add(axis)


def _fastest(mount: Lx200Driver, axis: int, degrees: float | None) -> Steps:
    """What :RS is to mean on this axis: a rate of its own is taken back."""
    yield from at_most(mount, degrees)
    if axis in mount.free_axes:
        fastest = float(mount.fastest or mount.facts["max_rate"])
        yield from ask(mount, "RA" if axis == 1 else "RE", rate=fastest)
        mount.free_axes.discard(axis)


def set_guide_rate(mount: Lx200Driver, operation: op.SetGuideRate) -> Steps:
    """The fraction of sidereal that :RG and guide pulses mean: :Rg where the model has it and it is another one."""
    mount.guide_rate = min(1.0, operation.rate)
    yield from guide_at(mount, mount.guide_rate)


def stop_axis(mount: Lx200Driver, operation: op.StopAxis) -> Steps:
    """:Q… of the arrow that was pressed; both of the axis when none is known to be."""
    pulsed, moved = mount.pulsing.pop(operation.axis, None), mount.moving.pop(operation.axis, None)
    letter = moved or pulsed
    if moved != "" or pulsed:
        letters = [letter] if letter else (["e", "w"] if operation.axis == 1 else ["n", "s"])
        for one in letters:
            yield from end(mount, f"Q{one}", (operation.axis,), letter is not None)
    if operation.axis == 1:
        yield from put_drive_back(mount)
    yield from put_back_later(mount)


def abort_motion(mount: Lx200Driver, _: op.AbortMotion) -> Steps:
    """:Q"""
    moved = mount.goto is not None or mount.seeking or bool(mount.moving or mount.pulsing)
    mount.goto = None
    mount.moving.clear()
    mount.pulsing.clear()
    yield from end(mount, "Q", MOUNT, moved)
    mount.seeking = False
    yield from put_drive_back(mount)
    yield from put_back_later(mount)


# --- guiding ----------------------------------------------------------------------------------------------------


def pulse(mount: Lx200Driver, operation: op.Pulse) -> Steps:
    """-> Pulsed. :Mg where the model has it, four digits at most; else guide rate, which has to be ended."""
    return (yield from _pulse(mount, operation.direction.axis, operation.direction.value, operation.ms, None))


def pulse_axis(mount: Lx200Driver, operation: op.PulseAxis) -> Steps:
    """-> Pulsed. The same by motor sense, at a rate of its own."""
    letter = yield from _letter(mount, operation.axis, operation.sense)
    return (yield from _pulse(mount, operation.axis, letter, operation.ms, operation.rate))


def _pulse(mount: Lx200Driver, axis: int, letter: str, ms: int, rate: float | None) -> Steps:
    """A model that guides at its one rate alone does so for as much shorter."""
    if mount.goto is not None:
        raise Refused(SLEWING)
    fraction = mount.guide_rate if rate is None else rate
    shorter = 1.0 if mount.supports("Rg") else fraction
    yield from guide_at(mount, fraction)
    ms = round(ms * shorter)
    if ms <= 0:
        return None
    if mount.supports("Mg") and mount.product:
        piece = min(ms, LONGEST_PULSE)
        begins(mount, axis)
        yield from ask(mount, "Mg", direction=letter, ms=piece)
        mount.pulses_until = max(mount.pulses_until, mount.now() + piece / 1000.0)
        yield from put_back_later(mount)
        return op.Pulsed(piece / 1000.0, ends=True, left=round((ms - piece) / shorter))
    yield from ask(mount, "RG")
    begins(mount, axis)
    yield from ask(mount, f"M{letter}")
    mount.pulsing[axis] = letter
    return op.Pulsed(ms / 1000.0, ends=False)
