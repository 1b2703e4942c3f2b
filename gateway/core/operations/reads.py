"""Operations that ask for something and change nothing."""

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

    answers = Equatorial


class HorizontalPosition(Read[Horizontal], frozen=True):
    """-> Horizontal: a fork's own answer, or derived from right ascension, declination, site and clock."""

    answers = Horizontal


class AxisPosition(Read[Horizontal], frozen=True):
    """-> Horizontal: where the two motor axes stand, whatever they point at."""

    answers = Horizontal


class Slewing(Read[bool], frozen=True):
    """-> bool: a goto is under way (never true for hand-rate motion)."""


class GetStatus(Read[Status], frozen=True):
    """-> Status."""


class GetActivity(Read[Activity], frozen=True):
    """-> Activity, which the gateway knows without asking the mount."""


class GetAbilities(Read[Abilities], frozen=True):
    """-> Abilities, once the mount has said what it is."""


class TubeSide(Read[str], frozen=True):
    """-> ``"E"`` or ``"W"``: the side on which the tube of a German mount really is, whatever letter its hand control
    tells. Raises Unsupported for every other mount."""


class GetIdentity(Read[Identity], frozen=True):
    """-> Identity."""


class GetSite(Read[Place], frozen=True):
    """-> Place."""


class GetClock(Read[Moment], frozen=True):
    """-> Moment."""


class GetGps(Read[Gps], frozen=True):
    """-> Gps, of the receiver that the mount carries. Raises Unsupported, NoDevice."""


class SiderealTime(Read[float], frozen=True):
    """-> float: local apparent sidereal time, degrees."""


class PierSide(Read[str], frozen=True):
    """-> ``"E"`` or ``"W"``: the side of the pier the tube is on."""


class GuideRate(Read[float], frozen=True):
    """-> float: autoguide rate of an axis as a fraction of sidereal."""

    axis: int


class DriveRate(Read[float], frozen=True):
    """-> float: the rate that it tracks at whenever it tracks, a multiple of sidereal."""


# --- places, worked out from site and clock -------------------------------------------------------------------


class ToEquinoxOfDate(Read[Equatorial], frozen=True):
    """-> Equatorial: a J2000 catalogue place as coordinates of date."""

    ra: float
    dec: float


class ToJ2000(Read[Equatorial], frozen=True):
    """-> Equatorial: a place of date as J2000, which is how catalogues count."""

    ra: float
    dec: float


class Zenith(Read[Equatorial], frozen=True):
    """-> Equatorial: what stands in the zenith now, J2000. Raises Unsupported where the site is unknown."""


class PlanetPlace(Read[Equatorial], frozen=True):
    """-> Equatorial: where a planet stands now, of date; ``name`` in English. Raises Unsupported."""

    name: str


class MoonPlace(Read[Equatorial], frozen=True):
    """-> Equatorial: where a place on the Moon stands now, of date, seen from the site. Raises BelowHorizon.

    Selenographic latitude (north) and longitude (east), degrees; None for the middle of the disc.
    """

    latitude: float | None = None
    longitude: float | None = None


class HomeState(Read[int], frozen=True):
    """-> int: 0 failed or never searched, 1 at home (or parked), 2 on the way."""


class Own(Read[bytes], frozen=True):
    """A question of the client's own protocol -> bytes: what the mount itself answers, as it writes it.

    Only where client and mount speak the same protocol. ``fields`` are the request's, ``keep`` says how long an answer
    serves everybody and what stands against it (``KEEPS``, ``wireformat/rows.py``). Raises Unsupported where the
    gateway has told something else meanwhile, Silence where the mount does not answer to it.
    """

    command: str
    fields: Fields = ()
    keep: str = "state"
