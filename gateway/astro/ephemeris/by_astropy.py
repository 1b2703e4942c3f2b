"""Day tables of the sky, and sites in decimals, calculated by astropy. The import takes half a second and 45 MB: no
process that serves does it, only one of its own (``mount-gateway almanac``), replays and tests.

`Time` counts the leap seconds, `GCRS` and `TETE` convert J2000 to the equinox of date, `get_sun` and
`get_body_barycentric` give Sun, Moon and planets (ephemeris "builtin": nothing is downloaded). UT1-UTC comes from the
file finals2000A.all of the IERS, which is installed with astropy and contains a year of predictions. astropy's own
reader needs 100 MB for the whole file; this module gives it a table of that one column, without polar motion (0.6"),
which is not needed here.
Errors, against Skyfield and JPL's DE421: sidereal time 5 ms, axes 1 mas, Sun 0.03", Moon 3" rms and 19" at worst;
before 1972 another 0.1" and 1.5", because TT-UT1 is interpolated between observed values.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable
from functools import cache, lru_cache
from importlib.metadata import version
from typing import Any

import astropy_iers_data  # type: ignore[import-untyped]
import erfa
import numpy as np
from astropy import units as u
from astropy.coordinates import GCRS, TETE, CartesianRepresentation, Latitude, Longitude, get_body_barycentric, get_sun
from astropy.time import Time
from astropy.utils import iers
from astropy.utils.iers import IERS

from gateway.astro.ephemeris.almanac import Almanac, rows_of
from gateway.astro.ephemeris.day_table import DAY, PARTS, ROWS, STEP, DayTable
from gateway.astro.spherical import SIDEREAL_RATE

JD_OF_UNIX_EPOCH = 2440587.5
_UNIX_AT_1972 = 63072000.0
_SECONDS = np.arange(ROWS) * STEP
_LIGHT = 299792.458  # km a second
# Before 1972 Unix time is taken as UT1. TT-UT1 in seconds every fifth year from 1900 on (Astronomical Almanac,
# "Reduction of time scales"), continuous with the first leap seconds; linear interpolation is within two seconds, 1" of
# the Moon.
_OBSERVED = [*(np.arange(15) * 5.0 * 365.25 * DAY - 2208988800.0), _UNIX_AT_1972]
_DELTA_T = [-2.72, 3.86, 10.46, 17.20, 21.16, 23.62, 24.02, 23.93, 24.33, 26.77, 29.15, 31.07, 33.15, 35.73, 40.18]
_DELTA_T.append(42.184)


def read_earth_rotation(records: Iterable[bytes]) -> IERS:
    """Return an Earth rotation table for all dates: 0 before the first record, the last value after the last one.

    Fixed columns: MJD in 8-15, UT1-UTC in 59-68. Raises ValueError if days are missing.
    """
    rows = ((line[7:15], line[58:68]) for line in records)
    days, values = zip(*((float(day), float(value)) for day, value in rows if value.strip()), strict=True)
    if (np.diff(days) != 1.0).any():
        raise ValueError("UT1-UTC table: its days are not consecutive")
    table = {"MJD": [0.0, days[0] - 1.0, *days, 1e5] * u.day, "UT1_UTC": [0.0, 0.0, *values, values[-1]] * u.s}
    still = np.zeros(len(days) + 3) * u.arcsec
    return IERS({**table, "PM_x": still, "PM_y": still, "dX_2000A": still, "dY_2000A": still})


@cache
def earth_rotation() -> IERS:
    """Return the table installed with astropy. It is read once: nothing changes it while the gateway runs."""
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        return read_earth_rotation(file)


def terrestrial(unix: float) -> float:
    """Return Terrestrial Time in days since the Unix epoch: by the leap seconds, before 1972 by observations."""
    if unix < _UNIX_AT_1972:
        return float(unix + np.interp(unix, _OBSERVED, _DELTA_T)) / DAY
    midnight = unix - unix % DAY  # astropy's own Unix time runs slow on a day with a leap second
    at = Time(midnight, format="unix").tt
    return float((at.jd1 - JD_OF_UNIX_EPOCH) + at.jd2) + (unix - midnight) / DAY


def ut1_utc(day: int) -> float:
    """Return UT1-UTC in seconds at 0h of a day since the Unix epoch; it changes by less than 3 ms a day."""
    return float(earth_rotation().ut1_utc(JD_OF_UNIX_EPOCH + day).value)


@lru_cache(512)  # shared by all gateways of a process
def day_table(part: str, day: int) -> DayTable:
    """Return the table of a part (``frame``, ``Sun``, ``Moon`` or a planet) for a day since the Unix epoch."""
    return DayTable([tuple(row) for row in _rows(part, (day,))[0].tolist()])


def almanac(days: Collection[int], sites: Iterable[str] = ()) -> Almanac:
    """Return the tables of these days, and those of the sites that can be understood in decimals."""
    by = f"astropy {version('astropy')}, IERS data {version('astropy-iers-data')}"
    parts = [_rows(part, tuple(days)) for part in PARTS] if days else []
    tables = {day: rows_of(part[number].tolist() for part in parts) for number, day in enumerate(days)}
    known = {site: place for site in sites if (place := in_decimals(site)) is not None}
    return Almanac(by, tables, known)


def in_decimals(site: str) -> tuple[float, float] | None:
    """Return latitude and longitude of ``LAT,LON`` with minutes or letters, in degrees; None if it means none."""
    try:
        written = site.split(",")
        latitude, longitude = Latitude(written[0], unit="deg"), Longitude(written[1], unit="deg", wrap_angle="180d")
    except (ValueError, TypeError, IndexError):
        return None
    return round(float(latitude.deg), 9), round(float(longitude.deg), 9)


@lru_cache(4)
def _moments(days: tuple[int, ...]) -> tuple[Any, Any, Any]:
    """Return the times of the rows, and at each the rotation from J2000 to the equinox of date and the Earth."""
    rows = np.add.outer([terrestrial(day * DAY) for day in days], _SECONDS / DAY).ravel()
    at = Time(JD_OF_UNIX_EPOCH, rows, format="jd", scale="tt")
    axes = CartesianRepresentation(np.broadcast_to(np.eye(3)[:, :, np.newaxis], (3, 3, len(rows))))
    matrices = GCRS(axes, obstime=at).transform_to(TETE(obstime=at)).cartesian.xyz.value
    return at, matrices, get_body_barycentric("earth", at, ephemeris="builtin")


def _rows(part: str, days: tuple[int, ...]) -> Any:
    """Return the rows of each day: sidereal time and rotation, or a vector of date."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # future leap seconds are unknown
        at, matrices, earth = _moments(days)
        if part == "frame":
            columns = np.vstack([_sidereal_times(days), matrices.reshape(9, -1)])
        else:
            seen = get_sun(at).cartesian.xyz.to_value(u.km) if part == "Sun" else _from_earth(part, at, earth)
            columns = np.einsum("ijn,jn->in", matrices, seen)
    return np.moveaxis(columns.reshape(len(columns), len(days), -1), 0, 2)


def _sidereal_times(days: tuple[int, ...]) -> Any:
    """Return Greenwich apparent sidereal time in degrees, less the increase of mean sidereal time since the first row.

    It calls ERFA directly: `Time.sidereal_time` derives UT1 from UTC, which ran at other rates before 1972.
    """
    at, matrices, _ = _moments(days)
    ut1 = np.add.outer([day + ut1_utc(day) / DAY for day in days], _SECONDS / DAY).ravel()
    rotation = np.moveaxis(matrices, 2, 0)
    times = np.degrees(erfa.gst06(JD_OF_UNIX_EPOCH, ut1, at.jd1, at.jd2, rotation)).reshape(len(days), -1)
    first = times[:, :1]
    return (first + (times - first - SIDEREAL_RATE * _SECONDS + 180.0) % 360.0 - 180.0).ravel()


def _from_earth(name: str, at: Any, earth: Any) -> Any:
    """Return the geocentric vector, in km, to where the body was when its light left it; without aberration.

    The Moon moves around the Sun with the Earth, so light time is its only aberration.
    """
    light = 0.0
    for _ in range(3):  # iterate the light time: each round is a thousand times more exact
        sent = at - light * u.s
        viewer = get_body_barycentric("earth", sent, ephemeris="builtin") if name == "Moon" else earth
        seen = (get_body_barycentric(name, sent, ephemeris="builtin") - viewer).xyz.to_value(u.km)
        light = np.sqrt((seen**2).sum(axis=0)) / _LIGHT
    return seen


iers.earth_orientation_table.set(earth_rotation())
