"""Astronomy from site and clock, without asking the mount: positions, axis readings, and the directions of the Sun.

Sources of site and time may disagree about where the Sun is; each of these directions is a "Sun" to avoid.
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
from gateway.mount.site.readers import SiteView
from gateway.mount.site.site_clock import COMPUTER_SOURCE, SiteTimeSources, SourcedSite, SourcedTime
from gateway.protocols.base.driver import Driver

#: Seconds for which the Suns are cached: if there is one, and if there are several, because some move in RA and dec.
SUN_CACHE_TIME, SUNS_CACHE_TIME = 60.0, 5.0
#: Degrees: Suns nearer to each other than this count as the same; a Sun that moved by more shows a new clock or site.
SAME_SUN_DEGREES, SUN_JUMP_DEGREES = 0.5, 0.1
#: Degrees: from this altitude on the Sun counts as up, for refraction, its disk, and a horizon below eye level.
SUN_UP_ALTITUDE = -1.0
#: Degrees: a smaller pointing error of the tube is ignored, because alignment and refraction cause such errors.
MIN_SHIFT = 1.0


class FixedSiteTime(NamedTuple):
    """The site and time (``unix_seconds``) of one particular source, for a comparison with the others."""

    place: op.Place
    unix_seconds: float

    def site(self) -> op.Place:
        return self.place

    def unix(self) -> float:
        """Return the time of this source, Unix seconds."""
        return self.unix_seconds


class SiteAstrometry:
    """Astronomy by the site and time of ``site_clock``. ``equinox``: that of the mount's coordinates, j2000 or jnow."""

    def __init__(self, sky: Sky, site_clock: SiteTimeSources | SiteView | FixedSiteTime, equinox: str) -> None:
        self.sky, self.site_clock, self.equinox = sky, site_clock, equinox

    def site(self) -> op.Place:
        """Return the site that the calculations use. Raises Unsupported if it is unknown."""
        place = self.site_clock.site()
        if place is None:
            raise Unsupported("The site is not known.")
        return place

    def sidereal_time(self) -> float:
        """Return the local apparent sidereal time, degrees. Raises Unsupported if the site is unknown."""
        return self.sky.sidereal_time(self.site_clock.unix(), self.site().longitude)

    def alt_and_ha(self, position: op.Equatorial) -> tuple[float, float] | tuple[None, None]:
        """Return the altitude and the hour angle of a position now, degrees; None for both if the site is unknown."""
        place = self.site_clock.site()
        if place is None:
            return None, None
        unix = self.site_clock.unix()
        altitude = self.sky.az_alt(position.ra, position.dec, place.latitude, place.longitude, unix)[1]
        return altitude, self.sky.sidereal_time(unix, place.longitude) - position.ra

    def horizontal(self, position: op.Equatorial) -> op.Horizontal:
        """Return the azimuth and altitude of a position (equinox of date) now."""
        place, unix = self.site(), self.site_clock.unix()
        return op.Horizontal(*self.sky.az_alt(position.ra, position.dec, place.latitude, place.longitude, unix))

    def equatorial_of(self, position: op.Horizontal | op.GotoHorizontal | op.GotoAxes) -> op.Equatorial:
        """Return the position (equinox of date) that is at an azimuth and altitude now."""
        place, unix = self.site(), self.site_clock.unix()
        return op.Equatorial(*self.sky.to_ra_dec(position.az, position.alt, place.latitude, place.longitude, unix))

    def axes_of(self, position: op.Equatorial, on_wedge: bool = False) -> op.Horizontal:
        """Return the axis readings of an equatorial mount for a position. The first axis of a German
        mount reads 0 at hour angle 0, that of a fork on a wedge reads 0 in the north.
        """
        geometry = Geometry(Build.WEDGE if on_wedge else Build.GERMAN, self.site().latitude)
        first, second = geometry.to_axes(self.sidereal_time() - position.ra, position.dec, False)
        return op.Horizontal(wrap360(first), second)

    def from_axes(self, goto: op.GotoAxes, on_wedge: bool = False) -> op.Equatorial:
        """Return the position for axis readings of an equatorial mount: the inverse of `axes_of`."""
        build = Build.WEDGE if on_wedge else Build.GERMAN
        hour_angle, dec = Geometry(build, self.site().latitude).ha_dec_of_axes(goto.az, goto.alt)
        return op.Equatorial(wrap360(self.sidereal_time() - hour_angle), dec)

    def to_mount_equinox(self, operation: op.Goto | op.Sync | op.Choose) -> op.Goto | op.Sync | op.Choose:
        """Convert the target of an operation from the equinox of date to the mount's equinox."""
        if self.equinox != "j2000":
            return operation
        ra, dec = self.sky.to_j2000(operation.ra, operation.dec, self.site_clock.unix())
        return replace(operation, ra=ra, dec=dec)

    def from_mount_equinox(self, position: op.Equatorial) -> op.Equatorial:
        """Convert a position from the mount's equinox to the equinox of date."""
        if self.equinox != "j2000":
            return position
        return op.Equatorial(*self.sky.from_j2000(position.ra, position.dec, self.site_clock.unix()))


class SyncShift(NamedTuple):
    """A pointing error of the tube that syncs may have caused, degrees: in azimuth (``first``) and altitude
    (``second``), or if ``polar``, in hour angle and declination.
    """

    first: float
    second: float
    polar: bool


class PointingFrame(NamedTuple):
    """How the mount derives axes from coordinates (``polar`` or alt-az), and pointing errors that syncs may cause."""

    polar: bool = False
    shifts: tuple[SyncShift, ...] = ()


_POLAR, _ALTAZ = PointingFrame(True), PointingFrame(False)


class TubeFrame:
    """Returns, when called, the present ``PointingFrame``. The sum of syncs gives its pointing errors.

    Both signs of the error of the second axis are possible, because that axis turns the other way beyond the pole or
    the zenith, and on the other side of the pier.
    """

    def __init__(self, cache: ReadingsCache, driver: Driver, sync_total: SyncTotal, sources: SiteTimeSources) -> None:
        self._cache, self._driver, self._sync_total, self._sources = cache, driver, sync_total, sources
        self._polar = False

    def __call__(self) -> PointingFrame:
        status, total = self._cache.last_value(op.GetStatus), self._sync_total.value
        self._polar = self._polar if status is None else status.equatorial
        plain = _POLAR if self._polar else _ALTAZ
        if total == NO_SYNC:
            return plain
        polar = self._polar or self._driver.emulates_sync
        place = self._sources.site() if polar else None
        sense = 1.0 if place is not None and place.latitude < 0.0 else -1.0
        candidates = [SyncShift(sense * first, sense * second, polar) for first, second in total.axis_turns]
        candidates += [shift._replace(second=-shift.second) for shift in candidates if shift.second]
        shifts = tuple(
            dict.fromkeys(shift for shift in candidates if max(abs(shift.first), abs(shift.second)) > MIN_SHIFT)
        )
        return PointingFrame(self._polar, shifts) if shifts else plain


class Sun(NamedTuple):
    """A possible direction of the Sun, in the mount's coordinates (equinox of date), and its source of site and time.

    ``confirmed``: calculated from the mount's own site and time; others end only motion by arrow keys. With a
    ``sync_shift``, distances are measured from where the tube points if it has this pointing error.
    """

    ra: float
    dec: float
    confirmed: bool
    time: SourcedTime
    site: SourcedSite | None = None
    sync_shift: SyncShift | None = None


class SunAvoidance:
    """The directions of the Sun to avoid while it is up. ``min_distance``: smallest allowed distance, degrees; 0: none.

    A mount that is aligned on stars has the right coordinates even if its clock is wrong. So the Sun is avoided at its
    right ascension and declination. Any other mount calculates its axis positions from coordinates by its site and
    clock, which may be wrong. So the Sun is also avoided at its azimuth and altitude (for a polar axis, hour angle and
    declination) by each source of site and time.
    """

    def __init__(
        self,
        min_distance: float,
        astrometry: SiteAstrometry,
        sources: SiteTimeSources,
        clock: Callable[[], float],
        get_frame: Callable[[], PointingFrame],
        site_read: asyncio.Event,
        note_once: Callable[[str], None],
    ) -> None:
        self.min_dist, self._astrometry, self._sky, self._sources = min_distance, astrometry, astrometry.sky, sources
        self._clock, self._get_frame, self._site_read, self._note_once = clock, get_frame, site_read, note_once
        self.frame, self._suns_valid_until = _ALTAZ, float("-inf")
        self._risen_suns: list[Sun] = []
        #: The number of ``confirmed`` Suns; these come first in the list.
        self.confirmed_sun_count = 0
        #: A number that grows when new distances cannot be compared with earlier ones: a clock jumped, or the Sun rose.
        self.reset_count = 0
        sources.changed.connect(self._on_sources_changed)

    def _on_sources_changed(self, _: None) -> None:
        self._suns_valid_until = float("-inf")

    def set_min_distance(self, min_distance: float) -> None:
        """Set the smallest allowed distance, degrees. Distances are no longer compared with earlier ones."""
        self.min_dist = min_distance
        self.reset_count += 1

    def suns_to_avoid(self) -> list[Sun]:
        """Return a Sun for each direction that it may have now by any source (cached); none without a limit."""
        if not self.min_dist:
            return []
        now, frame = self._clock(), self._get_frame()
        if now >= self._suns_valid_until or frame != self.frame:
            suns = self.calculate_suns(frame)
            self._suns_valid_until, self.frame = now + (SUN_CACHE_TIME if len(suns) < 2 else SUNS_CACHE_TIME), frame
            if not _are_comparable(self._risen_suns, suns):
                self.reset_count += 1
            self._risen_suns, self.confirmed_sun_count = suns, sum(sun.confirmed for sun in suns)
            # before the site is read, the mount may still report a date
            if self._site_read.is_set() and self._sources.best_time().source == COMPUTER_SOURCE:
                self._note_once("WARNING: the mount has reported no date: this computer's is used to avoid the Sun")
        return self._risen_suns

    def pointing(self, position: op.Equatorial, shift: SyncShift | None) -> op.Equatorial:
        """Return where the tube points, in the mount's coordinates, if the mount reports ``position``."""
        if shift is None:
            return position
        if shift.polar:
            return op.Equatorial(*fold_declination(position.ra - shift.first, position.dec + shift.second))
        horizon = self._astrometry.horizontal(position)
        shifted = fold_declination(horizon.az + shift.first, horizon.alt + shift.second)
        return self._astrometry.equatorial_of(op.Horizontal(*shifted))

    def distance(self, position: op.Equatorial, sun: Sun) -> float:
        """Return the distance of the tube from a Sun, degrees, if the mount reports ``position``."""
        tube = self.pointing(position, sun.sync_shift)
        return separation(tube.ra, tube.dec, sun.ra, sun.dec)

    def distances(self, position: op.Equatorial) -> list[float]:
        """Return the distance of the tube from each Sun to avoid, degrees, if the mount reports ``position``. Distances
        from confirmed Suns come first.
        """
        return [self.distance(position, sun) for sun in self.suns_to_avoid()]

    def calculate_suns(self, frame: PointingFrame, seconds_ahead: float = 0.0) -> list[Sun]:
        """Return the Suns to avoid ``seconds_ahead`` seconds from now. Without a site the Sun counts as up."""
        sky, sites = self._sky, self._sources.sites_for_sun()
        times = [time._replace(unix=time.unix + seconds_ahead) for time in self._sources.times()]
        places = [sky.sun(time.unix) for time in times]
        if not sites:
            return _distinct([Sun(*place, time is times[0], time) for place, time in zip(places, times, strict=True)])
        up = [risen for time, place in zip(times, places, strict=True) for risen in self._suns_up(sites, time, place)]
        if not up:
            return []
        known = up[0] if up[0].time is times[0] and up[0].site is sites[0] else None
        suns = [Sun(*places[0], known is not None, up[0].time, up[0].site)]
        for time, place in zip(times[1:], places[1:], strict=True):
            suns += [Sun(*place, False, time, risen.site) for risen in up if risen.time is time][:1]
        for risen in up:
            for shift in frame.shifts or ((None,) if risen is not known else ()):
                direction = self._in_mount_coordinates(risen, frame.polar, sites[0].place, times[0].unix)
                suns.append(Sun(*direction, risen is known, risen.time, risen.site, shift))
        return _distinct(sorted(suns, key=lambda sun: not sun.confirmed))

    def _suns_up(self, sites: list[SourcedSite], time: SourcedTime, ra_dec: Pair) -> Iterator[_RisenSun]:
        """Yield the Sun for each site where it is up at this time. ``ra_dec``: its right ascension and declination."""
        for site in sites:
            over = self._sky.az_alt(*ra_dec, site.place.latitude, site.place.longitude, time.unix)
            if over[1] >= SUN_UP_ALTITUDE:
                yield _RisenSun(time, site, ra_dec, over)

    def _in_mount_coordinates(self, risen: _RisenSun, polar: bool, site: op.Place, unix: float) -> Pair:
        """Return the position that the mount would report if its axes pointed at the azimuth and altitude of this Sun
        (if ``polar``: hour angle and declination). ``site`` and ``unix``: the mount's site and time.
        """
        if not polar:
            return self._sky.to_ra_dec(*risen.horizontal, site.latitude, site.longitude, unix)
        turned = self._sky.sidereal_time(risen.time.unix, risen.site.place.longitude)
        return risen.equatorial[0] + self._sky.sidereal_time(unix, site.longitude) - turned, risen.equatorial[1]


class _RisenSun(NamedTuple):
    """The right ascension and declination (``equatorial``), and the azimuth and altitude (``horizontal``), of the Sun
    above the horizon by one source of time and one source of site.
    """

    time: SourcedTime
    site: SourcedSite
    equatorial: Pair
    horizontal: Pair


def _distinct(suns: list[Sun]) -> list[Sun]:
    """Return the Suns in this order, without any that is at the position of an earlier one."""
    distinct: list[Sun] = []
    for sun in suns:
        same = (other for other in distinct if other.sync_shift == sun.sync_shift)
        if not any(separation(*sun[:2], *other[:2]) < SAME_SUN_DEGREES for other in same):
            distinct.append(sun)
    return distinct


def _are_comparable(before: list[Sun], now: list[Sun]) -> bool:
    """Whether these are the same Suns as before, and none has jumped, so that distances can be compared."""
    return len(before) == len(now) and all(
        then.confirmed == sun.confirmed
        and then.sync_shift == sun.sync_shift
        and separation(*then[:2], *sun[:2]) < SUN_JUMP_DEGREES
        for then, sun in zip(before, now, strict=True)
    )
