"""Operations that move the mount, end its motion, or change where it believes to point."""

from __future__ import annotations

from gateway.core.operations.values import Chosen, Direction, Fields, Operation, Pulsed, Rate, Tracking, Values


class Goto(Operation[None], frozen=True):
    """Slew to a place of date and track there. Raises BelowHorizon, TooHigh, NearSun, NotAligned, NoAnswer.

    ``lowest`` and ``highest`` narrow the altitude limits; without ``track`` a stopped drive stays stopped. ``fastest``
    is the speed asked for, degrees a second, where the mount lets it be chosen.
    """

    ra: float
    dec: float
    lowest: float | None = None
    highest: float | None = None
    track: bool = True
    fastest: float | None = None


class GotoHorizontal(Operation[None], frozen=True):
    """Slew to an azimuth and altitude, degrees; the rest as in ``Goto``."""

    az: float
    alt: float
    lowest: float | None = None
    highest: float | None = None
    fastest: float | None = None


class GotoAxes(Operation[None], frozen=True):
    """Bring both motor axes to these readings, degrees (a horizon place only on a fork); ``fastest`` as in ``Goto``."""

    az: float
    alt: float
    fastest: float | None = None


class Sync(Operation[None], frozen=True):
    """The mount points at this place of date now. Raises SyncTooFar, NoAnswer."""

    ra: float
    dec: float


class Move(Operation[None], frozen=True):
    """Start moving in a sky direction at a hand rate, until halted.

    ``lowest`` and ``highest`` narrow the altitude limits while it lasts.
    """

    direction: Direction
    rate: Rate
    lowest: float | None = None
    highest: float | None = None

    @property
    def axis(self) -> int:
        return self.direction.axis

    @property
    def sense(self) -> int:
        return self.direction.sense


class MoveAxis(Operation[None], frozen=True):
    """Start turning a motor: axis 1 or 2, sense +1 or -1, at a hand rate, until halted."""

    axis: int
    sense: int
    rate: Rate


class StopAxis(Operation[None], frozen=True):
    """End the motion of one axis (1 or 2)."""

    axis: int


class AbortMotion(Operation[None], frozen=True):
    """End every motion and goto; tracking stays as it was."""


class Pulse(Operation[Pulsed | None], frozen=True):
    """Guide in a direction for some milliseconds."""

    direction: Direction
    ms: int


class PulseAxis(Operation[Pulsed | None], frozen=True):
    """Guide with a motor: axis 1 or 2, sense +1 or -1, for some milliseconds; rate as a fraction of sidereal."""

    axis: int
    sense: int
    ms: int
    rate: float | None = None


class AbortSlew(Operation[None], frozen=True):
    """End the goto under way; hand motion goes on."""


class SetTracking(Operation[None], frozen=True):
    """Tracking on in the mount's own mode, or in the one named, or off."""

    survives_abort = True

    on: bool
    mode: Tracking | None = None


class TrackRate(Operation[None], frozen=True):
    """A drive rate: ``sidereal``, ``solar``, ``lunar``, or a multiple of sidereal."""

    survives_abort = True

    name: str | None = None
    factor: float | None = None


class Park(Operation[None], frozen=True):
    """Go to the park position, then tracking off."""


class Home(Operation[None], frozen=True):
    """Go to the stored home position."""


class SetHome(Operation[None], frozen=True):
    """The present position is home; a mount with marks on its axes may turn to look for them."""


class Unpark(Operation[None], frozen=True):
    """Take up service again: tracking on, the mount's state read anew."""

    survives_abort = True


class Hibernate(Operation[None], frozen=True):
    """Hibernate, or tracking off where the mount cannot; whatever moves is ended before."""

    survives_abort = True


class Wake(Operation[None], frozen=True):
    """Wake up, or tracking on where the mount cannot hibernate."""

    survives_abort = True


class PassThrough(Operation[Values | None], frozen=True):
    """A command of the mount's own protocol that means nothing here -> the reply's fields.

    Only where client and mount speak the same protocol. ``fields`` are the request's field values, in order.
    """

    command: str
    fields: Fields = ()


class Choose(Operation[Chosen], frozen=True):
    """An object of the mount's own library -> Chosen. ``first`` are commands that its number depends on.

    No motion, but carried out among them: the mount has one target, and gotos and syncs set it, too.

    ``ra`` and ``dec`` are the target so far, which stays where nothing is found.
    """

    survives_abort = True

    command: str
    fields: Fields = ()
    first: tuple[tuple[str, Fields], ...] = ()
    ra: float = 0.0
    dec: float = 0.0
