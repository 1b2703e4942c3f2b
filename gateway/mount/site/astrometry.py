"""Astronomy from site and clock, without asking the mount: positions, axis readings, and every Sun to avoid.

Without a site, operations that need a site raise ``Unsupported``, and the Sun counts as up.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import fold_declination, separation, wrap360
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.safety.sync_sum import NO_SYNC, SyncTotal
from gateway.mount.site.readers import ReadBy
from gateway.mount.site.site_clock import COMPUTER, BestSources, Site, Time
from gateway.protocols.base.driver import Driver

#: Seconds for which the place of the Sun is good, and those of several: over another site they move against the stars.
SUN_CACHE_TIME, SUNS_CACHE_TIME = 60.0, 5.0
#: Degrees: Suns nearer to each other count as one. A Sun that has moved farther has jumped, with a clock or a site.
SAME_SUN_DEGREES, SUN_JUMP_DEGREES = 0.5, 0.1
#: Degrees; a Sun this low may still shine into a tube: refraction, its disk, and a horizon below eye level.
SUN_UP_ALTITUDE = -1.0
#: Degrees by which the tube may be off from where the mount believes to point: so much is alignment and refraction.
OFF = 1.0


class KnownSource(NamedTuple):
    """A site and a time, Unix ``seconds``, by one source."""

    place: op.Place
    seconds: float

    def site(self) -> op.Place:
        return self.place

    def unix(self) -> float:
        """UTC as Unix seconds."""
        return self.seconds


class SiteAstrometry:
    """Astronomy at the site of this mount and by its clock. ``equinox`` is that of the mount's coordinates."""

    def __init__(self, sky: Sky, site_clock: BestSources | ReadBy | KnownSource, equinox: str) -> None:
        self.sky, self.site_clock, self.equinox = sky, site_clock, equinox

    def place(self) -> op.Place:
        """Return the site in force. Raises Unsupported if it is unknown."""
        place = self.site_clock.site()
        if place is None:
            raise Unsupported("The site is not known.")
        return place

    def sidereal_time(self) -> float:
        """Local apparent sidereal time, degrees."""
        return self.sky.sidereal_time(self.site_clock.unix(), self.place().longitude)

    def overhead(self, position: op.Equatorial) -> tuple[float, float] | tuple[None, None]:
        """Return the altitude and the hour angle of a position now, degrees; None for both if the site is unknown."""
        place = self.site_clock.site()
        if place is None:
            return None, None
        unix = self.site_clock.unix()
        altitude = self.sky.horizon(position.ra, position.dec, place.latitude, place.longitude, unix)[1]
        return altitude, self.sky.sidereal_time(unix, place.longitude) - position.ra

    def horizon(self, position: op.Equatorial) -> op.Horizontal:
        """Return azimuth and altitude of a position (equinox of date)."""
        place, unix = self.place(), self.site_clock.unix()
        return op.Horizontal(*self.sky.horizon(position.ra, position.dec, place.latitude, place.longitude, unix))

    def equatorial(self, position: op.Horizontal | op.GotoHorizontal | op.GotoAxes) -> op.Equatorial:
        """Return the position (equinox of date) that is at an azimuth and altitude now."""
        place, unix = self.place(), self.site_clock.unix()
        return op.Equatorial(*self.sky.equatorial(position.az, position.alt, place.latitude, place.longitude, unix))

    def axes(self, position: op.Equatorial, wedge: bool = False) -> op.Horizontal:
        """Return the axis readings of an equatorial mount for a position.

        The first axis of a German mount reads 0 at hour angle 0, that of a fork on its ``wedge`` reads 0 in the north.
        """
        geometry = Geometry(Build.WEDGE if wedge else Build.GERMAN, self.place().latitude)
        first, second = geometry.axes(self.sidereal_time() - position.ra, position.dec, False)
        return op.Horizontal(wrap360(first), second)

    def from_axes(self, goto: op.GotoAxes, wedge: bool = False) -> op.Equatorial:
        """Return the position for axis readings of an equatorial mount; `axes` says from where they count."""
        build = Build.WEDGE if wedge else Build.GERMAN
        hour_angle, dec = Geometry(build, self.place().latitude).sky(goto.az, goto.alt)
        return op.Equatorial(wrap360(self.sidereal_time() - hour_angle), dec)

    def to_mount(self, operation: op.Goto | op.Sync | op.Choose) -> op.Goto | op.Sync | op.Choose:
        """Convert the target of an operation from the equinox of date to the mount's equinox."""
        if self.equinox != "j2000":
            return operation
        ra, dec = self.sky.to_j2000(operation.ra, operation.dec, self.site_clock.unix())
        return replace(operation, ra=ra, dec=dec)

    def from_mount(self, position: op.Equatorial) -> op.Equatorial:
        """Convert a position from the mount's equinox to the equinox of date."""
        if self.equinox != "j2000":
            return position
        return op.Equatorial(*self.sky.to_of_date(position.ra, position.dec, self.site_clock.unix()))


class Shift(NamedTuple):
    """A possible pointing error of the tube, degrees, from syncs.

    In azimuth and altitude, or if ``polar`` in hour angle and declination.
    """

    first: float
    second: float
    polar: bool


class PointingFrame(NamedTuple):
    """How the mount derives axes from coordinates (``polar`` or alt-az), and the pointing errors of syncs."""

    polar: bool = False
    shifts: tuple[Shift, ...] = ()


_POLAR, _ALTAZ = PointingFrame(True), PointingFrame(False)


class TubeFrame:
    """Returns, when called, the present ``PointingFrame``.

    The syncs give the errors. That of the second axis has either sign: beyond the pole or the zenith, and on the other
    side of the pier, it turns the other way.
    """

    def __init__(self, cache: ReadingsCache, driver: Driver, synced: SyncTotal, sources: BestSources) -> None:
        self._cache, self._driver, self._synced, self._sources = cache, driver, synced, sources
        self._polar = False

    def __call__(self) -> PointingFrame:
        status, total = self._cache.value(op.GetStatus), self._synced.value
        self._polar = self._polar if status is None else status.equatorial
        plain = _POLAR if self._polar else _ALTAZ
        if total == NO_SYNC:
            return plain
        polar = self._polar or self._driver.emulates_sync
        place = self._sources.site() if polar else None
        sense = 1.0 if place is not None and place.latitude < 0.0 else -1.0
        candidates = [Shift(sense * first, sense * second, polar) for first, second in total.axes]
        candidates += [shift._replace(second=-shift.second) for shift in candidates if shift.second]
        shifts = tuple(dict.fromkeys(shift for shift in candidates if max(abs(shift.first), abs(shift.second)) > OFF))
        return PointingFrame(self._polar, shifts) if shifts else plain


class Sun(NamedTuple):
    """A Sun to avoid, in the mount's coordinates (equinox of date), with the site and time of its position.

    ``confirmed``: by the mount's own data; only confirmed Suns stop a motion that is under way. With a ``sync_shift``
    its distance is measured from the tube, not from the position that the mount reports.
    """

    ra: float
    dec: float
    confirmed: bool
    time: Time
    site: Site | None = None
    sync_shift: Shift | None = None


class SunAvoidance:
    """Every Sun to avoid while it is up. ``limit`` is the smallest allowed distance, degrees; 0 turns it off.

    The mount's right ascension and declination may be right although its clock is wrong, because it is aligned on
    stars: so the Sun is avoided in these coordinates. Or they are as wrong as its site and clock, by which it turns
    them into axis positions: so the Sun is also avoided where each source of site and time puts it over the horizon
    (for a polar axis, in hour angle). The distance is that of the true direction of the tube.
    """

    def __init__(
        self,
        limit: float,
        astrometry: SiteAstrometry,
        sources: BestSources,
        clock: Callable[[], float],
        frame: Callable[[], PointingFrame],
        settled: asyncio.Event,
        note_once: Callable[[str], None],
    ) -> None:
        self.limit, self._astrometry, self._sky, self._sources = limit, astrometry, astrometry.sky, sources
        self._clock, self._frame_now, self._settled, self._note_once = clock, frame, settled, note_once
        self.frame, self._frame_until = _ALTAZ, float("-inf")
        self._risen_suns: list[Sun] = []
        #: How many of them are ``confirmed``; they come first.
        self.confirmed = 0
        #: Changes when distances from now on cannot be compared with those before: a clock has jumped, the Sun rose.
        self.era = 0
        sources.changed.connect(self._outdated)

    def _outdated(self, _: None) -> None:
        self._frame_until = float("-inf")

    def narrow(self, limit: float) -> None:
        """Set another limit. Distances before and after that cannot be compared."""
        self.limit = limit
        self.era += 1

    def to_avoid(self) -> list[Sun]:
        """Return every Sun to be avoided now."""
        if not self.limit:
            return []
        now, frame = self._clock(), self._frame_now()
        if now >= self._frame_until or frame != self.frame:
            suns = self.suns(frame)
            self._frame_until, self.frame = now + (SUN_CACHE_TIME if len(suns) < 2 else SUNS_CACHE_TIME), frame
            if not _continues(self._risen_suns, suns):
                self.era += 1
            self._risen_suns, self.confirmed = suns, sum(sun.confirmed for sun in suns)
            if self._settled.is_set() and self._sources.best_time().source == COMPUTER:  # before, it may still tell one
                self._note_once("WARNING: the mount has reported no date: this computer's is used to avoid the Sun")
        return self._risen_suns

    def tube(self, position: op.Equatorial, shift: Shift | None) -> op.Equatorial:
        """Return the direction of the tube, in the mount's coordinates, while the mount reports ``position``."""
        if shift is None:
            return position
        if shift.polar:
            return op.Equatorial(*fold_declination(position.ra - shift.first, position.dec + shift.second))
        horizon = self._astrometry.horizon(position)
        shifted = fold_declination(horizon.az + shift.first, horizon.alt + shift.second)
        return self._astrometry.equatorial(op.Horizontal(*shifted))

    def distance(self, position: op.Equatorial, sun: Sun) -> float:
        """Return the distance of the tube from a Sun while the mount reports ``position``, degrees."""
        tube = self.tube(position, sun.sync_shift)
        return separation(tube.ra, tube.dec, sun.ra, sun.dec)

    def distances(self, position: op.Equatorial) -> list[float]:
        """Return the distance of the tube from each direction in which the Sun may stand, degrees.

        Site, clock and syncs may be wrong, so there are several; those by the mount's own data come first.
        """
        return [self.distance(position, sun) for sun in self.to_avoid()]

    def suns(self, frame: PointingFrame, ahead: float = 0.0) -> list[Sun]:
        """Return the Suns to avoid in ``ahead`` seconds, the mount's own first. Without a site they count as up."""
        sky, sites = self._sky, self._sources.sites_for_sun()
        times = [time._replace(unix=time.unix + ahead) for time in self._sources.times()]
        places = [sky.sun(time.unix) for time in times]
        if not sites:
            return _different([Sun(*place, time is times[0], time) for place, time in zip(places, times, strict=True)])
        up = [risen for time, place in zip(times, places, strict=True) for risen in self._risen(sites, time, place)]
        if not up:
            return []
        known = up[0] if up[0].time is times[0] and up[0].site is sites[0] else None
        suns = [Sun(*places[0], known is not None, up[0].time, up[0].site)]
        for time, place in zip(times[1:], places[1:], strict=True):
            suns += [Sun(*place, False, time, risen.site) for risen in up if risen.time is time][:1]
        for risen in up:
            for shift in frame.shifts or ((None,) if risen is not known else ()):
                direction = self._in_own_coordinates(risen, frame.polar, sites[0].place, times[0].unix)
                suns.append(Sun(*direction, risen is known, risen.time, risen.site, shift))
        return _different(sorted(suns, key=lambda sun: not sun.confirmed))

    def _risen(self, sites: list[Site], time: Time, place: Pair) -> Iterator[_Risen]:
        """Yield the sites over whose horizon a Sun is up at a time."""
        for site in sites:
            over = self._sky.horizon(*place, site.place.latitude, site.place.longitude, time.unix)
            if over[1] >= SUN_UP_ALTITUDE:
                yield _Risen(time, site, place, over)

    def _in_own_coordinates(self, risen: _Risen, polar: bool, place: op.Place, unix: float) -> Pair:
        """Return the position that the mount reports, by its own site ``place`` and time, when its axes point at a Sun
        of another source.
        """
        if not polar:
            return self._sky.equatorial(*risen.over, place.latitude, place.longitude, unix)
        turned = self._sky.sidereal_time(risen.time.unix, risen.site.place.longitude)
        return risen.place[0] + self._sky.sidereal_time(unix, place.longitude) - turned, risen.place[1]


class _Risen(NamedTuple):
    """A Sun that is up by a source of time and site: right ascension and declination, azimuth and altitude at that
    site.
    """

    time: Time
    site: Site
    place: Pair
    over: Pair


def _different(suns: list[Sun]) -> list[Sun]:
    """Return the Suns without those at the position of an earlier Sun."""
    distinct: list[Sun] = []
    for sun in suns:
        same = (other for other in distinct if other.sync_shift == sun.sync_shift)
        if not any(separation(*sun[:2], *other[:2]) < SAME_SUN_DEGREES for other in same):
            distinct.append(sun)
    return distinct


def _continues(before: list[Sun], now: list[Sun]) -> bool:
    """Whether distances from the Suns can be compared with those a moment ago: only the sky has turned."""
    return len(before) == len(now) and all(
        then.confirmed == sun.confirmed
        and then.sync_shift == sun.sync_shift
        and separation(*then[:2], *sun[:2]) < SUN_JUMP_DEGREES
        for then, sun in zip(before, now, strict=True)
    )
