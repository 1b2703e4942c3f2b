"""Operations that move the mount, end a motion, or change the position that the mount assumes."""

from __future__ import annotations

from gateway.core.operations.values import Chosen, Direction, Fields, Operation, Pulsed, Rate, Tracking, Values


class Goto(Operation[None], frozen=True):
    """Slew to a position of date and track there. Raises Fault, such as BelowHorizon, NearSun, NotAligned, NoAnswer.

    ``lowest`` and ``highest`` narrow the altitude limits. Without ``track``, tracking that is off stays off.
    ``fastest`` is the slew speed in degrees a second, for mounts that let the client choose it.
    """

    ra: float
    dec: float
    lowest: float | None = None  # altitude limit for this goto, degrees
    highest: float | None = None  # altitude limit for this goto, degrees
    track: bool = True  # turn tracking on
    fastest: float | None = None  # slew speed, degrees a second


class GotoHorizontal(Operation[None], frozen=True):
    """Slew to an azimuth and altitude, degrees; the other fields are as in ``Goto``."""

    display_name = "Goto"
    polar_fields = ("alt",)

    az: float
    alt: float
    lowest: float | None = None  # altitude limit for this goto, degrees
    highest: float | None = None  # altitude limit for this goto, degrees
    fastest: float | None = None  # slew speed, degrees a second


class GotoAxes(Operation[None], frozen=True):
    """Slew both motor axes to these axis angles, degrees; only on a fork they are azimuth and altitude."""

    display_name = "Goto"

    az: float  # reading of axis 1
    alt: float  # reading of axis 2
    fastest: float | None = None  # slew speed, degrees a second


class Sync(Operation[None], frozen=True):
    """Tell the mount that it points at this position of date now. Raises SyncTooFar, NoAnswer."""

    ra: float
    dec: float


class Move(Operation[None], frozen=True):
    """Start moving in a sky direction at a hand rate, until halted.

    ``lowest`` and ``highest`` narrow the altitude limits during the motion. With ``ms`` it is a tap of so many
    milliseconds at guide rate, sent as a guide pulse if the mount times pulses itself (the answer is then Pulsed).
    """

    display_name = "Arrow"

    direction: Direction
    rate: Rate
    lowest: float | None = None  # altitude limit during the motion, degrees
    highest: float | None = None  # altitude limit during the motion, degrees
    ms: int | None = None  # length of a tap

    @property
    def axis(self) -> int:
        return self.direction.axis

    @property
    def sense(self) -> int:
        return self.direction.sense


class MoveAxis(Operation[None], frozen=True):
    """Start turning a motor: axis 1 or 2, sense +1 or -1, at a hand rate, until halted."""

    display_name = "Arrow"

    axis: int  # 1 or 2
    sense: int  # of the motor, +1 or -1
    rate: Rate


class StopAxis(Operation[None], frozen=True):
    """End the motion of an axis (1 or 2)."""

    display_name = "Release of an arrow"

    axis: int


class AbortMotion(Operation[None], frozen=True):
    """End every motion and goto; tracking stays as it was."""

    display_name = "Stop"


class Pulse(Operation[Pulsed | None], frozen=True):
    """Guide in a direction for some milliseconds.

    With ``sky`` it is the direction on the sky: north is north on both sides of the pier, and on an alt-az mount both
    axes turn. Without ``sky`` it is the direction of one motor.
    """

    direction: Direction
    ms: int
    sky: bool = False  # the direction is one on the sky, not a motor's


class PulseAxis(Operation[Pulsed | None], frozen=True):
    """Guide with a motor: axis 1 or 2, sense +1 or -1, for some milliseconds; rate as a fraction of sidereal."""

    display_name = "Pulse"

    axis: int  # 1 or 2
    sense: int  # of the motor, +1 or -1
    ms: int
    rate: float | None = None  # fraction of sidereal


class AbortSlew(Operation[None], frozen=True):
    """End the goto under way; motion by hand continues."""

    display_name = "End of a goto"


class SetTracking(Operation[None], frozen=True):
    """Turn tracking off, or on in ``mode``, by default the mount's own mode.

    With ``heard`` it then waits until the mount reports that it has done so, and raises Refused if it does not.
    ``code`` is the mode's number in the mount's own protocol, if the client speaks that protocol.
    """

    display_name = "Tracking"

    survives_abort = True

    on: bool
    mode: Tracking | None = None
    heard: bool = False  # check the reported mode afterwards
    code: int | None = None  # number of the mode in the mount's protocol


class TrackRate(Operation[None], frozen=True):
    """Set the drive rate: ``sidereal``, ``solar``, ``lunar``, or a multiple of sidereal."""

    display_name = "Tracking rate"

    survives_abort = True

    name: str | None = None
    factor: float | None = None  # multiple of sidereal


class Park(Operation[None], frozen=True):
    """Slew to the park position, then turn tracking off."""


class Home(Operation[None], frozen=True):
    """Slew to the stored home position."""


class SetHome(Operation[None], frozen=True):
    """Store the present position as home; a mount with index marks on its axes may turn to search for them."""

    display_name = "Home position"


class Unpark(Operation[None], frozen=True):
    """Leave the park position, and turn tracking on if possible; some drivers also read the mount's state."""

    survives_abort = True


class Hibernate(Operation[None], frozen=True):
    """End all motion, then hibernate; a mount that cannot hibernate turns tracking off."""

    survives_abort = True


class Wake(Operation[None], frozen=True):
    """Wake from hibernation; a mount that cannot hibernate turns tracking on."""

    survives_abort = True


class PassThrough(Operation[Values | None], frozen=True):
    """Pass a command to the mount unchanged; the answer is the fields of the mount's reply.

    Client and mount must speak the same protocol. ``fields`` are the values of the command's fields, in order.
    """

    display_name = "Command of the mount's own"

    command: str  # its name in commands.toml
    fields: Fields = ()


class Choose(Operation[Chosen], frozen=True):
    """Select an object of the mount's library; the answer is Chosen. The commands in ``first`` are sent before it.

    It waits for its turn among gotos and syncs, because they set the mount's only target, too. ``ra`` and ``dec`` are
    the client's present target, which stays set if no object is found.
    """

    survives_abort = True

    command: str  # its name in commands.toml
    fields: Fields = ()
    first: tuple[tuple[str, Fields], ...] = ()  # commands to send before, with their fields
    ra: float = 0.0  # of the present target
    dec: float = 0.0  # of the present target
