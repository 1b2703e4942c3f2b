"""Operations that read something and change nothing. The arrow names the type of the answer."""

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
    """-> Equatorial."""


class HorizontalPosition(Read[Horizontal], frozen=True):
    """-> Horizontal, as a fork reports it, or calculated from right ascension, declination, site and clock."""


class AxisPosition(Read[Horizontal], frozen=True):
    """-> Horizontal: the readings of the two motor axes, whatever they point at."""


class Slewing(Read[bool], frozen=True):
    """-> bool: whether a goto is under way (never true for motion by hand)."""


class GetStatus(Read[Status], frozen=True):
    """-> Status."""


class GetActivity(Read[Activity], frozen=True):
    """-> Activity, which needs no request to the mount."""


class GetAbilities(Read[Abilities], frozen=True):
    """-> Abilities, after the mount was identified."""


class TubeSide(Read[str], frozen=True):
    """-> ``"E"`` or ``"W"``: the true pier side of the tube of a German mount, whatever letter its hand control
    reports. Raises Unsupported for every other mount.
    """


class GetIdentity(Read[Identity], frozen=True):
    """-> Identity."""


class GetSite(Read[Place], frozen=True):
    """-> Place."""


class GetClock(Read[Moment], frozen=True):
    """-> Moment."""


class GetGps(Read[Gps], frozen=True):
    """-> Gps, from the receiver of the mount. Raises Unsupported, NoDevice."""


class SiderealTime(Read[float], frozen=True):
    """-> float: local apparent sidereal time, degrees."""


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
    """-> Equatorial: the present position of a planet, of date; ``name`` is in English. Raises Unsupported."""

    name: str


class MoonPlace(Read[Equatorial], frozen=True):
    """-> Equatorial: the present position of a feature of the Moon, of date, seen from the site. Raises BelowHorizon.

    ``latitude`` (north) and ``longitude`` (east) are selenographic, degrees; None is the centre of the disc.
    """

    latitude: float | None = None
    longitude: float | None = None


class HomeState(Read[int], frozen=True):
    """-> int: 0 failed or never searched, 1 at home (or parked), 2 searching or on the way."""


class NativeRequest(Read[bytes], frozen=True):
    """A request in the client's own protocol -> bytes: the mount's reply, unchanged.

    Only if client and mount speak the same protocol. ``fields`` are those of the request. ``keep`` says how long all
    clients share a reply, and which setting overrides it (``KEEPS``, ``wireformat/rows.py``), or ``dialect`` for a
    command of the mount's dialect. Raises Unsupported if a client has set another value that the mount did not take,
    Silence if the mount does not reply.
    """

    command: str
    fields: Fields = ()
    keep: str = "state"
