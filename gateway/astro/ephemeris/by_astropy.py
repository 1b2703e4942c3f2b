"""The sky by ERFA, the library astropy's own coordinates stand on, called through pyerfa.

Importing this module imports numpy, so only the loader thread of `Sky` does it. astropy's objects are left
out on purpose: the same numbers through them cost milliseconds a call and a hundred megabytes.
Nothing here touches the network: leap seconds are ERFA's own, UT1-UTC comes from the file that astropy
installs with itself. Polar motion (below 0.6") is left out. Errors, against Skyfield and JPL's DE421: sidereal
time 5 ms, axes 1 mas, Sun 0.03", Moon 3" rms and 19" at worst; before 1972 another 0.1" and 1.5" for a time
scale that was read from the sky, and after the table's end what the Earth will do, which nobody knows.
"""

from __future__ import annotations

import math
from bisect import bisect_right

import erfa

from gateway.astro.ephemeris.almanac import ASTRONOMICAL_UNIT, Almanac, Frame
from gateway.astro.ephemeris.earth import EarthRotation
from gateway.astro.spherical import Matrix, Vector, rotate

JD_OF_UNIX_EPOCH = 2440587.5
_DAY = 86400.0
_TT_MINUS_TAI = 32.184
_LIGHT_DAYS_PER_AU = 0.005775518331436995
_YEAR = 365.25 * _DAY
# Before 1972 Unix time stands for UT1. TT-UT1 in seconds every fifth year from 1900 on (Astronomical Almanac,
# "Reduction of time scales"); straight lines between them are within two seconds, 1" of the Moon.
_DELTA_T = (-2.72, 3.86, 10.46, 17.20, 21.16, 23.62, 24.02, 23.93, 24.33, 26.77, 29.15, 31.07, 33.15, 35.73, 40.18)
_UNIX_AT_1900 = -2208988800.0


class ExactAlmanac(Almanac):
    """ERFA's answers, for 1900 to 2099: beyond, its ephemeris of the Earth does not go."""

    def __init__(self, rotation: EarthRotation) -> None:
        self._rotation = rotation
        rows = [(int(y), int(m), float(s)) for y, m, s in erfa.leap_seconds.get() if y >= 1972]
        self._steps: list[float] = [(erfa.cal2jd(y, m, 1)[1] - 40587.0) * _DAY for y, m, _ in rows]
        self._tai_utc: list[float] = [seconds for _, _, seconds in rows]
        self._observed = [_UNIX_AT_1900 + 5.0 * _YEAR * row for row in range(len(_DELTA_T))] + self._steps[:1]
        self._delta_t = [*_DELTA_T, self._tai_utc[0] + _TT_MINUS_TAI]  # and no step into the first leap seconds

    def frame(self, unix: float) -> Frame:
        """IAU 2006/2000A precession, nutation and sidereal time; ICRS stands for J2000 (0.02" apart)."""
        tt = self._terrestrial(unix)
        ut1 = (unix + self._rotation.ut1_utc(unix)) / _DAY
        matrix = erfa.pnm06a(JD_OF_UNIX_EPOCH, tt)
        sidereal = erfa.gst06(JD_OF_UNIX_EPOCH, ut1, JD_OF_UNIX_EPOCH, tt, matrix)
        return math.degrees(float(sidereal)), _plain(matrix)

    def sun(self, unix: float) -> Vector:
        """Apparent geocentric place of date, in km: the Earth's ephemeris and the annual aberration.

        The Sun itself moves 0.01" while its light travels: left out.
        """
        tt = self._terrestrial(unix)
        heliocentric, barycentric = erfa.epv00(JD_OF_UNIX_EPOCH, tt)
        distance = math.hypot(*map(float, heliocentric["p"]))
        velocity = barycentric["v"] * _LIGHT_DAYS_PER_AU  # in units of the speed of light
        lorentz = math.sqrt(1.0 - float(velocity @ velocity))
        direction = erfa.ab(-heliocentric["p"] / distance, velocity, distance, lorentz)
        x, y, z = (float(c) for c in erfa.rxp(erfa.pnm06a(JD_OF_UNIX_EPOCH, tt), direction))
        scale = distance * ASTRONOMICAL_UNIT
        return x * scale, y * scale, z * scale

    def moon(self, unix: float) -> Vector:
        """Apparent geocentric place of date, in km: where it was when its light left.

        The Moon shares the Earth's way around the Sun, so light time is all the aberration there is.
        """
        tt = self._terrestrial(unix)
        moon = erfa.moon98(JD_OF_UNIX_EPOCH, tt)
        delay = math.hypot(*map(float, moon["p"])) * _LIGHT_DAYS_PER_AU
        place = (moon["p"] - moon["v"] * delay) * ASTRONOMICAL_UNIT
        x, y, z = (float(c) for c in place)
        return rotate(_plain(erfa.pnm06a(JD_OF_UNIX_EPOCH, tt)), (x, y, z))

    def planet(self, index: int, unix: float) -> Vector | None:
        """Geocentric place of date, in astronomical units: where the planet was when its light left, no aberration."""
        tt = self._terrestrial(unix)
        heliocentric, _ = erfa.epv00(JD_OF_UNIX_EPOCH, tt)
        way = 0.0
        for _ in range(3):  # the way the light goes, from nothing: each round is a thousand times nearer
            planet = erfa.plan94(JD_OF_UNIX_EPOCH, tt - way * _LIGHT_DAYS_PER_AU, index + 1)
            x, y, z = (float(c) for c in planet["p"] - heliocentric["p"])
            way = math.hypot(x, y, z)
        return rotate(_plain(erfa.pnm06a(JD_OF_UNIX_EPOCH, tt)), (x, y, z))

    def _terrestrial(self, unix: float) -> float:
        """Terrestrial Time in days since the Unix epoch: by the leap seconds, before the first by observation."""
        step = bisect_right(self._steps, unix)
        if step:
            return (unix + self._tai_utc[step - 1] + _TT_MINUS_TAI) / _DAY
        end = max(bisect_right(self._observed, unix), 1)
        (x0, x1), (y0, y1) = self._observed[end - 1 : end + 1], self._delta_t[end - 1 : end + 1]
        return (unix + y0 + (y1 - y0) * (unix - x0) / (x1 - x0)) / _DAY


def _plain(matrix: object) -> Matrix:
    """An array as tuples: plain arithmetic on nine numbers is faster than numpy's call."""
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in matrix)  # type: ignore[attr-defined]
    return a, b, c


def load() -> ExactAlmanac:
    """Read what is needed and work everything once, so that a fault shows here and not in a command."""
    almanac = ExactAlmanac(EarthRotation.installed())
    for answer in (almanac.frame, almanac.sun, almanac.moon):
        answer(0.0)
    return almanac
