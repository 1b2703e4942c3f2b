"""Spherical astronomy with the standard module `math` alone: angles, vectors, horizon.

Every angle is in degrees. Azimuth counts from north through east, hour angle is positive west of the
meridian, longitude is positive EAST. Right ascension is in degrees too, never in hours.
No function raises for finite arguments: latitudes and declinations beyond a pole are folded back, and if an
angle is undefined (the azimuth of the zenith, the right ascension of the pole) the result is any number in range.
"""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

UNIX_AT_J2000 = 946728000.0  # 2000-01-01 12:00, as a Unix time
SIDEREAL_RATE = 360.0 * 1.002737909350795 / 86400.0  # degrees of mean sidereal time in a second of UT1
SIDEREAL_ARCSEC_PER_S = 15.041067  # the same in arcseconds, as precisely as makers and programs use it


# -- angles ---------------------------------------------------------------------------------------------


def wrap360(angle: float) -> float:
    """Return the same direction in [0, 360)."""
    wrapped = angle % 360.0
    return 0.0 if wrapped == 360.0 else wrapped  # the remainder of -1e-20 rounds up to 360.0


def wrap180(angle: float) -> float:
    """Return the same direction in [-180, 180)."""
    wrapped = math.remainder(angle, 360.0)
    return -180.0 if wrapped == 180.0 else wrapped + 0.0  # + 0.0 turns -0.0 into 0.0


def fold_declination(ra: float, dec: float) -> tuple[float, float]:
    """Return (ra, dec) with dec in [-90, 90] and ra in [0, 360).

    Past a pole the declination decreases again, and the right ascension is that of the opposite hour circle.
    """
    dec = wrap180(dec)
    if dec > 90.0:
        return wrap360(ra + 180.0), 180.0 - dec
    if dec < -90.0:
        return wrap360(ra + 180.0), -180.0 - dec
    return wrap360(ra), dec


# -- vectors --------------------------------------------------------------------------------------------


def to_vector(longitude: float, latitude: float) -> Vector:
    """Return the unit vector of a direction: x to (0, 0), y to (90, 0), z to the north pole."""
    lon, lat = math.radians(wrap180(longitude)), math.radians(wrap180(latitude))
    return math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)


def from_vector(vector: Vector) -> tuple[float, float]:
    """Return (longitude in [0, 360), latitude in [-90, 90]) of a vector of any length but 0.

    It uses arc tangents, because an arc sine loses half its digits near the poles and fails just beyond 1.
    """
    x, y, z = vector
    return wrap360(math.degrees(math.atan2(y, x))), math.degrees(math.atan2(z, math.hypot(x, y)))


def rotate(matrix: Matrix, vector: Vector) -> Vector:
    """Return the rotated vector: matrix times column."""
    x, y, z = vector
    a, b, c = matrix
    return (a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z)


def transpose(matrix: Matrix) -> Matrix:
    """Return the transposed matrix: the inverse of a rotation."""
    a, b, c = matrix
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


def rotation_x(angle: float) -> Matrix:
    """Return the rotation by an angle about x, from y towards z."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)


def rotation_z(angle: float) -> Matrix:
    """Return the rotation by an angle about z, from x towards y."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)


def product(*matrices: Matrix) -> Matrix:
    """Return the matrix product: the combined rotation, in which the last matrix is applied first."""
    *others, total = matrices
    for matrix in reversed(others):
        x, y, z = (rotate(matrix, column) for column in transpose(total))
        total = transpose((x, y, z))
    return total


def separation(lon1: float, lat1: float, lon2: float, lat2: float) -> float:
    """Return the angle in [0, 180] between two directions, exact for the smallest and the largest (Vincenty)."""
    difference = math.radians(wrap180(wrap180(lon2) - wrap180(lon1)))
    a, b = math.radians(wrap180(lat1)), math.radians(wrap180(lat2))
    across = math.cos(b) * math.sin(difference)
    up = math.cos(a) * math.sin(b) - math.sin(a) * math.cos(b) * math.cos(difference)
    along = math.sin(a) * math.sin(b) + math.cos(a) * math.cos(b) * math.cos(difference)
    return math.degrees(math.atan2(math.hypot(across, up), along))


#: Cosine of 89.4 degrees of altitude or declination: nearer to the zenith or pole, the rates at this angle are used.
_MIN_COSINE = 0.01


# -- horizon --------------------------------------------------------------------------------------------


def hour_angle_to_horizon(hour_angle: float, dec: float, lat: float) -> tuple[float, float]:
    """Return (azimuth in [0, 360), altitude in [-90, 90]), geometric: no refraction."""
    x, y, z = to_vector(hour_angle, dec)  # x to the meridian's equator, y west, z to the pole
    phi = math.radians(wrap180(lat))
    north = math.cos(phi) * z - math.sin(phi) * x
    up = math.sin(phi) * z + math.cos(phi) * x
    return from_vector((north, -y, up))


def horizon_to_hour_angle(az: float, alt: float, lat: float) -> tuple[float, float]:
    """Return (hour angle in [-180, 180), declination in [-90, 90]) of a geometric direction."""
    hour_angle, dec = hour_angle_to_horizon(az, alt, lat)  # the formula is its own inverse
    return wrap180(hour_angle), dec


def az_alt_rates_by_ha(az: float, alt: float, lat: float) -> tuple[float, float]:
    """Return by how many degrees (azimuth, altitude) change per degree of hour angle; limited near the zenith."""
    a, h, phi = math.radians(az), math.radians(alt), math.radians(lat)
    up = max(math.cos(h), _MIN_COSINE)
    return math.sin(phi) - math.cos(phi) * math.cos(a) * math.sin(h) / up, math.cos(phi) * math.sin(a)


def az_alt_rates_by_dec(az: float, alt: float, lat: float) -> tuple[float, float]:
    """Return by how many degrees (azimuth, altitude) change per degree of declination, calculated by the parallactic
    angle; limited near the zenith and the poles.
    """
    a, h, phi = math.radians(az), math.radians(alt), math.radians(lat)
    across = -math.cos(phi) * math.sin(a)
    along = math.sin(phi) * math.cos(h) - math.cos(phi) * math.sin(h) * math.cos(a)
    from_pole = max(math.hypot(across, along), _MIN_COSINE)
    return across / from_pole / max(math.cos(h), _MIN_COSINE), along / from_pole
