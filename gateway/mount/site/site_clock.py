"""Site and clock: the ones that clients get, and the ones that the limits use, which come from the best source.

An unaligned hand control gets what clients set. An aligned one keeps its own, because setting it could cost the
alignment, and the gateway then returns the client's values itself. Nothing here waits for the mount.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.about import RELEASED
from gateway.core.operations import GetClock, GetGps, GetSite, Gps, Moment, Operation, Place, SetClock, SetSite
from gateway.core.signals import Signal

#: Degrees and seconds; if the mount's site or clock changes by more, it was set at the mount.
SITE_EQUAL = 1.0 / 60.0
CLOCK_EQUAL = 30.0
#: Seconds for which a reading of the mount's GPS is cached, with a fix and without.
GPS_FIX, GPS_SEARCH = 300.0, 30.0
#: Seconds: a computer's clock that is so near to the mount's or its GPS is right, however doubtful it is otherwise.
AGREES = 120.0
MOUNT, GPS, CONFIGURED, COMPUTER, PROGRAM = (
    "the mount", "its GPS", "the configuration", "this computer", "a program")  # fmt: skip


class Site(NamedTuple):
    """A site and its source."""

    place: Place
    source: str


class Time(NamedTuple):
    """UTC as Unix seconds at this moment, its source, and whether it may be lost (a computer without a battery)."""

    unix: float
    source: str
    doubtful: bool = False


class SiteClock:
    """Owns every known site and clock of one mount.

    ``now`` is a clock that never goes back; ``host`` returns this computer's time, Unix seconds. ``trust`` is the
    owner's word on it (auto, right, doubtful), ``kernel`` what the kernel says of it. ``changed`` is emitted
    when the site or clock in force may have changed.
    """

    def __init__(
        self,
        now: Callable[[], float],
        host: Callable[[], float],
        site: Place | None,
        trust: str = "auto",
        kernel: Callable[[], bool] | None = None,
    ) -> None:
        self._now, self.host = now, host
        self._trust, self._kernel = trust, kernel
        self.configured = site
        self.mount_site: Place | None = None
        self.client_site: Place | None = None
        self.half: SetSite | None = None
        self.mount_clock: tuple[Moment, float] | None = None
        self.client_clock: tuple[Moment, float] | None = None
        self.gps_site: Place | None = None
        self.gps_clock: tuple[Moment, float] | None = None
        self._gps: tuple[Gps, float] | None = None
        self.changed: Signal[None] = Signal()

    # --- site and clock in force ------------------------------------------------------------------------------------

    def site(self) -> Place | None:
        """Return the site in force: the one a client set, else the mount's, else the configured one."""
        place = self.client_site or self.mount_site or self.configured
        if self.half is None:
            return place
        latitude = self.half.latitude if self.half.latitude is not None else (place.latitude if place else None)
        longitude = self.half.longitude if self.half.longitude is not None else (place.longitude if place else None)
        return place if latitude is None or longitude is None else Place(latitude, wrap180(longitude))

    def site_set_by_clients(self) -> Place | None:
        """Return the site that clients set, if the mount has not taken it."""
        return None if self.client_site is None and self.half is None else self.site()

    def clock(self) -> Moment | None:
        """Return the clock in force, running; None if no client has set one and the mount has not reported its own."""
        return self.running(self.client_clock or self.mount_clock)

    def running(self, held: tuple[Moment, float] | None) -> Moment | None:
        """Return what a clock that was read some time ago shows now."""
        if held is None:
            return None
        moment, at = held
        return Moment(unix=moment.unix + self._now() - at, offset=moment.offset, dst=moment.dst)

    def unix(self) -> float:
        """UTC by the clock in force, else by this computer's, Unix seconds."""
        moment = self.clock()
        return self.host() if moment is None else moment.unix

    def doubts(self, host: float) -> bool:
        """Whether this computer's time ``host`` may be lost."""
        if self._trust != "auto":
            return self._trust == "doubtful"
        return host < RELEASED or (self._kernel is not None and self._kernel())

    # --- new values -------------------------------------------------------------------------------------------------

    def take_mount_site(self, place: Place, ours: bool = False) -> bool:
        """Take the mount's site. Return whether it was changed at the mount; then it also replaces what clients set.

        A change that results from the gateway's own setting (``ours``) does not count.
        """
        before, self.mount_site = self.mount_site, place
        changed = not ours and before is not None and not _same_place(before, place)
        if changed:
            self.client_site = None
        self.changed.emit(None)
        return changed

    def take_mount_clock(self, moment: Moment, ours: bool = False) -> bool:
        """Like ``take_mount_site``, for the clock; a change is more than 30 s."""
        before = self.running(self.mount_clock)
        self.mount_clock = (moment, self._now())
        changed = not ours and before is not None and abs(before.unix - moment.unix) > CLOCK_EQUAL
        if changed:
            self.client_clock = None
        self.changed.emit(None)
        return changed

    def take_gps(self, seen: Gps) -> None:
        """Take what the mount's GPS reports; without a fix only the state of the receiver is kept."""
        self._gps = seen, self._now()
        if seen.linked:
            self.gps_site = seen.place or self.gps_site
            self.gps_clock = (Moment(seen.unix, 0.0), self._now()) if seen.unix else self.gps_clock
        self.changed.emit(None)

    def gps(self) -> Gps | None:
        """Return the last GPS reading, its time running on; None if it is too old."""
        if self._gps is None:
            return None
        seen, at = self._gps
        age = self._now() - at
        return replace(seen, unix=seen.unix + age) if age < (GPS_FIX if seen.linked else GPS_SEARCH) else None

    def set_site_half(self, operation: SetSite) -> SetSite | None:
        """Take one or both halves of a site. Return the whole site once both were set."""
        held = self.half or SetSite()
        self.half = SetSite(
            latitude=operation.latitude if operation.latitude is not None else held.latitude,
            longitude=operation.longitude if operation.longitude is not None else held.longitude,
        )
        self.changed.emit(None)
        return self.half if None not in (self.half.latitude, self.half.longitude) else None

    def take_site(self) -> SetSite | None:
        """Return the site to send now: the halves that were set, completed by known values; None if one is missing."""
        if self.half is None:
            return None
        place = self.site()
        if place is None:
            return None
        self.half = None
        self.changed.emit(None)
        return SetSite(latitude=place.latitude, longitude=place.longitude)

    def same_site(self, operation: SetSite) -> bool:
        """Whether this is the mount's site already, within an arcminute."""
        place = self.mount_site
        if place is None or operation.latitude is None or operation.longitude is None:
            return False
        return _same_place(place, Place(operation.latitude, operation.longitude))

    def same_clock(self, operation: SetClock, seconds: float) -> bool:
        """Whether the mount's clock shows this already, in the same zone and within so many seconds."""
        shown = self.running(self.mount_clock)
        return shown is not None and shown.offset == operation.offset and abs(shown.unix - operation.unix) <= seconds

    def keep_site(self, operation: SetSite) -> None:
        """Return this site to clients from now on, whatever the mount reports."""
        assert operation.latitude is not None and operation.longitude is not None
        self.client_site = Place(operation.latitude, wrap180(operation.longitude))
        self.changed.emit(None)

    def keep_clock(self, operation: SetClock) -> None:
        self.client_clock = (Moment(operation.unix, operation.offset, operation.dst), self._now())
        self.changed.emit(None)

    def known(self, kind: type[Operation]) -> Place | Moment | Gps | None:
        """Return the cached answer to GetSite, GetClock or GetGps, None if there is none."""
        if kind is GetSite:
            return self.site()
        if kind is GetGps:
            return self.gps()
        return self.clock() if kind is GetClock else None

    def has_own(self, operation: Operation) -> bool:
        """Whether the mount has reported a site or clock of its own, which can be returned instead of this one."""
        if isinstance(operation, SetClock):
            return self.mount_clock is not None
        return isinstance(operation, SetSite) and self.mount_site is not None

    def has_one_of(self, places: Sequence[SetSite]) -> bool:
        """Whether the mount's site matches one of these in latitude or longitude."""
        here = self.mount_site
        return here is not None and any(
            (one.latitude is not None and abs(here.latitude - one.latitude) <= SITE_EQUAL)
            or (one.longitude is not None and abs(wrap180(here.longitude - one.longitude)) <= SITE_EQUAL)
            for one in places
        )

    def forget_sites(self) -> None:
        """Forget the site that clients set."""
        self.client_site = self.half = None
        self.changed.emit(None)

    def forget(self, operation: Operation) -> None:
        """Forget the site or clock that clients set: the mount's own is in force."""
        if isinstance(operation, SetClock):
            self.client_clock = None
        elif isinstance(operation, SetSite):
            self.client_site = None
        self.changed.emit(None)


class BestSources:
    """Site and time from the best source: used by the limits and by ``SiteAstrometry``.

    The mount's own are the best, because its coordinates are calculated from them. Then follow its GPS receiver, the
    configuration (site) or this computer's clock (time), unless that is doubtful. What clients set is used last: any
    client may be misconfigured, and the limits belong to the owner of the telescope.
    """

    def __init__(self, site_clock: SiteClock) -> None:
        self._site_clock = site_clock
        #: Emitted when one of them may have changed.
        self.changed = site_clock.changed

    def sites(self) -> list[Site]:
        """Return every known site, best first."""
        known = self._site_clock
        sources = (
            (known.mount_site, MOUNT),
            (known.gps_site, GPS),
            (known.configured, CONFIGURED),
            (known.site_set_by_clients(), PROGRAM),
        )
        return [Site(place, source) for place, source in sources if place is not None]

    def times(self) -> list[Time]:
        """Return every time that counts, best first.

        A computer whose clock is doubtful counts only if neither the mount nor its GPS tells a time, and a program's
        clock only if that of this computer is doubtful as well.
        """
        known = self._site_clock
        found = [
            Time(moment.unix, source)
            for moment, source in ((known.running(known.mount_clock), MOUNT), (known.running(known.gps_clock), GPS))
            if moment is not None
        ]
        host = known.host()
        if not known.doubts(host) or any(abs(time.unix - host) <= AGREES for time in found):
            return [*found, Time(host, COMPUTER)]
        program = known.running(known.client_clock)
        told = [Time(program.unix, PROGRAM)] if program is not None else []
        return found or [*told, Time(host, COMPUTER, doubtful=True)]

    def site(self) -> Place | None:
        """Return the site in force for the limits; None if it is unknown."""
        known = self._site_clock
        return known.mount_site or known.gps_site or known.configured or known.site_set_by_clients()

    def best_time(self) -> Time:
        """Return the first of ``times``. If the mount has reported one, the others need not be computed."""
        known = self._site_clock
        moment = known.running(known.mount_clock)
        return self.times()[0] if moment is None else Time(moment.unix, MOUNT)

    def unix(self) -> float:
        """UTC in force for the limits, Unix seconds."""
        return self.best_time().unix


def _same_place(one: Place, other: Place) -> bool:
    """Whether two sites are within an arcminute, the resolution of hand controls."""
    return (
        abs(one.latitude - other.latitude) <= SITE_EQUAL and abs(wrap180(one.longitude - other.longitude)) <= SITE_EQUAL
    )
