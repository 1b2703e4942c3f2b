"""The sky over a site: sidereal time, alt-azimuth, equinox of date, Sun and Moon.

Right ascension and declination are of the equinox of date (true equator), geometric: no aberration and no
refraction but where a method says so. Degrees, longitude EAST positive, Unix time (UTC) in seconds.
Importing this costs nothing: `Sky.start` loads ERFA (pyerfa, astropy's own library) on a thread, and until
it is ready, if it cannot be loaded, and before 1900 and after 2099, closed forms answer. Nobody waits, no
method raises for finite arguments, nothing is ever fetched.

                      closed forms        exact
    sidereal time     0.02 s + UT1-UTC    0.005 s
    of date / J2000   0.4"                0.03"
    Sun               0.01 deg            0.03"
    Moon              0.04 deg            3" rms, 19" at worst
    planets           none                1.5'
"""

from __future__ import annotations

import math
from collections.abc import Callable

from gateway.astro.ephemeris import lunar
from gateway.astro.ephemeris.almanac import PLANETS, Almanac, Frame
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

_EXACT_FROM = -2208988800.0  # 1900-01-01
_EXACT_TO = 4102444800.0  # 2100-01-01
_FRAMES_KEPT = 16  # the minutes at hand: the host's clock, the mount's, a replayed transcript's
_EARTH_RADIUS = 6378.137  # km, at the equator (WGS 84)
_EARTH_FLATTENING = 1.0 / 298.257223563


class Sky:
    """Answers from closed forms at once, and from ERFA once `start` has loaded it."""

    def __init__(self) -> None:
        self._closed = Almanac()
        self._exact: Almanac | None = None
        self._in_use = True
        self._frames: dict[tuple[Almanac, float], Frame] = {}
        self.failure = ""
        """Why ERFA could not be loaded, in words; empty while all is well."""

    @property
    def ready(self) -> bool:
        """True once the exact answers are in use."""
        return self._exact is not None and self._in_use

    def start(self, done: Callable[[], object] | None = None) -> None:
        """Load ERFA and the Earth's rotation on a daemon thread; returns at once.

        Where the thread calls ``done`` at the end, the exact answers are not in use before somebody calls ``use``.
        """
        import threading  # with `load`'s import, all that would make this module slow to import

        def work() -> None:
            self.load()
            if done is not None:
                done()

        self._in_use = done is None
        threading.Thread(target=work, name="sky", daemon=True).start()

    def use(self) -> None:
        """From now on the exact answers are given."""
        self._in_use = True

    def load(self) -> None:
        """What `start` does, in the caller's own time. Never raises: sets `ready`, or `failure`."""
        try:
            from gateway.astro.ephemeris import exact

            self._exact = exact.load()
        except Exception as fault:  # whatever a broken installation can raise; closed forms go on
            self.failure = f"astronomy stays approximate: {type(fault).__name__}: {fault}"

    def sidereal_time(self, unix: float, longitude_east: float) -> float:
        """Apparent sidereal time in [0, 360)."""
        minute, (greenwich, _) = self._frame(unix)
        return wrap360(greenwich + SIDEREAL_RATE * (unix - minute) + wrap360(longitude_east))

    def horizon(self, ra: float, dec: float, site_lat: float, site_lon_east: float, unix: float) -> tuple[float, float]:
        """(azimuth in [0, 360), altitude in [-90, 90]) of a place of date."""
        hour_angle = self.sidereal_time(unix, site_lon_east) - wrap360(ra)
        return hour_angle_to_horizon(hour_angle, dec, site_lat)

    def equatorial(
        self, az: float, alt: float, site_lat: float, site_lon_east: float, unix: float
    ) -> tuple[float, float]:
        """(ra, dec) of date of a direction over the horizon."""
        hour_angle, dec = horizon_to_hour_angle(az, alt, site_lat)
        return wrap360(self.sidereal_time(unix, site_lon_east) - hour_angle), dec

    def to_of_date(self, ra: float, dec: float, unix: float) -> tuple[float, float]:
        """(ra, dec) of date of a J2000 place: precession and nutation."""
        _, (_, matrix) = self._frame(unix)
        return from_vector(rotate(matrix, to_vector(ra, dec)))

    def to_j2000(self, ra: float, dec: float, unix: float) -> tuple[float, float]:
        """(ra, dec) of J2000 of a place of date: the transposed rotation."""
        _, (_, matrix) = self._frame(unix)
        return from_vector(rotate(transpose(matrix), to_vector(ra, dec)))

    def sun(self, unix: float) -> tuple[float, float]:
        """Apparent (ra, dec) of date of the Sun, from the Earth's centre (parallax 9").

        With aberration (20"), unlike every place above: it is the almanacs' place, and where a tube would see it.
        """
        return from_vector(self._almanac(unix).sun(unix))

    def moon(self, unix: float, lat: float, lon_east: float) -> tuple[float, float, float]:
        """Apparent (ra, dec, distance in km) of date of the Moon, as seen from a site at sea level.

        Apparent as the Sun is; of aberration the Moon shows only the light's own second of travel, 0.7".
        """
        seen = self._moon_from(unix, lat, lon_east)
        return *from_vector(seen), math.hypot(*seen)

    def on_moon(
        self, unix: float, lat: float, lon_east: float, moon_lat: float, moon_lon_east: float
    ) -> tuple[float, float]:
        """Apparent (ra, dec) of date of a place on the Moon, as seen from a site; libration and parallax counted."""
        return from_vector(lunar.place(self._moon_from(unix, lat, lon_east), unix, moon_lat, moon_lon_east))

    def planet(self, name: str, unix: float) -> tuple[float, float] | None:
        """(ra, dec) of date of a planet where its light left it, from the Earth's centre; None while not `ready`.

        ``name`` is one of ``PLANETS``. Within 1.5' (Mercury and Venus 0.2', Mars 0.7'; against JPL's ephemerides).
        """
        vector = self._almanac(unix).planet(PLANETS.index(name), unix)
        return None if vector is None else from_vector(vector)

    def _moon_from(self, unix: float, lat: float, lon_east: float) -> Vector:
        """The Moon from a site at sea level: of date, in km."""
        x, y, z = self._almanac(unix).moon(unix)
        phi = math.radians(wrap360(lat))
        polar = (1.0 - _EARTH_FLATTENING) ** 2
        curvature = _EARTH_RADIUS / math.sqrt(math.cos(phi) ** 2 + polar * math.sin(phi) ** 2)
        site = math.radians(self.sidereal_time(unix, lon_east))
        return (
            x - curvature * math.cos(phi) * math.cos(site),
            y - curvature * math.cos(phi) * math.sin(site),
            z - curvature * polar * math.sin(phi),
        )

    def _almanac(self, unix: float) -> Almanac:
        """The best there is for a date."""
        exact = self._exact
        return exact if exact is not None and self._in_use and _EXACT_FROM <= unix < _EXACT_TO else self._closed

    def _frame(self, unix: float) -> tuple[float, Frame]:
        """The minute a moment lies in and the Earth's frame at its start, kept for the next caller.

        Within the minute the axes move less than 0.0001"; sidereal time goes on at the sidereal rate.
        """
        minute = unix - unix % 60.0
        almanac = self._almanac(minute)
        key = almanac, minute
        frame = self._frames.get(key)
        if frame is None:
            if len(self._frames) >= _FRAMES_KEPT:
                self._frames.clear()
            frame = self._frames[key] = almanac.frame(minute)
        return minute, frame
