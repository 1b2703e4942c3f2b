"""What every operation is, what operations are given, and what a mount answers: places, times, rates, how it stands.

An operation is a frozen value, generic in what the mount answers to it: ``Operation[T]`` says by its type that
``perform`` returns a T; ``Operation`` alone is one of which that is not known.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Generic

from msgspec import Struct

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    AnswerT = TypeVar("AnswerT", covariant=True, default=object)
else:
    from typing import TypeVar  # which has no defaults before Python 3.13; they are for type checkers alone

    AnswerT = TypeVar("AnswerT", covariant=True)

#: The named values of a frame, as its fields write and read them: numbers, texts, dates.
Values = dict[str, Any]
#: The same, frozen.
Fields = tuple[tuple[str, object], ...]


class Operation(Struct, Generic[AnswerT], frozen=True):
    """Base of all operations. What ``survives_abort`` is no motion: a stop leaves it alone."""

    survives_abort: ClassVar[bool] = False


class Read(Operation[AnswerT], frozen=True):
    """Base of the operations that change nothing; ``answers`` is the struct a driver fills from reply fields."""

    answers: ClassVar[type[Struct] | None] = None


class Direction(Enum):
    """The four hand-control arrows, as seen on the sky."""

    NORTH = "n"
    SOUTH = "s"
    EAST = "e"
    WEST = "w"

    @property
    def word(self) -> str:
        """``north`` and so on, for sentences."""
        return self.name.lower()

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


class Activity(Struct, frozen=True):
    """What of a mount moves by an order of ours: a goto, an axis by hand, a guide pulse; whether it is parked, and
    whether it was sent home last and has not been moved since.

    What was asked for and has not begun counts, so that nobody sees rest between an order and its motion.
    """

    goto: bool = False
    by_hand: bool = False
    pulse: bool = False
    parked: bool = False
    homed: bool = False


class Abilities(Struct, frozen=True):
    """What a mount can do: the operations that it has a way for, by name; the speeds of its axes, degrees a second,
    each from and to; what guide pulses go at on either axis, a fraction of sidereal; whether it is a German mount,
    None where nobody knows.
    """

    can: frozenset[str] = frozenset()
    speeds: tuple[tuple[float, float], ...] = ()
    guides: tuple[float, float] = (0.0, 0.0)
    german: bool | None = None


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
