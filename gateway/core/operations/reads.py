"""Operations that read something and change nothing. In their docstrings ``->`` precedes the type of the answer."""

from __future__ import annotations

from gateway.core.operations.values import (
    Abilities,
    Activity,
    Equatorial,
    Fields,
    Gps,
    Horizontal,
    Identity,
    Moment,
    Place,
    Read,
    Status,
)


class Position(Read[Equatorial], frozen=True):
    """-> Equatorial: the position of date that the mount points at."""


class HorizontalPosition(Read[Horizontal], frozen=True):
    """-> Horizontal: where the tube points, as a fork reports it, or computed from position, site and clock."""


class AxisPosition(Read[Horizontal], frozen=True):
    """-> Horizontal: the readings of the two motor axes, whatever they point at."""


class Slewing(Read[bool], frozen=True):
    """-> bool: whether a goto is under way (never true for motion by hand)."""


class GetStatus(Read[Status], frozen=True):
    """-> Status: the mount's tracking mode and alignment."""


class GetActivity(Read[Activity], frozen=True):
    """-> Activity: the motions that this gateway has ordered. The mount is not asked."""


class GetAbilities(Read[Abilities], frozen=True):
    """-> Abilities of the mount, by its model and version."""


class TubeSide(Read[str], frozen=True):
    """-> ``"E"`` or ``"W"``: the true pier side of the tube of a German mount, whatever letter its hand control
    reports. Raises Unsupported for every other mount.
    """


class GetIdentity(Read[Identity], frozen=True):
    """-> Identity: product, model and versions of the mount."""


class GetSite(Read[Place], frozen=True):
    """-> Place: the site."""


class GetClock(Read[Moment], frozen=True):
    """-> Moment: the time and UTC offset of the mount's clock."""


class GetGps(Read[Gps], frozen=True):
    """-> Gps, from the mount's receiver. Raises Unsupported if the mount can have none, NoDevice if none replies."""


class SiderealTime(Read[float], frozen=True):
    """-> float: local apparent sidereal time, degrees. Raises Unsupported if the site is unknown."""


class PierSide(Read[str], frozen=True):
    """-> ``"E"`` or ``"W"``: the pier side as the mount reports it."""


class GuideRate(Read[float], frozen=True):
    """-> float: the autoguide rate of an axis as a fraction of sidereal."""

    axis: int


class DriveRate(Read[float], frozen=True):
    """-> float: the rate of tracking while it is on, a multiple of sidereal."""


# --- positions, calculated from site and clock ----------------------------------------------------------------


class ToEquinoxOfDate(Read[Equatorial], frozen=True):
    """-> Equatorial: a J2000 catalogue position in coordinates of date."""

    ra: float
    dec: float


class ToJ2000(Read[Equatorial], frozen=True):
    """-> Equatorial: a position of date in J2000 coordinates, those of catalogues."""

    ra: float
    dec: float


class Zenith(Read[Equatorial], frozen=True):
    """-> Equatorial: the zenith now, J2000. Raises Unsupported if the site is unknown."""


class PlanetPlace(Read[Equatorial], frozen=True):
    """-> Equatorial: a planet's position now, of date. Raises Invalid for an unknown name, Unsupported without data."""

    name: str  # English


class MoonPlace(Read[Equatorial], frozen=True):
    """-> Equatorial: the present position of a feature of the Moon, of date, seen from the site.

    ``latitude`` (north) and ``longitude`` (east) are selenographic, degrees; None is the centre of the disc. Raises
    BelowHorizon if that centre is below the horizon.
    """

    latitude: float | None = None
    longitude: float | None = None


class HomeState(Read[int], frozen=True):
    """-> int, state of the home search: 0 failed or never begun, 1 at home (or parked), 2 searching or on the way."""


class NativeRequest(Read[bytes], frozen=True):
    """A request in the client's own protocol -> bytes: the mount's reply, unchanged.

    Client and mount must speak the same protocol. ``keep`` says how long the reply is cached for all clients, and
    which setting makes it obsolete: a key of ``REUSE_DESCRIPTIONS`` (``wireformat/rows.py``), or ``dialect`` for a
    command of the mount's dialect. Raises Unsupported if the mount did not accept a value that a client has set,
    Silence if it does not reply.
    """

    command: str  # its name in commands.toml
    fields: Fields = ()
    keep: str = "state"  # how long the reply is cached
