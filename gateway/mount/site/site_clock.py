"""All known sites and clocks of a mount, and which of them counts: the limits use the best source.

An unaligned hand control gets the values that programs set. An aligned hand control keeps its own, because setting them
could cost the alignment: the gateway then returns a program's values to that program alone (``program_settings.py``),
and those of the best source to all others. Nothing here waits for the mount.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core.about import EARLIEST_VALID_TIME
from gateway.core.operations import Gps, Moment, Operation, Place, SetClock, SetSite
from gateway.core.signals import Signal
from gateway.mount.site.program_settings import ProgramSettings, SiteOfProgram

#: Degrees and seconds: if the mount's site or clock differs from the last by more, somebody has set it.
SITE_TOLERANCE = 1.0 / 60.0
CLOCK_TOLERANCE = 30.0
#: If a program changes the mount's site by so many degrees, the Sun is avoided at the former site for so many seconds.
MIN_SITE_CHANGE, FORMER_SITE_TIME = 2.0, 12 * 3600.0
#: Degrees within which another source confirms a site.
CONFIRM_DISTANCE = 0.5
#: Seconds for which a reading of the mount's GPS is cached, with a fix and without.
GPS_CACHE_TIME, GPS_RETRY_TIME = 300.0, 30.0
#: Seconds: a doubtful clock of this computer is used if it differs by no more from the mount's or GPS time.
MAX_CLOCK_DIFFERENCE = 120.0
#: The sources of a site or time, as text for messages.
MOUNT_SOURCE, GPS_SOURCE, CONFIG_SOURCE, COMPUTER_SOURCE, PROGRAM, FORMER_SITE_SOURCE = (
    "the mount", "its GPS", "the configuration", "this computer", "a program", "the site before")  # fmt: skip


class SourcedSite(NamedTuple):
    """A site and its source. ``set_by``: the host of the program that has set this site in the mount, empty if none."""

    place: Place
    source: str
    set_by: str = ""

    @property
    def source_text(self) -> str:
        """The source, and the program that has set this site, as text."""
        return f"{self.source}, as {self.set_by} set it," if self.set_by else self.source


class SourcedTime(NamedTuple):
    """The present time (UTC, Unix seconds), its source, and whether it may be wrong (a computer without a battery).
    ``set_by``: the host of the program that has set the mount's clock; empty if no program has.
    """

    unix: float
    source: str
    doubtful: bool = False
    set_by: str = ""

    @property
    def source_text(self) -> str:
        """The source, and the program that has set this clock, as text."""
        return f"{self.source} (set by {self.set_by})" if self.set_by else self.source


class SiteClock:
    """Stores every known site and clock of a mount.

    ``now`` returns monotonic seconds, ``computer_time`` this computer's time (Unix seconds). ``clock_trust``: the
    owner's setting for that time (auto, right, doubtful). ``kernel_doubts_clock`` returns whether the kernel reports
    that time as not synchronised; without the function it counts as right from ``EARLIEST_VALID_TIME`` on.
    ``changed`` is emitted when the best site or clock, or that of a program, may have changed.
    """

    def __init__(
        self,
        now: Callable[[], float],
        computer_time: Callable[[], float],
        configured_site: Place | None,
        clock_trust: str = "auto",
        kernel_doubts_clock: Callable[[], bool] | None = None,
    ) -> None:
        self.now, self.computer_time = now, computer_time
        self._clock_trust, self._kernel_doubts = clock_trust, kernel_doubts_clock
        self.configured_site = configured_site
        self.mount_site: Place | None = None
        self.mount_clock: tuple[Moment, float] | None = None
        #: The hosts of the programs that have set the mount's site and clock; empty if they are the mount's own.
        self.site_set_by = self.clock_set_by = ""
        #: The mount's site before a program changed it, and the time of the change (``now``).
        self._former_site: tuple[Place, float] | None = None
        #: The site that the owner has set on the page.
        self.confirmed_site: Place | None = None
        self.program_settings = ProgramSettings()
        #: The site that a program set in an earlier run. It is used once the gateway has asked the mount for its site.
        self.stored_site: SiteOfProgram | None = None
        self._site_requested = False
        self.gps_site: Place | None = None
        self.gps_clock: tuple[Moment, float] | None = None
        self._gps: tuple[Gps, float] | None = None
        self.changed: Signal[None] = Signal()
        #: Emitted when the site that is saved for a restart may have changed.
        self.save_due: Signal[None] = Signal()

    # --- site and clock in force ------------------------------------------------------------------------------------

    def site_of_program(self) -> SiteOfProgram | None:
        """Return the last site that a program has set, in this run or an earlier; None if the mount reports one."""
        if self.mount_site is not None:
            return None
        return self.program_settings.last_site or (self.stored_site if self._site_requested else None)

    def site_to_store(self) -> SiteOfProgram | None:
        """Return the last site of a program, to store it for a restart; None if the mount or its GPS reports a site."""
        known = self.mount_site is not None or self.gps_site is not None
        return None if known else self.program_settings.last_site or self.stored_site

    def best_site(self) -> Place | None:
        """Return the site of the best source; None if none is known."""
        place = self.mount_site or self.gps_site or self.configured_site
        if place is None and (site := self.site_of_program()) is not None:
            place = site.place
        return place

    def former_site(self) -> Place | None:
        """Return the mount's site before programs changed it by more than 2 degrees, at once or in steps. None after
        12 h, and once the owner, GPS or the configuration confirms the new site.
        """
        site, known = self.mount_site, self._former_site
        if site is None or known is None or self.now() - known[1] >= FORMER_SITE_TIME or self._is_confirmed(site):
            return None
        return known[0] if earth_distance(site, known[0]) > MIN_SITE_CHANGE else None

    def _is_confirmed(self, site: Place) -> bool:
        others = (self.gps_site, self.configured_site, self.confirmed_site)
        return any(place is not None and earth_distance(site, place) <= CONFIRM_DISTANCE for place in others)

    def present_time(self, sample: tuple[Moment, float] | None) -> Moment | None:
        """Return the present time by a clock that was read before. ``sample``: its time, and ``now`` at that moment."""
        if sample is None:
            return None
        moment, at = sample
        return Moment(unix=moment.unix + self.now() - at, offset=moment.offset, dst=moment.dst)

    def doubts_computer_time(self, computer_time: float) -> bool:
        """Whether this computer's time ``computer_time``, Unix seconds, may be wrong."""
        if self._clock_trust != "auto":
            return self._clock_trust == "doubtful"
        return computer_time < EARLIEST_VALID_TIME or (self._kernel_doubts is not None and self._kernel_doubts())

    # --- new values -------------------------------------------------------------------------------------------------

    def take_mount_site(self, site: Place, sent_by_gateway: bool = False, set_by: str | None = None) -> bool:
        """Store the site that the mount reports. Return whether somebody has changed it at the mount; if so, forget the
        sites of programs. ``sent_by_gateway``: the gateway has sent this site, for a program on the host ``set_by``;
        None leaves the recorded host unchanged.
        """
        before = self.mount_site
        if before is None or not _same_place(before, site):  # some tell minutes of what was set to seconds
            self.mount_site = site
        if before is None:
            self.stored_site = None
            self.save_due.emit(None)
        changed = not sent_by_gateway and before is not None and not _same_place(before, site)
        if changed:
            self.program_settings.forget("site")
            self._former_site = None
        elif before is not None and not _same_place(before, site):
            counts = self._former_site is not None and self.now() - self._former_site[1] < FORMER_SITE_TIME
            self._former_site = self._former_site if counts and not self._is_confirmed(before) else (before, self.now())
        self.site_set_by = "" if changed else self.site_set_by if set_by is None else set_by
        self.changed.emit(None)
        return changed

    def take_mount_clock(self, moment: Moment, sent_by_gateway: bool = False, set_by: str | None = None) -> bool:
        """Store the time that the mount reports. Return whether somebody has changed its clock by more than 30 s at the
        mount; if so, forget the clocks of programs. Arguments: as for ``take_mount_site``.
        """
        before = self.present_time(self.mount_clock)
        self.mount_clock = (moment, self.now())
        changed = not sent_by_gateway and before is not None and abs(before.unix - moment.unix) > CLOCK_TOLERANCE
        if changed:
            self.program_settings.forget("clock")
        self.clock_set_by = "" if changed else self.clock_set_by if set_by is None else set_by
        self.changed.emit(None)
        return changed

    def take_gps(self, gps: Gps) -> None:
        """Store a reading of the mount's GPS; without a fix, site and time of an earlier fix stay."""
        self._gps = gps, self.now()
        if gps.linked:
            self.gps_site = gps.place or self.gps_site
            self.gps_clock = (Moment(gps.unix, 0.0), self.now()) if gps.unix else self.gps_clock
        self.changed.emit(None)

    def gps_reading(self) -> Gps | None:
        """Return the last GPS reading with its time advanced to now; None if it is too old."""
        if self._gps is None:
            return None
        gps, at = self._gps
        age = self.now() - at
        return replace(gps, unix=gps.unix + age) if age < (GPS_CACHE_TIME if gps.linked else GPS_RETRY_TIME) else None

    def note_site_requested(self) -> None:
        """Note that the mount was asked for its site. If it has none, the site of an earlier run is used now."""
        if not self._site_requested:
            self._site_requested = True
            self.changed.emit(None)

    def is_mount_site(self, operation: SetSite) -> bool:
        """Whether the mount has this site already, within an arcminute."""
        place = self.mount_site
        if place is None or operation.latitude is None or operation.longitude is None:
            return False
        return _same_place(place, Place(operation.latitude, operation.longitude))

    def is_mount_clock(self, operation: SetClock, tolerance: float) -> bool:
        """Whether the mount's clock has this time already, in the same zone and within ``tolerance`` seconds."""
        shown = self.present_time(self.mount_clock)
        return shown is not None and shown.offset == operation.offset and abs(shown.unix - operation.unix) <= tolerance

    def has_reported(self, operation: Operation) -> bool:
        """Whether the mount has reported a value of the kind that this operation sets: a site or a clock."""
        if isinstance(operation, SetClock):
            return self.mount_clock is not None
        return isinstance(operation, SetSite) and self.mount_site is not None

    def matches_any_site(self, sites: Sequence[SetSite]) -> bool:
        """Whether the mount's site has the latitude or the longitude of any of these, within an arcminute."""
        site = self.mount_site
        return site is not None and any(
            (place.latitude is not None and abs(site.latitude - place.latitude) <= SITE_TOLERANCE)
            or (place.longitude is not None and abs(wrap180(site.longitude - place.longitude)) <= SITE_TOLERANCE)
            for place in sites
        )

    def forget(self, operation: Operation) -> None:
        """Forget the sites or clocks (whichever this operation sets) of all programs: they read the mount's again."""
        if isinstance(operation, SetClock | SetSite):
            self.program_settings.forget("clock" if isinstance(operation, SetClock) else "site")
        self.changed.emit(None)


class SiteTimeSources:
    """The known sites and times, best source first: for the limits and for ``SiteAstrometry``.

    The mount's own site and clock are the best, because its coordinates are calculated from them. Then follow its GPS
    receiver, the configuration (site) or this computer's clock (time), unless that is doubtful. Settings of clients are
    used last: any client may be misconfigured, and the limits belong to the owner of the telescope.
    """

    def __init__(self, site_clock: SiteClock) -> None:
        self._site_clock = site_clock
        #: Emitted when a site or time may have changed.
        self.changed = site_clock.changed

    def sites(self) -> list[SourcedSite]:
        """Return every known site, best first. A program's site is used only if there is no other."""
        known = self._site_clock
        sites = [
            SourcedSite(place, source, by)
            for place, source, by in (
                (known.mount_site, MOUNT_SOURCE, known.site_set_by), (known.gps_site, GPS_SOURCE, ""),
                (known.configured_site, CONFIG_SOURCE, ""))
            if place is not None
        ]  # fmt: skip
        if sites or (site := known.site_of_program()) is None:
            return sites
        return [SourcedSite(site.place, site.source)]

    def sites_for_sun(self) -> list[SourcedSite]:
        """Return every site at which the Sun is avoided if it is up: all known sites and the former site, if any."""
        former = self._site_clock.former_site()
        return [*self.sites(), *([SourcedSite(former, FORMER_SITE_SOURCE)] if former is not None else [])]

    def times(self) -> list[SourcedTime]:
        """Return every usable time, best first.

        A doubtful clock of this computer is used only if it agrees with the mount's or GPS time within 120 s, or if
        neither of these is known. A program's clock is used only if neither is known and this computer's is doubtful.
        """
        known = self._site_clock
        times = [
            SourcedTime(moment.unix, source, set_by=known.clock_set_by if source is MOUNT_SOURCE else "")
            for moment, source in (
                (known.present_time(known.mount_clock), MOUNT_SOURCE),
                (known.present_time(known.gps_clock), GPS_SOURCE),
            )
            if moment is not None
        ]
        host = known.computer_time()
        if not known.doubts_computer_time(host) or any(abs(time.unix - host) <= MAX_CLOCK_DIFFERENCE for time in times):
            return [*times, SourcedTime(host, COMPUTER_SOURCE)]
        program = known.present_time(known.program_settings.newest_clock)
        known_times = [SourcedTime(program.unix, PROGRAM)] if program is not None else []
        return times or [*known_times, SourcedTime(host, COMPUTER_SOURCE, doubtful=True)]

    def site(self) -> Place | None:
        """Return the site of the best source, for the limits; None if no site is known."""
        return self._site_clock.best_site()

    def best_time(self) -> SourcedTime:
        """Return the time of the best source: the first of ``times``."""
        known = self._site_clock
        moment = known.present_time(known.mount_clock)
        return self.times()[0] if moment is None else SourcedTime(moment.unix, MOUNT_SOURCE, set_by=known.clock_set_by)

    def unix(self) -> float:
        """Return UTC by the best source, Unix seconds, for the limits."""
        return self.best_time().unix


def earth_distance(site: Place, other: Place) -> float:
    """Return the distance between two sites, degrees on the Earth."""
    return separation(site.longitude, site.latitude, other.longitude, other.latitude)


def _same_place(site: Place, other: Place) -> bool:
    """Whether two sites are within an arcminute, the resolution of hand controls."""
    return (
        abs(site.latitude - other.latitude) <= SITE_TOLERANCE
        and abs(wrap180(site.longitude - other.longitude)) <= SITE_TOLERANCE
    )
