"""The canonical mount: everything that can be meant, as values.

A surface yields these, a driver carries them out; neither knows the other. They are frozen, so they can be
logged, compared, replayed and named in a table. Angles are degrees, right ascension included; right ascension
and declination are of date (JNow) unless an endpoint is set to J2000; longitude counts EAST positive, a UTC
offset is local minus UTC in hours. Motion comes in two kinds: *sky* (``Move``) and *axis* (``MoveAxis``).
"""

from __future__ import annotations

from enum import Enum
from typing import Any, ClassVar

from msgspec import Struct


class Operation(Struct, frozen=True):
    """Base of all operations. What ``outlives_stop`` is no motion: a stop leaves it alone."""

    outlives_stop: ClassVar[bool] = False


class Direction(Enum):
    """The four hand-control arrows, as seen on the sky."""

    NORTH = "n"
    SOUTH = "s"
    EAST = "e"
    WEST = "w"

    @property
    def axis(self) -> int:
        """1 = right ascension / azimuth, 2 = declination / altitude."""
        return 2 if self in (Direction.NORTH, Direction.SOUTH) else 1

    @property
    def sense(self) -> int:
        """+1 = west or north, -1 = east or south."""
        return 1 if self in (Direction.NORTH, Direction.WEST) else -1


class Tracking(Enum):
    """What the mount does when nobody moves it."""

    OFF = "off"
    ALTAZ = "alt-az"
    EQ_NORTH = "eq-north"
    EQ_SOUTH = "eq-south"

    @property
    def equatorial(self) -> bool:
        return self in (Tracking.EQ_NORTH, Tracking.EQ_SOUTH)


class Rate(Struct, frozen=True):
    """A hand rate: a name (guide, center, find, max), a hand-control key 1-9, or degrees/s.

    ``max`` together with degrees is the fastest rate, limited to so many.
    """

    name: str | None = None
    key: int | None = None
    degrees: float | None = None


# --- what a mount answers -------------------------------------------------------------------------------------


class Equatorial(Struct, frozen=True):
    """A place on the sky: right ascension and declination in degrees."""

    ra: float
    dec: float


class Horizontal(Struct, frozen=True):
    """Azimuth from north through east and altitude, degrees."""

    az: float
    alt: float


class Place(Struct, frozen=True):
    """A site: latitude north positive, longitude east positive, degrees."""

    latitude: float
    longitude: float


class Moment(Struct, frozen=True):
    """A clock reading: UTC as Unix seconds and the mount's own offset (local minus UTC, hours, DST counted).

    ``dst`` are the hours of daylight saving in it, 0 or 1; None where nobody tells.
    """

    unix: float
    offset: float
    dst: int | None = None


class Gps(Struct, frozen=True):
    """What a GPS receiver tells: whether it has a fix; place, and UTC as Unix seconds, with one."""

    linked: bool
    place: Place | None = None
    unix: float = 0.0


class Status(Struct, frozen=True):
    """How the mount stands: its tracking mode, whether it is aligned, and how it is built.

    ``wedge``: it is a fork on one, and its axes read from north; those of other equatorial mounts read the hour angle.
    """

    tracking: Tracking
    aligned: bool
    equatorial: bool
    wedge: bool = False


class Identity(Struct, frozen=True):
    """Who the mount is, in words and numbers."""

    product: str
    version: str
    model: str
    motors: tuple[str, ...] = ()


class Chosen(Struct, frozen=True):
    """What the mount's own library has found: its place, what the mount calls it, and its reply, if there was one.

    ``place`` is None where nothing was found.
    """

    place: Equatorial | None
    text: str = ""
    reply: bytes = b""


class Pulsed(Struct, frozen=True):
    """A guide pulse was begun: seconds until it is over, whether the motor ``ends`` it by itself, milliseconds left."""

    seconds: float
    ends: bool
    left: int = 0


# --- reads ----------------------------------------------------------------------------------------------------


class Read(Operation, frozen=True):
    """Base of the operations that change nothing; ``answers`` is the struct a driver fills from reply fields."""

    answers: ClassVar[type[Struct] | None] = None


class Position(Read, frozen=True):
    """-> Equatorial."""

    answers = Equatorial


class HorizontalPosition(Read, frozen=True):
    """-> Horizontal: a fork's own answer, or derived from right ascension, declination, site and clock."""

    answers = Horizontal


class AxisPosition(Read, frozen=True):
    """-> Horizontal: where the two motor axes stand, whatever they point at."""

    answers = Horizontal


class Slewing(Read, frozen=True):
    """-> bool: a goto is under way (never true for hand-rate motion)."""


class GetStatus(Read, frozen=True):
    """-> Status."""


class GetIdentity(Read, frozen=True):
    """-> Identity."""


class GetSite(Read, frozen=True):
    """-> Place."""


class GetClock(Read, frozen=True):
    """-> Moment."""


class GetGps(Read, frozen=True):
    """-> Gps, of the receiver that the mount carries. Raises Unsupported, NoDevice."""


class SiderealTime(Read, frozen=True):
    """-> float: local apparent sidereal time, degrees."""


class PierSide(Read, frozen=True):
    """-> ``"E"`` or ``"W"``: the side of the pier the tube is on."""


class GuideRate(Read, frozen=True):
    """-> float: autoguide rate of an axis as a fraction of sidereal."""

    axis: int


class DriveRate(Read, frozen=True):
    """-> float: the rate that it tracks at whenever it tracks, a multiple of sidereal."""


# --- places, worked out from site and clock -------------------------------------------------------------------


class OfDate(Read, frozen=True):
    """-> Equatorial: a J2000 catalogue place as coordinates of date."""

    ra: float
    dec: float


class OfCatalog(Read, frozen=True):
    """-> Equatorial: a place of date as J2000, which is how catalogues count."""

    ra: float
    dec: float


class Zenith(Read, frozen=True):
    """-> Equatorial: what stands in the zenith now, J2000. Raises Unsupported where the site is unknown."""


class PlanetPlace(Read, frozen=True):
    """-> Equatorial: where a planet stands now, of date; ``name`` in English. Raises Unsupported."""

    name: str


class MoonPlace(Read, frozen=True):
    """-> Equatorial: where a place on the Moon stands now, of date, seen from the site. Raises BelowHorizon.

    Selenographic latitude (north) and longitude (east), degrees; None for the middle of the disc.
    """

    latitude: float | None = None
    longitude: float | None = None


# --- motion ---------------------------------------------------------------------------------------------------


class Goto(Operation, frozen=True):
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


class GotoHorizontal(Operation, frozen=True):
    """Slew to an azimuth and altitude, degrees; the rest as in ``Goto``."""

    az: float
    alt: float
    lowest: float | None = None
    highest: float | None = None
    fastest: float | None = None


class GotoAxes(Operation, frozen=True):
    """Bring both motor axes to these readings, degrees (a horizon place only on a fork); ``fastest`` as in ``Goto``."""

    az: float
    alt: float
    fastest: float | None = None


class Sync(Operation, frozen=True):
    """The mount points at this place of date now. Raises SyncTooFar, NoAnswer."""

    ra: float
    dec: float


class Move(Operation, frozen=True):
    """Start moving in a sky direction at a hand rate, until halted.

    ``lowest`` and ``highest`` narrow the altitude limits while it lasts.
    """

    direction: Direction
    rate: Rate
    lowest: float | None = None
    highest: float | None = None

    @property
    def axis(self) -> int:
        """That of its direction."""
        return self.direction.axis

    @property
    def sense(self) -> int:
        """That of its direction."""
        return self.direction.sense


class MoveAxis(Operation, frozen=True):
    """Start turning a motor: axis 1 or 2, sense +1 or -1, at a hand rate, until halted."""

    axis: int
    sense: int
    rate: Rate


class Halt(Operation, frozen=True):
    """End the motion of one axis (1 or 2)."""

    axis: int


class Stop(Operation, frozen=True):
    """End every motion and goto; tracking stays as it was."""


class Pulse(Operation, frozen=True):
    """Guide in a direction for some milliseconds."""

    direction: Direction
    ms: int


class PulseAxis(Operation, frozen=True):
    """Guide with a motor: axis 1 or 2, sense +1 or -1, for some milliseconds; rate as a fraction of sidereal."""

    axis: int
    sense: int
    ms: int
    rate: float | None = None


class CancelGoto(Operation, frozen=True):
    """End the goto under way; hand motion goes on."""


class SetTracking(Operation, frozen=True):
    """Tracking on in the mount's own mode, or in the one named, or off."""

    outlives_stop = True

    on: bool
    mode: Tracking | None = None


class TrackRate(Operation, frozen=True):
    """A drive rate: ``sidereal``, ``solar``, ``lunar``, or a multiple of sidereal."""

    outlives_stop = True

    name: str | None = None
    factor: float | None = None


class Park(Operation, frozen=True):
    """Go to the park position, then tracking off."""


class Home(Operation, frozen=True):
    """Go to the stored home position."""


class SetHome(Operation, frozen=True):
    """The present position is home; a mount with marks on its axes may turn to look for them."""


class HomeState(Read, frozen=True):
    """-> int: 0 failed or never searched, 1 at home (or parked), 2 on the way."""


class Unpark(Operation, frozen=True):
    """Take up service again: tracking on, the mount's state read anew."""

    outlives_stop = True


class Sleep(Operation, frozen=True):
    """Hibernate, or tracking off where the mount cannot; whatever moves is ended before."""

    outlives_stop = True


class Wake(Operation, frozen=True):
    """Wake up, or tracking on where the mount cannot hibernate."""

    outlives_stop = True


class Verbatim(Operation, frozen=True):
    """A command of the mount's own protocol that means nothing here -> the reply's fields.

    Only where client and mount speak the same protocol. ``fields`` are the request's field values, in order.
    """

    command: str
    fields: tuple[tuple[str, Any], ...] = ()


class Own(Read, frozen=True):
    """A question of the client's own protocol -> bytes: what the mount itself answers, as it writes it.

    Only where client and mount speak the same protocol. ``fields`` are the request's, ``keep`` says how long an answer
    serves everybody and what stands against it (``KEEPS``, ``wireformat/rows.py``). Raises Unsupported where the
    gateway has told something else meanwhile, Silence where the mount does not answer to it.
    """

    command: str
    fields: tuple[tuple[str, Any], ...] = ()
    keep: str = "state"


class Choose(Operation, frozen=True):
    """An object of the mount's own library -> Chosen. ``first`` are commands that its number depends on.

    No motion, but carried out among them: the mount has one target, and gotos and syncs set it, too.

    ``ra`` and ``dec`` are the target so far, which stays where nothing is found.
    """

    outlives_stop = True

    command: str
    fields: tuple[tuple[str, Any], ...] = ()
    first: tuple[tuple[str, tuple[tuple[str, Any], ...]], ...] = ()
    ra: float = 0.0
    dec: float = 0.0


# --- settings -------------------------------------------------------------------------------------------------


class SetSite(Operation, frozen=True):
    """Latitude and/or longitude (east positive) in degrees; None keeps what is there.

    With ``others`` the mount's own site counts again, whatever programs have set: it is told the latitude and longitude
    given here only where it has one of the others by us, or tells none at all.
    """

    latitude: float | None = None
    longitude: float | None = None
    others: tuple[SetSite, ...] | None = None


class SetClock(Operation, frozen=True):
    """UTC as Unix seconds and the offset local minus UTC in hours; ``dst`` hours of it are daylight saving, if told."""

    unix: float
    offset: float
    dst: int | None = None


class ClockFromGps(Operation, frozen=True):
    """Set the mount's clock from its GPS unit. Raises NoDevice when there is none or it is not linked."""


class SetGuideRate(Operation, frozen=True):
    """Autoguide rate of an axis as a fraction of sidereal."""

    axis: int
    rate: float


class Backlash(Operation, frozen=True):
    """Antibacklash of an axis, 0-99: in one sense of its motor (1, -1), or in both (0)."""

    axis: int
    value: int
    sense: int = 0


class PeriodicError(Operation, frozen=True):
    """Periodic error correction on, off, or the other way round (None), on one axis or both (None)."""

    axis: int | None = None
    on: bool | None = None


class Focus(Operation, frozen=True):
    """Move the focuser: +1 in, -1 out, 0 halt; speed 1-4."""

    direction: int
    speed: int = 2


def named(name: str) -> type[Operation] | None:
    """The operation class of that name, or None."""
    found: Any = globals().get(name)
    if isinstance(found, type) and issubclass(found, Operation) and found not in (Operation, Read):
        return found
    return None
