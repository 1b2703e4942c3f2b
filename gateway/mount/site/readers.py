"""Site and clock from the view of one program: the values that it has set itself, else those of the best source."""

from __future__ import annotations

from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.operations import GetClock, GetGps, GetSite, Gps, Moment, Operation, Place, SetClock, SetSite
from gateway.mount.presence import ProgramId
from gateway.mount.site.program_settings import SettingsOfProgram
from gateway.mount.site.site_clock import SiteClock, SiteTimeSources


class SiteView:
    """Site and clock as one program reads and sets them: it reads back its own settings, whatever the mount reports."""

    def __init__(self, site_clock: SiteClock, program: ProgramId) -> None:
        self._site_clock, self._program = site_clock, program

    @property
    def settings(self) -> SettingsOfProgram:
        """The settings of this program that the mount has not accepted."""
        return self._site_clock.program_settings.settings_of(self._program)

    # --- reading ----------------------------------------------------------------------------------------------------

    def site(self) -> Place | None:
        """Return the program's site, else that of the best source, with a coordinate set alone; None if unknown."""
        settings = self.settings
        place, half = settings.site or self._site_clock.best_site(), settings.half_site
        if half is None:
            return place
        latitude = half.latitude if half.latitude is not None else (place.latitude if place else None)
        longitude = half.longitude if half.longitude is not None else (place.longitude if place else None)
        return place if latitude is None or longitude is None else Place(latitude, wrap180(longitude))

    def clock(self) -> Moment | None:
        """Return the present time by the clock that the program has set, else by the mount's; None if neither exists.
        A zone that the program has set without a clock replaces the UTC offset.
        """
        settings = self.settings
        moment = self._site_clock.present_time(settings.clock or self._site_clock.mount_clock)
        return moment if moment is None or settings.zone is None else Moment(moment.unix, settings.zone)

    def unix(self) -> float:
        """Return UTC by this program's ``clock``, else by the best source, Unix seconds."""
        moment = self.clock()
        return SiteTimeSources(self._site_clock).unix() if moment is None else moment.unix

    def answer(self, kind: type[Operation]) -> Place | Moment | Gps | None:
        """Return the known answer to GetSite, GetClock or GetGps; None if there is none, or for another operation."""
        if kind is GetSite:
            return self.site()
        if kind is GetGps:
            return self._site_clock.gps_reading()
        return self.clock() if kind is GetClock else None

    def has_own_site(self) -> bool:
        settings = self.settings
        return settings.site is not None or settings.half_site is not None

    def has_own_clock(self) -> bool:
        """Whether the program has set a clock or a zone of its own."""
        settings = self.settings
        return settings.clock is not None or settings.zone is not None

    # --- setting ----------------------------------------------------------------------------------------------------

    def set_site_half(self, operation: SetSite) -> bool:
        """Store a latitude, a longitude or both; return whether the program has now set both."""
        held = self.settings.half_site or SetSite()
        half = SetSite(
            latitude=operation.latitude if operation.latitude is not None else held.latitude,
            longitude=operation.longitude if operation.longitude is not None else held.longitude,
        )
        self._store(replace(self.settings, half_site=half))
        return None not in (half.latitude, half.longitude)

    def take_completed_site(self) -> SetSite | None:
        """Return the site to send, and forget its parts; None if there is nothing to send. A latitude or longitude that
        was not set is that of the previous site.
        """
        place = self.site()
        if self.settings.half_site is None or place is None:
            return None
        self._store(replace(self.settings, half_site=None))
        return SetSite(latitude=place.latitude, longitude=place.longitude)

    def store_site(self, operation: SetSite) -> None:
        assert operation.latitude is not None and operation.longitude is not None
        place = Place(operation.latitude, wrap180(operation.longitude))
        self._site_clock.program_settings.set_site(self._program, place, self._site_clock.computer_time())
        self._site_clock.changed.emit(None)
        self._site_clock.save_due.emit(None)

    def store_clock(self, operation: SetClock) -> None:
        moment = Moment(operation.unix, operation.offset, operation.dst)
        self._store(replace(self.settings, clock=(moment, self._site_clock.now()), zone=None))

    def store_zone(self, offset: float) -> None:
        """Store a zone that the program sets without a clock: hours, local time minus UTC."""
        self._store(replace(self.settings, zone=offset))

    def forget_site(self) -> None:
        """Forget the program's site, so that the program reads the site of the best source."""
        self._site_clock.program_settings.forget("site", self._program)
        self._store(replace(self.settings, half_site=None))

    def _store(self, settings: SettingsOfProgram) -> None:
        self._site_clock.program_settings.put(self._program, settings)
        self._site_clock.changed.emit(None)
