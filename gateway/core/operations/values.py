"""The base classes of operations, and the values in them and in their answers: positions, times, rates, status.

An operation is a frozen value, generic in the type of its answer: for an ``Operation[T]`` ``perform`` returns a T; for
a plain ``Operation`` the type is not known.
"""

from __future__ import annotations

import re
from enum import Enum
from functools import cache
from math import inf, isfinite
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Generic

from msgspec import Struct

from gateway.core.errors import Invalid

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    AnswerT = TypeVar("AnswerT", covariant=True, default=object)
else:
    from typing import TypeVar  # without defaults before Python 3.13, which only type checkers need

    AnswerT = TypeVar("AnswerT", covariant=True)

#: The named field values of a frame: numbers, texts, dates.
Values = dict[str, Any]
#: Field values as a frozen tuple of (name, value).
Fields = tuple[tuple[str, object], ...]


#: Fields of operations that are numbers -> what they are called; and those that end at a pole.
NUMBER_FIELDS = {
    "ra": "right ascension", "dec": "declination", "az": "azimuth", "alt": "altitude", "latitude": "latitude",
    "longitude": "longitude", "lowest": "lowest altitude", "highest": "highest altitude", "fastest": "fastest speed",
    "unix": "time", "offset": "UTC offset", "rate": "rate", "factor": "factor", "ms": "duration",
}  # fmt: skip
DEGREE_FIELDS = ("ra", "dec", "az", "alt", "latitude", "longitude", "lowest", "highest")
POLAR_FIELDS = ("dec", "latitude")
#: Fields that have a few values only: the axis of a motor, and the sense in which it turns.
FIELD_CHOICES: dict[str, tuple[object, ...]] = {"axis": (1, 2), "sense": (1, -1)}


def _is_number(value: object, maximum: float) -> bool:
    """Whether this is a finite number, at most so large without its sign."""
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else inf
    except (OverflowError, TypeError, ValueError):  # a whole number of a thousand digits, a masked value
        return False
    return isfinite(number) and abs(number) <= maximum


class Operation(Struct, Generic[AnswerT], frozen=True):
    """Base of all operations. An operation that ``survives_abort`` is no motion: a stop leaves it alone.

    ``called`` is its name for people, if that is not the words of the class name. Raises Invalid for a number that is
    missing, not finite, or beyond a pole (``polar`` fields): nobody can order a motion to an impossible place.
    """

    polar: ClassVar[tuple[str, ...]] = POLAR_FIELDS
    survives_abort: ClassVar[bool] = False
    called: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for name, most, optional in _numbers(type(self)):
            value = getattr(self, name)
            if isinstance(value, Rate):
                value, optional = value.degrees, True
            if not (value is None and optional) and not _is_number(value, most):
                span = "" if most == inf else " from -90 to 90"
                unit = " of degrees" if name in DEGREE_FIELDS else ""
                raise Invalid(f"The {NUMBER_FIELDS[name]} must be a number{unit}{span}, not {repr(value)[:40]}.")
        for name, values in _choices(type(self)):
            if getattr(self, name) not in values:
                among = " or ".join(map(str, values))
                raise Invalid(f"The {name} must be {among}, not {repr(getattr(self, name))[:40]}.")

    @classmethod
    def title(cls) -> str:
        """Return the kind of the operation as text, to begin a line of the log: ``Goto``, ``Release of an arrow``."""
        return cls.called or re.sub("(?<=[a-z])(?=[A-Z])", " ", cls.__name__).capitalize()


def _defaults(kind: type[Operation]) -> dict[str, object]:
    return dict(zip(reversed(kind.__struct_fields__), reversed(kind.__struct_defaults__), strict=False))


@cache
def _numbers(kind: type[Operation]) -> tuple[tuple[str, float, bool], ...]:
    """Return the numbers among the fields of an operation: name, largest value, and whether None may stand for it."""
    without = _defaults(kind)
    return tuple(
        (name, 90.0 if name in kind.polar else inf, without.get(name, 0.0) is None)
        for name in kind.__struct_fields__
        if name in NUMBER_FIELDS
    )


@cache
def _choices(kind: type[Operation]) -> tuple[tuple[str, tuple[object, ...]], ...]:
    """Return the fields of an operation that have only a few values, and these values; a default is one of them."""
    without = _defaults(kind)
    return tuple(
        (name, (*FIELD_CHOICES[name], without[name]) if name in without else FIELD_CHOICES[name])
        for name in kind.__struct_fields__
        if name in FIELD_CHOICES
    )


class Read(Operation[AnswerT], frozen=True):
    """Base of the operations that change nothing."""


class Direction(Enum):
    """The four hand-control arrows, as seen on the sky."""

    NORTH = "n"
    SOUTH = "s"
    EAST = "e"
    WEST = "w"

    @property
    def word(self) -> str:
        """The name for sentences: ``north`` and so on."""
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
    """The mount's tracking mode."""

    OFF = "off"
    ALTAZ = "alt-az"
    EQ_NORTH = "eq-north"
    EQ_SOUTH = "eq-south"

    @property
    def equatorial(self) -> bool:
        return self in (Tracking.EQ_NORTH, Tracking.EQ_SOUTH)


class Rate(Struct, frozen=True):
    """A hand rate: a name (guide, center, find, max), a hand-control key 1-9, or degrees/s.

    ``max`` with ``degrees`` is the fastest rate up to that many degrees/s. Raises Invalid for another name or key.
    """

    name: str | None = None
    key: int | None = None
    degrees: float | None = None

    def __post_init__(self) -> None:
        if self.name not in (None, "guide", "center", "find", "max"):
            raise Invalid(f"The rate must be guide, center, find or max, not {repr(self.name)[:40]}.")
        if self.key is not None and self.key not in range(1, 10):
            raise Invalid(f"The key of a rate must be 1 to 9, not {repr(self.key)[:40]}.")


class Equatorial(Struct, frozen=True):
    """A position on the sky: right ascension and declination in degrees."""

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

    ``dst`` are the hours of daylight saving in the offset, 0 or 1; None if unknown.
    """

    unix: float
    offset: float
    dst: int | None = None


class Gps(Struct, frozen=True):
    """The report of a GPS receiver: whether it has a fix (``linked``), and if so its site and UTC as Unix seconds."""

    linked: bool
    place: Place | None = None
    unix: float = 0.0


class Status(Struct, frozen=True):
    """The state of the mount: its tracking mode, whether it is aligned, whether it is ``equatorial``.

    ``wedge``: it is a fork on a wedge, its first axis reads from north; in other equatorial mounts, the hour angle.
    ``code``: the number that the mount itself gives to the mode in which it tracks, if it gives any.
    """

    tracking: Tracking
    aligned: bool
    equatorial: bool
    wedge: bool = False
    code: int | None = None


class Activity(Struct, frozen=True):
    """The motion of a mount by orders of this gateway: a goto, an axis by hand, a guide pulse; whether it is parked,
    and whether it was sent home last and not moved since. ``short`` is why the last goto ended before its goal.

    A pending order counts, so that no client sees the mount at rest between an order and its motion. ``ends``: a motion
    has ended, and the position does not show the mount at rest yet. ``unknown``: the mount has reported no position for
    so long that nobody knows whether it moves.
    """

    goto: bool = False
    by_hand: bool = False
    pulse: bool = False
    ends: bool = False
    unknown: bool = False
    parked: bool = False
    homed: bool = False
    short: str = ""


class Abilities(Struct, frozen=True):
    """The abilities of a mount: the names of the operations that it ``can`` carry out; the ``speeds`` of its axes as
    ranges (from, to) in degrees a second; guide rates as fractions of sidereal; if German, None if unknown.
    """

    can: frozenset[str] = frozenset()
    speeds: tuple[tuple[float, float], ...] = ()
    guides: tuple[float, float] = (0.0, 0.0)
    german: bool | None = None


class Identity(Struct, frozen=True):
    """The identity of the mount: product, version, model and motor versions as text."""

    product: str
    version: str
    model: str
    motors: tuple[str, ...] = ()


class Chosen(Struct, frozen=True):
    """An object found in the mount's own library: its position, the mount's text about it, and the raw reply, if any.

    ``place`` is None if no object was found.
    """

    place: Equatorial | None
    text: str = ""
    reply: bytes = b""


class Pulsed(Struct, frozen=True):
    """A guide pulse began: seconds until its end, whether the motor ``ends`` it, milliseconds ``left`` to send.

    ``since`` is the loop time from which the seconds count; None is now.
    """

    seconds: float
    ends: bool
    left: int = 0
    since: float | None = None
