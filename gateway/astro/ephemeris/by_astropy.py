"""Calculates days of the almanac with astropy. The import takes half a second and 45 MB: only
``mount-gateway almanac`` and tests do it, never a process that serves mounts.

`Time` applies leap seconds. ERFA's IAU 2006 precession and 2000A nutation convert J2000 to the equinox of date.
`get_sun` and `get_body_barycentric` return Sun, Moon and planets (ephemeris "builtin": nothing is downloaded). UT1-UTC
is read from the IERS file finals2000A.all, which is installed with astropy and contains predictions for a year; later
dates use its last value. The file is parsed here, because astropy's own reader takes 100 MB.
Errors, against Skyfield and JPL's DE421: sidereal time 5 ms, axes 1 mas, Sun 0.03", Moon 3" rms and 19" at worst.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection
from functools import cache, lru_cache
from typing import Any

import astropy_iers_data  # type: ignore[import-untyped]
import erfa
import numpy as np
from astropy import units as u
from astropy.coordinates import get_body_barycentric, get_sun
from astropy.time import Time, TimeDelta

from gateway.astro.ephemeris.almanac import DAY, DAY_ROWS, ROW_INTERVAL, SKY_PARTS, Almanac
from gateway.astro.spherical import SIDEREAL_RATE

JD_OF_UNIX_EPOCH = 2440587.5
_ROW_SECONDS = np.arange(DAY_ROWS) * ROW_INTERVAL
_LIGHT_SPEED = 299792.458  # km a second


def calculate_almanac(days: Collection[int]) -> Almanac:
    """Return the almanac of these days, given as days since the Unix epoch."""
    parts = [_part_rows(part, tuple(days)).astype("<f8") for part in SKY_PARTS] if days else []
    return Almanac({day: b"".join(part[number].tobytes() for part in parts) for number, day in enumerate(days)})


@cache
def ut1_table() -> Any:
    """Return the IERS table of the Earth's rotation: days since the Unix epoch, and UT1-UTC at 0h in seconds. In a line
    of the file, columns 8-15 contain the MJD and columns 59-68 UT1-UTC.
    """
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        return np.array([(float(line[7:15]) - 40587.0, float(line[58:68])) for line in file if line[58:68].strip()]).T


@lru_cache(4)
def _times_and_rotations(days: tuple[int, ...]) -> tuple[Any, Any]:
    """Return the times of all rows of these days, and for each the rotation from J2000 to the equinox of date."""
    midnights = Time(np.repeat(days, DAY_ROWS) * DAY, format="unix").tt  # Unix time runs slow if a leap second comes
    at = midnights + TimeDelta(np.tile(_ROW_SECONDS, len(days)), format="sec")
    return at, erfa.pnm06a(at.jd1, at.jd2)


def _part_rows(part: str, days: tuple[int, ...]) -> Any:
    """Return a part's rows as [day, row, number]: sidereal time and rotation, or a body's vector of date in km."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # future leap seconds are unknown
        at, matrices = _times_and_rotations(days)
        if part == "frame":
            rows = np.hstack([_sidereal_times(days), matrices.reshape(-1, 9)])
        else:
            rows = np.einsum("nij,jn->ni", matrices, geocentric_vector(part, at))
    return rows.reshape(len(days), DAY_ROWS, -1)


def _sidereal_times(days: tuple[int, ...]) -> Any:
    """Return Greenwich apparent sidereal time in degrees, less the increase of mean sidereal time since 0h of the day.

    So it hardly changes from row to row. UT1-UTC is taken at 0h of each day, because its table jumps at a leap second.
    """
    at, matrices = _times_and_rotations(days)
    ut1 = np.add.outer(days + np.interp(days, *ut1_table()) / DAY, _ROW_SECONDS / DAY).ravel()
    times = np.degrees(erfa.gst06(JD_OF_UNIX_EPOCH, ut1, at.jd1, at.jd2, matrices)).reshape(len(days), -1)
    first = times[:, :1]
    return (first + (times - first - SIDEREAL_RATE * _ROW_SECONDS + 180.0) % 360.0 - 180.0).reshape(-1, 1)


def geocentric_vector(name: str, times: Any) -> Any:
    """Return the geocentric vectors (J2000, km) of a body, corrected for light time, as it is seen at these times.

    Aberration is included for the Sun only: the Moon moves with the Earth, so light time is its only aberration.
    """
    if name == "Sun":
        return get_sun(times).cartesian.xyz.to_value(u.km)
    earth, light = get_body_barycentric("earth", times, ephemeris="builtin"), 0.0
    for _ in range(3):  # iterate the light time: each round is a thousand times more exact
        sent = times - light * u.s
        viewer = get_body_barycentric("earth", sent, ephemeris="builtin") if name == "Moon" else earth
        apparent = (get_body_barycentric(name, sent, ephemeris="builtin") - viewer).xyz.to_value(u.km)
        light = np.sqrt((apparent**2).sum(axis=0)) / _LIGHT_SPEED
    return apparent
