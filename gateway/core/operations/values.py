"""The base classes of operations, and the values in them and in their answers: positions, times, rates, status.

An operation is a frozen value, generic in the type of its answer: ``perform`` returns a T for an ``Operation[T]``.
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

#: Field name -> value in a command or a reply: numbers, texts, dates.
Values = dict[str, Any]
#: Field values as a frozen tuple of (name, value).
Fields = tuple[tuple[str, object], ...]


#: Fields of operations that are numbers -> their name in messages.
NUMBER_FIELDS = {
    "ra": "right ascension", "dec": "declination", "az": "azimuth", "alt": "altitude", "latitude": "latitude",
    "longitude": "longitude", "lowest": "lowest altitude", "highest": "highest altitude", "fastest": "fastest speed",
    "unix": "time", "offset": "UTC offset", "rate": "rate", "factor": "factor", "ms": "duration",
}  # fmt: skip
#: Fields of operations in degrees, and those of them that are limited to -90 to 90.
DEGREE_FIELDS = ("ra", "dec", "az", "alt", "latitude", "longitude", "lowest", "highest")
POLAR_FIELDS = ("dec", "latitude")
#: Field with few possible values -> these values: the axis of a motor, and the sense in which it turns.
CHOICES_BY_FIELD: dict[str, tuple[object, ...]] = {"axis": (1, 2), "sense": (1, -1)}


def _is_number(value: object, maximum: float) -> bool:
    """Whether this is a finite number with an absolute value of at most ``maximum``."""
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else inf
    except (OverflowError, TypeError, ValueError):  # a whole number of a thousand digits, a masked value
        return False
    return isfinite(number) and abs(number) <= maximum


class Operation(Struct, Generic[AnswerT], frozen=True):
    """Base of all operations. A stop does not cancel an operation that ``survives_abort``, because it is no motion.

    ``display_name`` is its name in messages, if it differs from the words of the class name. Raises Invalid for a
    number that is missing or not finite, a ``polar_fields`` field beyond a pole, and an invalid ``axis`` or ``sense``.
    """

    polar_fields: ClassVar[tuple[str, ...]] = POLAR_FIELDS
    survives_abort: ClassVar[bool] = False
    display_name: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for name, most, optional in _number_fields(type(self)):
            value = getattr(self, name)
            if isinstance(value, Rate):
                value, optional = value.degrees, True
            if not (value is None and optional) and not _is_number(value, most):
                span = "" if most == inf else " from -90 to 90"
                unit = " of degrees" if name in DEGREE_FIELDS else ""
                raise Invalid(f"The {NUMBER_FIELDS[name]} must be a number{unit}{span}, not {repr(value)[:40]}.")
        for name, values in _choice_fields(type(self)):
            if getattr(self, name) not in values:
                among = " or ".join(map(str, values))
                raise Invalid(f"The {name} must be {among}, not {repr(getattr(self, name))[:40]}.")

    @classmethod
    def title(cls) -> str:
        """Return the name of the operation in messages and in the log: ``Goto``, ``Release of an arrow``."""
        return cls.display_name or re.sub("(?<=[a-z])(?=[A-Z])", " ", cls.__name__).capitalize()


def _field_defaults(kind: type[Operation]) -> dict[str, object]:
    return dict(zip(reversed(kind.__struct_fields__), reversed(kind.__struct_defaults__), strict=False))


@cache
def _number_fields(kind: type[Operation]) -> tuple[tuple[str, float, bool], ...]:
    """Return the number fields of an operation: name, maximum of the absolute value, and whether None is allowed."""
    without = _field_defaults(kind)
    return tuple(
        (name, 90.0 if name in kind.polar_fields else inf, without.get(name, 0.0) is None)
        for name in kind.__struct_fields__
        if name in NUMBER_FIELDS
    )


@cache
def _choice_fields(kind: type[Operation]) -> tuple[tuple[str, tuple[object, ...]], ...]:
    """Return the fields of an operation that have only a few possible values, with these values and the default."""
    without = _field_defaults(kind)
    return tuple(
        (name, (*CHOICES_BY_FIELD[name], without[name]) if name in without else CHOICES_BY_FIELD[name])
        for name in kind.__struct_fields__
        if name in CHOICES_BY_FIELD
    )


class Read(Operation[AnswerT], frozen=True):
    """Base of the operations that read something and change nothing."""


class Direction(Enum):
    """The four hand-control arrows, as seen on the sky."""

    NORTH = "n"
    SOUTH = "s"
    EAST = "e"
    WEST = "w"

    @property
    def label(self) -> str:
        """The name in messages: ``north``, ``south``, ``east`` or ``west``."""
        return self.name.lower()

    @property
    def axis(self) -> int:
        """The axis that the arrow turns: 1 = right ascension or azimuth, 2 = declination or altitude."""
        return 2 if self in (Direction.NORTH, Direction.SOUTH) else 1

    @property
    def sense(self) -> int:
        """The sense in which the arrow turns its axis: +1 = west or north, -1 = east or south."""
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
    """A hand rate: a name (guide, center, find, max), a hand-control key 1-9, or degrees/s. ``max`` with ``degrees`` is
    the fastest rate up to that many degrees/s. Raises Invalid for another name or key.
    """

    name: str | None = None
    key: int | None = None  # of the hand control, 1 (slowest) to 9
    degrees: float | None = None  # degrees a second

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

    unix: float  # UTC, Unix seconds
    offset: float  # local minus UTC, hours
    dst: int | None = None  # hours of daylight saving in the offset


class Gps(Struct, frozen=True):
    """The report of a GPS receiver: whether it has a fix (``linked``), and if so its site and UTC as Unix seconds."""

    linked: bool  # has a fix
    place: Place | None = None
    unix: float = 0.0


class Status(Struct, frozen=True):
    """The state of the mount: its tracking mode, whether it is aligned, whether it is ``equatorial``.

    ``wedge``: it is a fork on a wedge. Its first axis reads an angle from north; that of other equatorial mounts reads
    the hour angle. ``code``: the number of the tracking mode in the mount's protocol, if the mount reports one.
    """

    tracking: Tracking
    aligned: bool
    equatorial: bool
    wedge: bool = False  # a fork on a wedge
    code: int | None = None  # the mount's number of its tracking mode


class Activity(Struct, frozen=True):
    """The motions of a mount that this gateway has ordered: a goto, an axis by hand, a guide pulse; whether the mount
    is parked, and whether it is still at the home position to which it was sent (``homed``).

    A pending order counts as a motion. ``ends``: a motion was stopped, and the positions do not show the mount at rest
    yet. ``unknown``: the mount has reported no position for so long that its motion is not known. ``short``: why the
    last goto ended before its target.
    """

    goto: bool = False
    by_hand: bool = False
    pulse: bool = False  # a guide pulse
    ends: bool = False  # stopped, not at rest yet
    unknown: bool = False  # no position for too long
    parked: bool = False
    homed: bool = False
    short: str = ""  # why the last goto ended before its target


class Abilities(Struct, frozen=True):
    """The abilities of a mount: the names of the operations that it ``can`` carry out; the ``speeds`` of its axes as
    ranges (from, to) in degrees a second; its guide rates as fractions of sidereal; whether it is a German mount.
    """

    can: frozenset[str] = frozenset()  # names of operations
    speeds: tuple[tuple[float, float], ...] = ()  # of an axis: (from, to), degrees a second
    guides: tuple[float, float] = (0.0, 0.0)  # guide rates of axis 1 and 2, fractions of sidereal
    german: bool | None = None  # None: unknown


class Identity(Struct, frozen=True):
    """The identity of the mount: product, version, model and motor versions as text."""

    product: str
    version: str
    model: str
    motors: tuple[str, ...] = ()  # versions of the motor controllers


class Chosen(Struct, frozen=True):
    """An object of the mount's own library: its position (None if none was found), the mount's text, the raw reply."""

    place: Equatorial | None  # its position
    text: str = ""
    reply: bytes = b""


class Pulsed(Struct, frozen=True):
    """A guide pulse began: it lasts ``seconds`` from ``since``, a time of the event loop (None: from now).

    ``ends``: the motor ends the pulse by itself. ``left``: the milliseconds for which further pulses must be sent.
    """

    seconds: float
    ends: bool  # by itself
    left: int = 0  # milliseconds still to be sent
    since: float | None = None  # time of the event loop
