"""The sky over a site: sidereal time, azimuth and altitude, equinox of date, Sun, Moon and planets.

Right ascension and declination are of the equinox of date (true equator) and geometric: no aberration and no refraction
unless a method says so. Degrees, longitude EAST positive, Unix time (UTC) in seconds. Results are interpolated in the
tables of an almanac, which a separate process has calculated with astropy (``keeper.py``). For a day without a table,
which is noted as missing, and before 1973 and after 2099, closed formulas are used. No call waits; no method raises for
finite arguments. Errors of the formulas: sidereal time 0.03 s plus UT1-UTC, precession and nutation 0.4", Sun 0.01
degrees, Moon 0.04 degrees. Errors of the tables: sidereal time 0.005 s, precession, nutation and Sun 0.03", Moon 3" rms
and 19" at worst, planets 1.5'. Only the tables have planets.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from gateway.astro.ephemeris import closed_forms
from gateway.astro.ephemeris.almanac import DAY, FIRST_DATE, LAST_DATE, Almanac, Row
from gateway.astro.ephemeris.closed_forms import Frame
from gateway.astro.spherical import (
    SIDEREAL_RATE,
    Vector,
    from_vector,
    horizon_to_hour_angle,
    hour_angle_to_horizon,
    rotate,
    to_vector,
    transpose,
    wrap360,
)

_MAX_CACHED_FRAMES = 16  # enough for the minutes of the host's clock, and the mount's
_EARTH_RADIUS = 6378.137  # km, at the equator (WGS 84)
_EARTH_FLATTENING = 1.0 / 298.257223563


class Sky:
    """Positions and sidereal times, from the tables of an almanac if it has the day, else from closed formulas."""

    def __init__(self) -> None:
        self._almanac = Almanac()
        self._frame_cache: dict[float, Frame] = {}
        #: The day (since the Unix epoch) that the almanac was last found to lack; then `request_almanac` is called.
        self.missing_day: int | None = None
        self.request_almanac: Callable[[], object] = lambda: None

    def use(self, almanac: Almanac) -> None:
        """Use the tables of this almanac from now on."""
        self._almanac = almanac
        self._frame_cache.clear()
        self.missing_day = None if self.missing_day in almanac.days else self.missing_day

    @property
    def has_tables(self) -> bool:
        """Whether there is an almanac, that is, at least one day with tables."""
        return bool(self._almanac.days)

    def _table_values(self, part: str, unix: float) -> Row | None:
        """Return the values of a part of the sky from the tables; if they lack the day, note that and return None."""
        if not FIRST_DATE <= unix < LAST_DATE:
            return None
        values = self._almanac.values_at(part, unix)
        day = int(unix // DAY)
        if values is None and day != self.missing_day:
            self.missing_day = day
            self.request_almanac()
        return values

    def calculation_source(self, unix: float) -> str:
        """Return how results for this time are calculated, as text: by an almanac or by closed formulas."""
        if self._table_values("frame", unix) is None:
            return "closed form"
        return time.strftime("almanac of %Y-%m-%d", time.gmtime(unix))

    def sidereal_time(self, unix: float, longitude_east: float) -> float:
        """Return the apparent sidereal time in [0, 360)."""
        return wrap360(self._unwrapped_sidereal_time(unix, longitude_east))

    def _unwrapped_sidereal_time(self, unix: float, longitude_east: float) -> float:
        minute, (greenwich, _) = self._frame_at_minute(unix)
        return greenwich + SIDEREAL_RATE * (unix - minute) + longitude_east % 360.0

    def az_alt(self, ra: float, dec: float, site_lat: float, site_lon_east: float, unix: float) -> tuple[float, float]:
        """Return (azimuth in [0, 360), altitude in [-90, 90]) of a position of date."""
        hour_angle = self._unwrapped_sidereal_time(unix, site_lon_east) - ra % 360.0
        return hour_angle_to_horizon(hour_angle, dec, site_lat)

    def to_ra_dec(
        self, az: float, alt: float, site_lat: float, site_lon_east: float, unix: float
    ) -> tuple[float, float]:
        """Return (ra, dec) of date of an azimuth and altitude."""
        hour_angle, dec = horizon_to_hour_angle(az, alt, site_lat)
        return wrap360(self.sidereal_time(unix, site_lon_east) - hour_angle), dec

    def from_j2000(self, ra: float, dec: float, unix: float) -> tuple[float, float]:
        """Return (ra, dec) of date of a J2000 position: precession and nutation."""
        _, (_, matrix) = self._frame_at_minute(unix)
        return from_vector(rotate(matrix, to_vector(ra, dec)))

    def to_j2000(self, ra: float, dec: float, unix: float) -> tuple[float, float]:
        """Return (ra, dec) of J2000 of a position of date: the inverse rotation."""
        _, (_, matrix) = self._frame_at_minute(unix)
        return from_vector(rotate(transpose(matrix), to_vector(ra, dec)))

    def sun(self, unix: float) -> tuple[float, float]:
        """Return the apparent geocentric (ra, dec) of date of the Sun: with aberration (20"), without parallax (9")."""
        return from_vector(self._table_vector("Sun", unix) or closed_forms.sun(unix))

    def moon(self, unix: float, lat: float, lon_east: float) -> tuple[float, float, float]:
        """Return the apparent (ra, dec, distance in km) of date of the Moon, as seen from a site at sea level, with
        aberration: for the Moon this is only its motion during the 1.3 s of light time, 0.7".
        """
        moon = self._moon_from_site(unix, lat, lon_east)
        return *from_vector(moon), math.hypot(*moon)

    def moon_spot(
        self, unix: float, lat: float, lon_east: float, moon_lat: float, moon_lon_east: float
    ) -> tuple[float, float]:
        """Return the apparent (ra, dec) of date of a place on the Moon, as seen from a site, with libration."""
        moon = self._moon_from_site(unix, lat, lon_east)
        return from_vector(closed_forms.point_on_moon(moon, unix, moon_lat, moon_lon_east))

    def planet(self, name: str, unix: float) -> tuple[float, float] | None:
        """Return the geocentric (ra, dec) of date of a planet, corrected for light time; None without a table. Against
        JPL's ephemerides accurate to 1.5' (Mercury and Venus 0.2', Mars 0.7').
        """
        vector = self._table_vector(name, unix)
        return None if vector is None else from_vector(vector)

    def moon_vector(self, unix: float) -> Vector:
        """Return the geocentric vector of the Moon, of date, in km."""
        return self._table_vector("Moon", unix) or closed_forms.moon(unix)

    def _moon_from_site(self, unix: float, lat: float, lon_east: float) -> Vector:
        """Return the vector from a site at sea level to the Moon, of date, in km."""
        x, y, z = self.moon_vector(unix)
        phi = math.radians(wrap360(lat))
        polar = (1.0 - _EARTH_FLATTENING) ** 2
        curvature = _EARTH_RADIUS / math.sqrt(math.cos(phi) ** 2 + polar * math.sin(phi) ** 2)
        lst = math.radians(self.sidereal_time(unix, lon_east))
        return (
            x - curvature * math.cos(phi) * math.cos(lst),
            y - curvature * math.cos(phi) * math.sin(lst),
            z - curvature * polar * math.sin(phi),
        )

    def _frame_at_minute(self, unix: float) -> tuple[float, Frame]:
        """Return when the minute began (Unix seconds), and the sidereal time and rotation to date at that time, cached.

        Within the minute the axes move less than 0.0001"; sidereal time increases at the sidereal rate.
        """
        minute = unix - unix % 60.0
        frame = self._frame_cache.get(minute)
        if frame is None:
            if len(self._frame_cache) >= _MAX_CACHED_FRAMES:
                self._frame_cache.clear()
            values = self._table_values("frame", minute)
            frame = closed_forms.frame(minute) if values is None else _to_frame(minute, *values)
            self._frame_cache[minute] = frame
        return minute, frame

    def _table_vector(self, part: str, unix: float) -> Vector | None:
        """Return the geocentric vector of Sun, Moon or a planet, of date, in km; None without a table."""
        values = self._table_values(part, unix)
        return None if values is None else (values[0], values[1], values[2])


def _to_frame(unix: float, sidereal_at_0h: float, *m: float) -> Frame:
    """Return Greenwich sidereal time and rotation to date from the values of a table row."""
    return sidereal_at_0h + SIDEREAL_RATE * (unix % DAY), ((m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8]))
