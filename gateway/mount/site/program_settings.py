"""The site and clock that each program has set and the mount has not accepted: only that program reads them back.

A program is a host on one surface (``mount/presence.py``). A setting that the mount accepts is removed here. Other
programs and the limits use the newest site and clock of any program only if no other source is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.operations import Moment, Place, SetSite
from gateway.mount.presence import ProgramId

#: The largest number of programs whose settings are stored: those that have set something last.
MAX_PROGRAMS = 200

Clock = tuple[Moment, float]


class SiteOfProgram(Struct, frozen=True):
    """A complete site that a program has set, degrees, north and east positive. It survives a restart. ``host`` (of the
    program) and ``date`` are text for messages.
    """

    latitude: Annotated[float, Meta(ge=-90, le=90)]
    longitude: Annotated[float, Meta(ge=-360, le=360)]
    host: str = ""
    date: str = ""

    @property
    def place(self) -> Place:
        return Place(self.latitude, wrap180(self.longitude))

    @property
    def source(self) -> str:
        """Who has set this site, and when, as text: ``a program (10.0.0.5, 2026-01-15)``."""
        return f"a program ({', '.join(word for word in (self.host, self.date) if word)})"


def make_site_of_program(program: ProgramId, site: Place, unix: float) -> SiteOfProgram:
    """Return a record of this program's site; ``unix``: this computer's time, Unix seconds."""
    return SiteOfProgram(site.latitude, site.longitude, program.host, f"{datetime.fromtimestamp(unix, UTC):%Y-%m-%d}")


class SettingsOfProgram(Struct, frozen=True):
    """The settings of a program: a complete site; a latitude or longitude without the other (``half_site``); a clock
    and the loop time at which it was set; a zone that was set without a clock (hours, local time minus UTC).
    """

    site: Place | None = None
    half_site: SetSite | None = None
    clock: Clock | None = None
    zone: float | None = None


NO_SETTINGS = SettingsOfProgram()


class ProgramSettings:
    """Each program's site and clock that the mount has not accepted; ``last_site``: the newest site of any program."""

    def __init__(self) -> None:
        self._by_program: dict[ProgramId, SettingsOfProgram] = {}
        self.last_site: SiteOfProgram | None = None

    def settings_of(self, program: ProgramId) -> SettingsOfProgram:
        return self._by_program.get(program, NO_SETTINGS)

    def put(self, program: ProgramId, settings: SettingsOfProgram) -> None:
        self._by_program.pop(program, None)
        if settings != NO_SETTINGS:
            self._by_program[program] = settings
        if len(self._by_program) > MAX_PROGRAMS:
            del self._by_program[next(iter(self._by_program))]

    def __iter__(self) -> Iterator[SettingsOfProgram]:
        return iter(self._by_program.values())

    @property
    def newest_clock(self) -> Clock | None:
        """The last clock that any program has set and the mount has not accepted; None if there is none."""
        return max(
            (settings.clock for settings in self if settings.clock is not None),
            key=lambda clock: clock[1],
            default=None,
        )

    def set_site(self, program: ProgramId, site: Place, unix: float) -> None:
        """Store a complete site of a program; ``unix``: this computer's time, Unix seconds."""
        self.put(program, replace(self.settings_of(program), site=site, half_site=None))
        self.last_site = make_site_of_program(program, site, unix)

    def forget(self, kind: Literal["site", "clock"], program: ProgramId | None = None) -> None:
        """Remove the site or clock of a program, or of all (None): these then read the values of the best source."""
        for program_, settings in list(self._by_program.items()):
            if program in (None, program_):
                self.put(program_, replace(settings, site=None) if kind == "site" else replace(settings, clock=None))
        if kind == "site" and (program is None or (self.last_site is not None and self.last_site.host == program.host)):
            self.last_site = None
