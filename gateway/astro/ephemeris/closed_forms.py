"""The sky in closed forms: what can be said with `math` alone, at once and for any date.

An `Almanac` answers three questions in the true equator and equinox of date: how the Earth is turned, where
the Sun is, where the Moon is. This one stands in until the exact one is loaded, and for ever if that fails.
Greatest errors for 1900..2050: axes 0.4", sidereal time 0.03 s plus UT1-UTC (below 0.9 s), Sun 0.01 degrees,
Moon 0.04 degrees and 150 km. They were measured against ERFA and against JPL's DE421.
"""

from __future__ import annotations

import math

from gateway.astro.spherical import Matrix, Vector, centuries, nutation, obliquity, sidereal_time, to_vector, wrap360

ASTRONOMICAL_UNIT = 149597870.7  # km

#: In the order of their distance from the Sun; the Earth has no place in its own sky.
PLANETS = ("Mercury", "Venus", "Earth", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")

Frame = tuple[float, Matrix]
"""Greenwich apparent sidereal time in degrees, and the rotation from J2000 to equator and equinox of date."""


class Almanac:
    """Closed forms; a subclass may know better."""

    def frame(self, unix: float) -> Frame:
        """Precession of IAU 2006 and the great terms of nutation; sidereal time with UT1 = UTC."""
        return sidereal_time(unix, 0.0), _matrix_of_date(centuries(unix))

    def sun(self, unix: float) -> Vector:
        """Apparent geocentric place of the Sun of date, in km (Meeus, chapter 25, low accuracy)."""
        t = centuries(unix)
        anomaly = math.radians(357.52911 + t * (35999.05029 - 0.0001537 * t))
        centre = (
            (1.914602 - t * (0.004817 + 0.000014 * t)) * math.sin(anomaly)
            + (0.019993 - 0.000101 * t) * math.sin(2.0 * anomaly)
            + 0.000289 * math.sin(3.0 * anomaly)
        )
        eccentricity = 0.016708634 - t * (0.000042037 + 0.0000001267 * t)
        distance = (
            1.000001018
            * (1.0 - eccentricity * eccentricity)
            / (1.0 + eccentricity * math.cos(anomaly + math.radians(centre)))
        )
        aberration = -20.4955 / 3600.0 / distance
        longitude = 280.46646 + t * (36000.76983 + 0.0003032 * t) + centre + aberration
        return _from_ecliptic(t, longitude, 0.0, distance * ASTRONOMICAL_UNIT)

    def moon(self, unix: float) -> Vector:
        """Apparent geocentric place of the Moon of date, in km (Meeus, chapter 47, its greater terms)."""
        t = centuries(unix)
        mean = 218.3164477 + t * (481267.88123421 - 0.0015786 * t)
        arguments = (
            math.radians(297.8501921 + t * (445267.1114034 - 0.0018819 * t)),
            math.radians(357.5291092 + t * (35999.0502909 - 0.0001536 * t)),
            math.radians(134.9633964 + t * (477198.8675055 + 0.0087414 * t)),
            math.radians(93.2720950 + t * (483202.0175233 - 0.0036539 * t)),
        )
        longitude, latitude, distance = mean, 0.0, 385000.56
        for factors, along, away in _MOON_LONGITUDE_AND_DISTANCE:
            angle = sum(factor * argument for factor, argument in zip(factors, arguments, strict=True))
            longitude += along * 1e-6 * math.sin(angle)
            distance += away * 1e-3 * math.cos(angle)
        for factors, across in _MOON_LATITUDE:
            angle = sum(factor * argument for factor, argument in zip(factors, arguments, strict=True))
            latitude += across * 1e-6 * math.sin(angle)
        return _from_ecliptic(t, longitude, latitude, distance)

    def planet(self, index: int, unix: float) -> Vector | None:
        """Geocentric place of date of ``PLANETS[index]``, any unit; None here: no closed form is short enough."""
        return None


def _from_ecliptic(t: float, longitude: float, latitude: float, distance: float) -> Vector:
    """From the mean ecliptic and equinox of date to the true equator and equinox of date."""
    in_longitude, in_obliquity = nutation(t)
    x, y, z = to_vector(wrap360(longitude + in_longitude), latitude)
    tilt = math.radians(obliquity(t) + in_obliquity)
    north = math.sin(tilt) * y + math.cos(tilt) * z
    y = math.cos(tilt) * y - math.sin(tilt) * z
    return distance * x, distance * y, distance * north


def _matrix_of_date(t: float) -> Matrix:
    """J2000 to true equator and equinox of date: precession by three angles, then nutation by three."""
    zeta = 2.650545 + t * (2306.083227 + t * (0.2988499 + t * (0.01801828 - t * 0.000005971)))
    z = -2.650545 + t * (2306.077181 + t * (1.0927348 + t * (0.01826837 - t * 0.000028596)))
    theta = t * (2004.191903 + t * (-0.4294934 + t * (-0.04182264 - t * 0.000007089)))
    in_longitude, in_obliquity = nutation(t)
    mean = obliquity(t)
    turns = (
        _about_z(-zeta / 3600.0),
        _about_y(theta / 3600.0),
        _about_z(-z / 3600.0),
        _about_x(mean),
        _about_z(-in_longitude),
        _about_x(-mean - in_obliquity),
    )
    matrix = turns[0]
    for turn in turns[1:]:
        matrix = _product(turn, matrix)
    return matrix


def _about_x(angle: float) -> Matrix:
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (1.0, 0.0, 0.0), (0.0, c, s), (0.0, -s, c)


def _about_y(angle: float) -> Matrix:
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c)


def _about_z(angle: float) -> Matrix:
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)


def _product(a: Matrix, b: Matrix) -> Matrix:
    """Turn by b, then by a."""

    def row(r: Vector) -> Vector:
        x, y, z = (sum(r[k] * b[k][column] for k in range(3)) for column in range(3))
        return x, y, z

    return row(a[0]), row(a[1]), row(a[2])


# Factors of the Moon's elongation, the Sun's anomaly, the Moon's anomaly and its argument of latitude;
# then 1e-6 degrees of longitude (sine) and metres of distance (cosine).
_MOON_LONGITUDE_AND_DISTANCE = (
    ((0, 0, 1, 0), 6288774, -20905355),
    ((2, 0, -1, 0), 1274027, -3699111),
    ((2, 0, 0, 0), 658314, -2955968),
    ((0, 0, 2, 0), 213618, -569925),
    ((0, 1, 0, 0), -185116, 48888),
    ((0, 0, 0, 2), -114332, -3149),
    ((2, 0, -2, 0), 58793, 246158),
    ((2, -1, -1, 0), 57066, -152138),
    ((2, 0, 1, 0), 53322, -170733),
    ((2, -1, 0, 0), 45758, -204586),
    ((0, 1, -1, 0), -40923, -129620),
    ((1, 0, 0, 0), -34720, 108743),
    ((0, 1, 1, 0), -30383, 104755),
    ((2, 0, 0, -2), 15327, 10321),
    ((0, 0, 1, 2), -12528, 0),
    ((0, 0, 1, -2), 10980, 79661),
    ((4, 0, -1, 0), 10675, -34782),
    ((0, 0, 3, 0), 10034, -23210),
    ((4, 0, -2, 0), 8548, -21636),
    ((2, 1, -1, 0), -7888, 24208),
    ((2, 1, 0, 0), -6766, 30824),
    ((1, 0, -1, 0), -5163, -8379),
    ((1, 1, 0, 0), 4987, -16675),
    ((2, -1, 1, 0), 4036, -12831),
)
# Likewise: 1e-6 degrees of latitude (sine).
_MOON_LATITUDE = (
    ((0, 0, 0, 1), 5128122),
    ((0, 0, 1, 1), 280602),
    ((0, 0, 1, -1), 277693),
    ((2, 0, 0, -1), 173237),
    ((2, 0, -1, 1), 55413),
    ((2, 0, -1, -1), 46271),
    ((2, 0, 0, 1), 32573),
    ((0, 0, 2, 1), 17198),
    ((2, 0, 1, -1), 9266),
    ((0, 0, 2, -1), 8822),
    ((2, -1, 0, -1), 8216),
    ((2, 0, -2, -1), 4324),
    ((2, 0, 1, 1), 4200),
)
