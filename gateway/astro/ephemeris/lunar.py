"""How the Moon is turned: from places on the Moon to directions on the sky, libration counted.

Selenographic latitude counts north, longitude EAST (towards Mare Crisium), degrees. The Moon's Euler angles are
Cassini's laws, which make the optical libration, plus the physical libration by Eckhardt's series (Meeus, Astronomical
Algorithms, chapter 53): within 0.03 degrees of JPL's DE421, which is half an arcsecond on the sky. All is done with
vectors, so what a site sees otherwise than the Earth's centre (up to a degree of libration) needs no further formula.
"""

from __future__ import annotations

import math
from operator import mul

from gateway.astro.ephemeris.closed_forms import delaunay
from gateway.astro.spherical import (
    Matrix,
    Vector,
    about_x,
    about_z,
    centuries,
    nutation,
    obliquity,
    product,
    rotate,
    to_vector,
)

RADIUS = 1737.4  # km, IAU
_INCLINATION = 1.54242  # of the lunar equator to the ecliptic


def orientation(unix: float) -> Matrix:
    """The rotation from selenographic axes to the true equator and equinox of date."""
    t = centuries(unix)
    node = 125.0445479 + t * (-1934.1362891 + 0.0020754 * t)
    angles = delaunay(t)
    tilt, along, turn = _physical(t, node, angles)
    in_longitude, in_obliquity = nutation(t)
    # The lunar equator's descending node lies where the orbit ascends, and the prime meridian faces the Earth there.
    to_node = about_z(180.0 + math.degrees(angles[3]) + turn - along)
    tilted = about_x(-_INCLINATION - tilt)
    to_equinox = about_z(node + along + in_longitude)
    to_equator = about_x(obliquity(t) + in_obliquity)
    return product(to_equator, to_equinox, tilted, to_node)


def place(moon: Vector, unix: float, latitude: float, longitude: float) -> Vector:
    """Where a selenographic place is, in km of date, for a Moon seen there (from the Earth's centre or a site)."""
    x, y, z = rotate(orientation(unix), to_vector(longitude, latitude))
    return moon[0] + RADIUS * x, moon[1] + RADIUS * y, moon[2] + RADIUS * z


def _physical(t: float, node: float, angles: tuple[float, ...]) -> tuple[float, float, float]:
    """Eckhardt's physical libration: what is to be added to inclination, node and longitude, degrees."""

    def series(terms: tuple[tuple[tuple[int, int, int, int], float, float], ...]) -> float:
        total = 0.0
        for factors, sine, cosine in terms:
            angle = sum(map(mul, factors, angles))
            total += sine * math.sin(angle) + cosine * math.cos(angle)
        return total * 1e-5

    turn = series(_TURN)
    for argument, sine in ((119.75 + 131.849 * t, 396), (72.56 + 20.186 * t, 23), (node, 196)):
        turn += sine * 1e-5 * math.sin(math.radians(argument))
    # Eckhardt gives the node's part as the pole's displacement by it, which is as many times smaller.
    return series(_TILT), series(_ALONG) / math.sin(math.radians(_INCLINATION)), turn


# Factors of `delaunay`'s angles; then 1e-5 degrees of sine and of cosine. The Earth's eccentricity changes
# the one term it concerns by less than 0.0001 degrees.
_TILT = (
    ((0, 0, 1, 0), 0, -2752), ((0, 0, 0, 1), -2245, 0), ((0, 0, 1, -2), 0, 684),  ((0, 0, 0, 2), 0, -293),
    ((-2, 0, 0, 2), 0, -85),  ((-2, 0, 1, 0), 0, -54),  ((0, 0, 1, 1), -20, 0),   ((0, 0, 1, 2), 0, -20),
    ((0, 0, 1, -1), 0, -20),  ((-2, 0, 1, 2), 0, 14),
)  # fmt: skip
_ALONG = (
    ((0, 0, 1, 0), -2816, 0), ((0, 0, 0, 1), 0, 2244),  ((0, 0, 1, -2), -682, 0), ((0, 0, 0, 2), -279, 0),
    ((-2, 0, 0, 2), -83, 0),  ((-2, 0, 1, 0), 69, 0),   ((0, 0, 1, 1), 0, 40),    ((0, 0, 2, 0), -25, 0),
    ((0, 0, 1, 2), -23, 0),   ((0, 0, 1, -1), 19, 20),  ((-2, 0, 1, 2), 13, 0),   ((0, 0, 1, -3), 0, -10),
)  # fmt: skip
_TURN = (
    ((0, 1, 0, 0), 2520, 0),    ((0, 0, 2, -2), 473, 14),   ((0, 0, 1, 0), -467, 0),    ((-2, 0, 2, 0), 276, 0),
    ((0, 0, 1, -1), -39, -183), ((-2, 0, 1, 0), 115, 0),    ((-1, 0, 1, 0), -96, 0),    ((-2, 0, 0, 2), 46, 0),
    ((-1, -1, 1, 0), -32, 0),   ((-2, -1, 2, 0), 27, 0),    ((2, 0, 0, 0), -14, 0),     ((0, 0, 1, -2), -12, 0),
    ((0, 0, 2, 0), -12, 0),     ((-2, -2, 2, 0), 11, 0),
)  # fmt: skip
