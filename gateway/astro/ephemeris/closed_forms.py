"""Closed formulas for the orientation of the Earth, and for Sun and Moon: `math` alone, at once and for any date.

Results refer to the true equator and equinox of date. The gateway uses these formulas for days that its almanac does
not contain; simulated mounts always use them. There are no planets, because their formulas would be too long. The
Moon's orientation, with libration, always comes from this module. Greatest errors for 1900..2050, against ERFA and
JPL's DE421: axes 0.4", sidereal time 0.03 s plus UT1-UTC (below 0.9 s), Sun 0.01 degrees, Moon 0.04 degrees, 150 km.
"""

from __future__ import annotations

import math
from functools import lru_cache
from operator import mul

from gateway.astro.spherical import (
    UNIX_AT_J2000,
    Matrix,
    Vector,
    product,
    rotate,
    rotation_x,
    rotation_z,
    to_vector,
    wrap180,
    wrap360,
)

_TT_MINUS_UTC = 69.184  # since 2017; an error of ten seconds changes results by less than 0.001"
_CENTURY_SECONDS = 36525.0 * 86400.0
_ABERRATION = 20.4955 / 3600.0  # degrees
_MOON_RADIUS = 1737.4  # km, IAU
_MOON_INCLINATION = 1.54242  # degrees, of the lunar equator to the ecliptic

#: Greenwich apparent sidereal time in degrees, and the rotation from J2000 to equator and equinox of date.
Frame = tuple[float, Matrix]


def centuries(unix: float) -> float:
    """Return the Julian centuries of Terrestrial Time since J2000, for a Unix time (UTC). The result is limited to ±50:
    beyond, the polynomials that use it are invalid, and must not overflow.
    """
    return max(-50.0, min(50.0, (unix + _TT_MINUS_UTC - UNIX_AT_J2000) / _CENTURY_SECONDS))


def obliquity(t: float) -> float:
    """Return the mean obliquity of the ecliptic, degrees, IAU 2006; t in centuries of TT since J2000."""
    return (84381.406 + t * (-46.836769 + t * (-0.0001831 + t * 0.0020034))) / 3600.0


def nutation(t: float) -> tuple[float, float]:
    """Return nutation in longitude and in obliquity, degrees: the four largest terms of the IAU series, accurate to
    0.5" and 0.15" (Meeus, Astronomical Algorithms, chapter 22). ``t`` is in Julian centuries of TT since J2000.
    """
    node = math.radians(125.04452 - 1934.136261 * t)
    twice_sun = 2.0 * math.radians(280.4665 + 36000.7698 * t)
    twice_moon = 2.0 * math.radians(218.3165 + 481267.8813 * t)
    longitude = (
        -17.2064 * math.sin(node)
        - 1.3171 * math.sin(twice_sun)
        - 0.2276 * math.sin(twice_moon)
        + 0.2075 * math.sin(2.0 * node)
    )
    tilt = (
        9.2052 * math.cos(node)
        + 0.5730 * math.cos(twice_sun)
        + 0.0978 * math.cos(twice_moon)
        - 0.0897 * math.cos(2.0 * node)
    )
    return longitude / 3600.0, tilt / 3600.0


@lru_cache(256)  # callers ask many times for the same moment
def sidereal_time(unix: float, longitude_east: float) -> float:
    """Return the apparent sidereal time, [0, 360) degrees, with UTC as UT1: IAU 2006 mean sidereal time and the
    equation of the equinoxes from `nutation`. Accurate to 0.03 s, plus UT1-UTC, which leap seconds keep below 0.9 s.
    """
    days = (unix - UNIX_AT_J2000) / 86400.0
    t = centuries(unix)
    rotation = 360.0 * (0.779057273264 + 0.00273781191135448 * days + days % 1.0)
    precession = 0.014506 + t * (4612.156534 + t * (1.3915817 + t * (-0.00000044 - t * 0.000029956)))
    equinoxes = nutation(t)[0] * math.cos(math.radians(obliquity(t)))
    return wrap360(wrap360(rotation) + precession / 3600.0 + equinoxes + wrap180(longitude_east))


def frame(unix: float) -> Frame:
    """Return Greenwich sidereal time (UT1 = UTC) and rotation to date: IAU 2006 precession, largest nutation terms."""
    return sidereal_time(unix, 0.0), _j2000_to_date_rotation(centuries(unix))


def sun(unix: float) -> Vector:
    """Return the unit vector to the apparent geocentric Sun, of date (Meeus, chapter 25, low accuracy)."""
    t = centuries(unix)
    anomaly = math.radians(357.52911 + t * (35999.05029 - 0.0001537 * t))
    centre = (
        (1.914602 - t * (0.004817 + 0.000014 * t)) * math.sin(anomaly)
        + (0.019993 - 0.000101 * t) * math.sin(2.0 * anomaly)
        + 0.000289 * math.sin(3.0 * anomaly)
    )
    return _from_ecliptic(t, 280.46646 + t * (36000.76983 + 0.0003032 * t) + centre - _ABERRATION, 0.0, 1.0)


def moon(unix: float) -> Vector:
    """Return the apparent geocentric position of the Moon, of date, in km (Meeus, chapter 47, the larger terms)."""
    t = centuries(unix)
    angles = delaunay_arguments(t)
    longitude, latitude, distance = 218.3164477 + t * (481267.88123421 - 0.0015786 * t), 0.0, 385000.56
    for factors, along, away in _MOON_LONGITUDE_AND_DISTANCE:
        angle = sum(map(mul, factors, angles))
        longitude += along * 1e-6 * math.sin(angle)
        distance += away * 1e-3 * math.cos(angle)
    for factors, across in _MOON_LATITUDE:
        latitude += across * 1e-6 * math.sin(sum(map(mul, factors, angles)))
    return _from_ecliptic(t, longitude, latitude, distance)


def delaunay_arguments(t: float) -> tuple[float, float, float, float]:
    """Return the Moon's mean elongation, the Sun's and Moon's mean anomaly, the argument of latitude, in radians."""
    return (
        math.radians(297.8501921 + t * (445267.1114034 - 0.0018819 * t)),
        math.radians(357.5291092 + t * (35999.0502909 - 0.0001536 * t)),
        math.radians(134.9633964 + t * (477198.8675055 + 0.0087414 * t)),
        math.radians(93.2720950 + t * (483202.0175233 - 0.0036539 * t)),
    )


def _from_ecliptic(t: float, longitude: float, latitude: float, distance: float) -> Vector:
    """Convert from the mean ecliptic and equinox of date to the true equator and equinox of date."""
    in_longitude, in_obliquity = nutation(t)
    on_ecliptic = to_vector(wrap360(longitude + in_longitude), latitude)
    x, y, z = rotate(rotation_x(obliquity(t) + in_obliquity), on_ecliptic)
    return distance * x, distance * y, distance * z


def _j2000_to_date_rotation(t: float) -> Matrix:
    """Return the rotation from J2000 to date: the four angles of Fukushima and Williams (IAU 2006), and nutation."""
    node = t * (10.556403 + t * (0.4932044 - t * 0.00031238))
    tilt = 84381.406 + t * (-46.811015 + t * (0.0511269 + t * 0.00053289))
    along = t * (5038.481507 + t * (1.5584176 - t * 0.00018522))
    in_longitude, in_obliquity = nutation(t)
    to_equator, to_equinox = rotation_x(obliquity(t) + in_obliquity), rotation_z(along / 3600.0 + in_longitude)
    return product(to_equator, to_equinox, rotation_x(-tilt / 3600.0), rotation_z(-node / 3600.0))


def moon_orientation(unix: float) -> Matrix:
    """Return the rotation from selenographic axes to the true equator and equinox of date.

    Cassini's laws, which cause the optical libration (Meeus, Astronomical Algorithms, chapter 53). The physical
    libration is left out: it is at most 0.05 degrees, which is 0.8" on the sky. Positions on the Moon are vectors, so
    the libration that is due to the observer's place on the Earth (up to a degree) needs no further formula.
    """
    t = centuries(unix)
    node = 125.0445479 + t * (-1934.1362891 + 0.0020754 * t)
    in_longitude, in_obliquity = nutation(t)
    # The lunar equator's descending node lies where the orbit ascends, and the prime meridian faces the Earth there.
    to_node = rotation_z(180.0 + math.degrees(delaunay_arguments(t)[3]))
    tilted = rotation_x(-_MOON_INCLINATION)
    to_equinox = rotation_z(node + in_longitude)
    to_equator = rotation_x(obliquity(t) + in_obliquity)
    return product(to_equator, to_equinox, tilted, to_node)


def point_on_moon(moon: Vector, unix: float, latitude: float, longitude: float) -> Vector:
    """Return the vector to a selenographic position, of date, in km. ``moon`` is the Moon's own vector from the same
    origin (the Earth's centre or a site). Latitude is positive north, longitude EAST (to Mare Crisium), degrees.
    """
    x, y, z = rotate(moon_orientation(unix), to_vector(longitude, latitude))
    return moon[0] + _MOON_RADIUS * x, moon[1] + _MOON_RADIUS * y, moon[2] + _MOON_RADIUS * z


# Factors of `delaunay_arguments`'s angles; then 1e-6 degrees of longitude (sine) and metres of distance (cosine).
_MOON_LONGITUDE_AND_DISTANCE = (
    ((0, 0, 1, 0), 6288774, -20905355), ((2, 0, -1, 0), 1274027, -3699111), ((2, 0, 0, 0), 658314, -2955968),
    ((0, 0, 2, 0), 213618, -569925),    ((0, 1, 0, 0), -185116, 48888),     ((0, 0, 0, 2), -114332, -3149),
    ((2, 0, -2, 0), 58793, 246158),     ((2, -1, -1, 0), 57066, -152138),   ((2, 0, 1, 0), 53322, -170733),
    ((2, -1, 0, 0), 45758, -204586),    ((0, 1, -1, 0), -40923, -129620),   ((1, 0, 0, 0), -34720, 108743),
    ((0, 1, 1, 0), -30383, 104755),     ((2, 0, 0, -2), 15327, 10321),      ((0, 0, 1, 2), -12528, 0),
    ((0, 0, 1, -2), 10980, 79661),      ((4, 0, -1, 0), 10675, -34782),     ((0, 0, 3, 0), 10034, -23210),
    ((4, 0, -2, 0), 8548, -21636),      ((2, 1, -1, 0), -7888, 24208),      ((2, 1, 0, 0), -6766, 30824),
    ((1, 0, -1, 0), -5163, -8379),      ((1, 1, 0, 0), 4987, -16675),       ((2, -1, 1, 0), 4036, -12831),
)  # fmt: skip
# Factors of the same angles; then 1e-6 degrees of latitude (sine).
_MOON_LATITUDE = (
    ((0, 0, 0, 1), 5128122), ((0, 0, 1, 1), 280602),  ((0, 0, 1, -1), 277693),
    ((2, 0, 0, -1), 173237), ((2, 0, -1, 1), 55413),  ((2, 0, -1, -1), 46271),
    ((2, 0, 0, 1), 32573),   ((0, 0, 2, 1), 17198),   ((2, 0, 1, -1), 9266),
    ((0, 0, 2, -1), 8822),   ((2, -1, 0, -1), 8216),  ((2, 0, -2, -1), 4324),
    ((2, 0, 1, 1), 4200),
)  # fmt: skip
