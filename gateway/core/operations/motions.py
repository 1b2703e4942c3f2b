"""Operations that move the mount, end a motion, or change the position that the mount assumes."""

from __future__ import annotations

from gateway.core.operations.values import Chosen, Direction, Fields, Operation, Pulsed, Rate, Tracking, Values


class Goto(Operation[None], frozen=True):
    """Slew to a position of date and track there. Raises BelowHorizon, TooHigh, NearSun, NotAligned, NoAnswer.

    ``lowest`` and ``highest`` narrow the altitude limits; without ``track`` a drive that is off stays off. ``fastest``
    is the speed in degrees a second, for mounts that let the client choose it.
    """

    ra: float
    dec: float
    lowest: float | None = None
    highest: float | None = None
    track: bool = True
    fastest: float | None = None


class GotoHorizontal(Operation[None], frozen=True):
    """Slew to an azimuth and altitude, degrees; the other fields are as in ``Goto``."""

    called = "Goto"
    polar = ("alt",)

    az: float
    alt: float
    lowest: float | None = None
    highest: float | None = None
    fastest: float | None = None


class GotoAxes(Operation[None], frozen=True):
    """Slew both motor axes to these readings, degrees (azimuth, altitude only on a fork). ``fastest`` as in Goto."""

    called = "Goto"

    az: float
    alt: float
    fastest: float | None = None


class Sync(Operation[None], frozen=True):
    """Tell the mount that it points at this position of date now. Raises SyncTooFar, NoAnswer."""

    ra: float
    dec: float


class Move(Operation[None], frozen=True):
    """Start moving in a sky direction at a hand rate, until halted.

    ``lowest`` and ``highest`` narrow the altitude limits during the motion. ``ms``: a tap of this many milliseconds at
    guide rate; a mount that times guide pulses is sent a pulse -> Pulsed.
    """

    called = "Arrow"

    direction: Direction
    rate: Rate
    lowest: float | None = None
    highest: float | None = None
    ms: int | None = None

    @property
    def axis(self) -> int:
        return self.direction.axis

    @property
    def sense(self) -> int:
        return self.direction.sense


class MoveAxis(Operation[None], frozen=True):
    """Start turning a motor: axis 1 or 2, sense +1 or -1, at a hand rate, until halted."""

    called = "Arrow"

    axis: int
    sense: int
    rate: Rate


class StopAxis(Operation[None], frozen=True):
    """End the motion of an axis (1 or 2)."""

    called = "Release of an arrow"

    axis: int


class AbortMotion(Operation[None], frozen=True):
    """End every motion and goto; tracking stays as it was."""

    called = "Stop"


class Pulse(Operation[Pulsed | None], frozen=True):
    """Guide in a direction for some milliseconds.

    ``sky``: the direction is that on the sky: north is north on both sides of the pier, and on an alt-az mount both
    axes turn. Otherwise it is a motor's direction.
    """

    direction: Direction
    ms: int
    sky: bool = False


class PulseAxis(Operation[Pulsed | None], frozen=True):
    """Guide with a motor: axis 1 or 2, sense +1 or -1, for some milliseconds; rate as a fraction of sidereal."""

    called = "Pulse"

    axis: int
    sense: int
    ms: int
    rate: float | None = None


class AbortSlew(Operation[None], frozen=True):
    """End the goto under way; motion by hand continues."""

    called = "End of a goto"


class SetTracking(Operation[None], frozen=True):
    """Turn tracking off, or on in ``mode``, by default the mount's own mode.

    ``heard``: wait for what the mount reports afterwards; raises Refused if it has not changed. ``code`` is the number
    of the mode in the mount's own protocol, from a program to which the mount itself is presented.
    """

    called = "Tracking"

    survives_abort = True

    on: bool
    mode: Tracking | None = None
    heard: bool = False
    code: int | None = None


class TrackRate(Operation[None], frozen=True):
    """Set the drive rate: ``sidereal``, ``solar``, ``lunar``, or a multiple of sidereal."""

    called = "Tracking rate"

    survives_abort = True

    name: str | None = None
    factor: float | None = None


class Park(Operation[None], frozen=True):
    """Slew to the park position, then turn tracking off."""


class Home(Operation[None], frozen=True):
    """Slew to the stored home position."""


class SetHome(Operation[None], frozen=True):
    """Store the present position as home; a mount with marks on its axes may turn to search for them."""

    called = "Home position"


class Unpark(Operation[None], frozen=True):
    """Leave the park position: turn tracking on, and read the mount's state again."""

    survives_abort = True


class Hibernate(Operation[None], frozen=True):
    """End all motion, then hibernate; a mount that cannot hibernate turns tracking off."""

    survives_abort = True


class Wake(Operation[None], frozen=True):
    """Wake from hibernation; a mount that cannot hibernate turns tracking on."""

    survives_abort = True


class PassThrough(Operation[Values | None], frozen=True):
    """Pass on a command that the gateway does not interpret -> the reply's fields.

    Only if client and mount speak the same protocol. ``fields`` are the request's field values, in order.
    """

    called = "Command of the mount's own"

    command: str
    fields: Fields = ()


class Choose(Operation[Chosen], frozen=True):
    """Select an object of the mount's library -> Chosen. ``first`` are the commands on which its number depends.

    This is no motion but takes its turn among motions: the mount has one target, which gotos and syncs set as well.
    ``ra`` and ``dec`` are the present target, which stays if no object is found.
    """

    survives_abort = True

    command: str
    fields: Fields = ()
    first: tuple[tuple[str, Fields], ...] = ()
    ra: float = 0.0
    dec: float = 0.0
