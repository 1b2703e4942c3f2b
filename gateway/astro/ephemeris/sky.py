"""The sky over a site: sidereal time, alt-azimuth, equinox of date, Sun, Moon and planets.

Right ascension and declination are of the equinox of date (true equator), geometric: no aberration and no
refraction but where a method says so. Degrees, longitude EAST positive, Unix time (UTC) in seconds.
Importing this costs nothing: `Sky.start` loads astropy on a thread, which makes tables of each day that is asked for
and of the next one, so that midnight finds its tables, and commands read between their rows. Where there is none yet,
if astropy cannot be loaded, and before 1900 and after 2099, closed forms answer. Nobody waits, no method raises for
finite arguments, nothing is ever fetched. After `load` alone (tests, a replay, a rehearsal) a table is worked out when
it is asked for: the same question, the same answer.

                      closed forms        by astropy
    sidereal time     0.02 s + UT1-UTC    0.005 s
    of date / J2000   0.4"                0.03"
    Sun               0.01 deg            0.03"
    Moon              0.04 deg            3" rms, 19" at worst
    planets           none                1.5'
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from gateway.astro.ephemeris import closed_forms
from gateway.astro.ephemeris.closed_forms import Frame
from gateway.astro.ephemeris.day_table import DAY, PARTS, DayTable
from gateway.astro.offline import go_offline
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

TYPE_CHECKING = False  # importing `typing` is more work than importing all this
if TYPE_CHECKING:
    from queue import SimpleQueue

_FROM = -2208988800.0  # 1900-01-01
_TO = 4102444800.0  # 2100-01-01
_DAYS_ASKED = 4  # that may wait to be worked out: a program that sets clocks about piles up no work
_TABLES_KEPT = 16 * len(PARTS)  # the days at hand: the host's clock, the mount's, a replayed transcript's
_FRAMES_KEPT = 16  # the minutes at hand: the host's clock, the mount's, a replayed transcript's
_EARTH_RADIUS = 6378.137  # km, at the equator (WGS 84)
_EARTH_FLATTENING = 1.0 / 298.257223563


class TableLoader:
    """``table`` finds what there is; ``start``, ``use`` and ``load`` decide how it gets there."""

    def __init__(self) -> None:
        self._make: Callable[[str, int], DayTable] | None = None
        self._in_use = True
        self._tables: dict[tuple[str, int], DayTable] = {}
        self._queue: SimpleQueue[int] | None = None
        self._asked: set[int] = set()
        self.failure = ""
        """Why astropy could not be loaded, in words; empty while all is well."""

    @property
    def ready(self) -> bool:
        """True once astropy's answers are in use."""
        return self._make is not None and self._in_use

    def start(self, done: Callable[[], object] | None = None) -> None:
        """Load astropy on a daemon thread, which then works out the days that are asked for; returns at once.

        Where the thread calls ``done`` after the first days, its tables are not in use before somebody calls ``use``.
        """
        import threading  # with what `load` imports, all that would make this module slow to import
        from queue import SimpleQueue

        self._in_use, self._queue = done is None, SimpleQueue()
        self._ask(int(time.time() // DAY))
        threading.Thread(target=self._work, args=(self._queue, done), name="sky", daemon=True).start()

    def use(self) -> None:
        """From now on astropy's answers are given."""
        self._in_use = True

    def load(self) -> None:
        """What `start` does first, in the caller's own time. Never raises: sets `ready`, or `failure`."""
        try:
            go_offline()
            from gateway.astro.ephemeris.by_astropy import day_table

            for part in PARTS:  # so that a fault shows here and not in a command
                day_table(part, 0)
            self._make = day_table
        except Exception as fault:  # whatever a broken installation can raise; closed forms go on
            self.failure = f"astronomy stays approximate: {type(fault).__name__}: {fault}"

    def table(self, part: str, unix: float) -> DayTable | None:
        """The table a moment lies in; None where there is none, or none yet."""
        if not _FROM <= unix < _TO:
            return None
        day = int(unix // DAY)
        table = self._tables.get((part, day))
        if self._queue is not None:
            if table is None or (part, day + 1) not in self._tables:
                self._ask(day)
        elif table is None and self._make is not None:
            table = self._work_out(part, day)
        return table if self._in_use else None

    def _ask(self, day: int) -> None:
        """Have the thread work out a day, once."""
        if self._queue is not None and day not in self._asked and len(self._asked) < _DAYS_ASKED:
            self._asked.add(day)
            self._queue.put(day)

    def _work(self, asked: SimpleQueue[int], done: Callable[[], object] | None) -> None:
        self.load()
        while not self.failure:
            day = asked.get()
            for part, one in ((part, one) for one in (day, day + 1) for part in PARTS):
                if (part, one) not in self._tables:
                    self._work_out(part, one)
            self._asked.discard(day)
            if done is not None and asked.empty():
                done()
                done = None

    def _work_out(self, part: str, day: int) -> DayTable:
        """Make a table and keep it in the place of the oldest; only one thread ever does this."""
        assert self._make is not None
        table = self._make(part, day)
        if len(self._tables) >= _TABLES_KEPT:
            del self._tables[next(iter(self._tables))]
        self._tables[part, day] = table
        return table


class Sky(TableLoader):
    """Answers from closed forms at once, and from astropy's tables where there are any."""

    def __init__(self) -> None:
        super().__init__()
        self._frames: dict[tuple[DayTable | None, float], Frame] = {}

    def sidereal_time(self, unix: float, longitude_east: float) -> float:
        """Apparent sidereal time in [0, 360)."""
        return wrap360(self._turned(unix, longitude_east))

    def _turned(self, unix: float, longitude_east: float) -> float:
        """The same before it is brought into the circle."""
        minute, (greenwich, _) = self._frame(unix)
        return greenwich + SIDEREAL_RATE * (unix - minute) + longitude_east % 360.0

    def horizon(self, ra: float, dec: float, site_lat: float, site_lon_east: float, unix: float) -> tuple[float, float]:
        """(azimuth in [0, 360), altitude in [-90, 90]) of a place of date."""
        return hour_angle_to_horizon(self._turned(unix, site_lon_east) - ra % 360.0, dec, site_lat)

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
        return from_vector(self._vector("Sun", unix) or closed_forms.sun(unix))

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
        seen = self._moon_from(unix, lat, lon_east)
        return from_vector(closed_forms.place_on_moon(seen, unix, moon_lat, moon_lon_east))

    def planet(self, name: str, unix: float) -> tuple[float, float] | None:
        """(ra, dec) of date of a planet where its light left it, from the Earth's centre; None while not `ready`.

        Within 1.5' (Mercury and Venus 0.2', Mars 0.7'; against JPL's ephemerides).
        """
        vector = self._vector(name, unix)
        return None if vector is None else from_vector(vector)

    def _moon(self, unix: float) -> Vector:
        """The Moon from the Earth's centre: of date, in km."""
        return self._vector("Moon", unix) or closed_forms.moon(unix)

    def _moon_from(self, unix: float, lat: float, lon_east: float) -> Vector:
        """The Moon from a site at sea level: of date, in km."""
        x, y, z = self._moon(unix)
        phi = math.radians(wrap360(lat))
        polar = (1.0 - _EARTH_FLATTENING) ** 2
        curvature = _EARTH_RADIUS / math.sqrt(math.cos(phi) ** 2 + polar * math.sin(phi) ** 2)
        site = math.radians(self.sidereal_time(unix, lon_east))
        return (
            x - curvature * math.cos(phi) * math.cos(site),
            y - curvature * math.cos(phi) * math.sin(site),
            z - curvature * polar * math.sin(phi),
        )

    def _frame(self, unix: float) -> tuple[float, Frame]:
        """The minute a moment lies in and the Earth's frame at its start, kept for the next caller.

        Within the minute the axes move less than 0.0001"; sidereal time goes on at the sidereal rate.
        """
        minute = unix - unix % 60.0
        table = self.table("frame", minute)
        key = table, minute
        frame = self._frames.get(key)
        if frame is None:
            if len(self._frames) >= _FRAMES_KEPT:
                self._frames.clear()
            frame = _frame_of(table, minute % DAY) if table else closed_forms.frame(minute)
            self._frames[key] = frame
        return minute, frame

    def _vector(self, part: str, unix: float) -> Vector | None:
        """Where Sun, Moon or a planet stands, of date; None where there is no table."""
        table = self.table(part, unix)
        if table is None:
            return None
        x, y, z = table.at(unix % DAY)
        return x, y, z


def _frame_of(table: DayTable, seconds: float) -> Frame:
    """The Earth's frame by a table, at a second of its day."""
    greenwich, *m = table.at(seconds)
    return greenwich + SIDEREAL_RATE * seconds, ((m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8]))
