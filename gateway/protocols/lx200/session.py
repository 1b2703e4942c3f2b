"""The settings of a client of the LX200 surface."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Literal

from msgspec import Struct

from gateway.astro.catalog.objects import CatalogObject
from gateway.core.operations import Fields, MoonPlace, PlanetPlace, Rate
from gateway.protocols.base.session import AltitudeLimits, ClientState, Session

#: The default place on the Moon, for the coordinate that a client has not set.
_MOON_CENTRE = MoonPlace(0.0, 0.0)


class ClockDraft(Struct):
    """The parts of a clock that a client has set and that are not sent to the mount yet.
    ``time``: seconds of the day, and the host's time when it was set. ``offset``: local time minus UTC, hours.
    ``changed_at``: when the last part was set. ``set_by_one_command``: one command has set date and time.
    ``carried_parts``: parts kept from the clock sent last.
    """

    time: tuple[float, float] | None = None
    day: date | None = None
    offset: float | None = None
    changed_at: float = 0.0
    set_by_one_command: bool = False
    carried_parts: frozenset[str] = frozenset()

    @property
    def is_complete(self) -> bool:
        """Whether the client has set time, date and offset; parts kept from an earlier clock do not count."""
        return None not in (self.time, self.day, self.offset) and not self.carried_parts

    def clear(self) -> None:
        """Forget all parts, because they are being sent."""
        self.time = self.day = self.offset = None
        self.changed_at, self.set_by_one_command, self.carried_parts = 0.0, False, frozenset()


class LibraryLimits(Struct, frozen=True):
    """Limits of a library search, as Meade names them: magnitude ``brighter`` and size ``larger`` are the lower ones.
    Sizes and the field's diameter are in arcminutes; ``quality`` is the lowest."""

    brighter: float = -5.5
    fainter: float = 20.0
    field: int = 15
    larger: int = 0
    smaller: int = 200
    types: str = "GPDCO"
    quality: str = "VP"


class LxClientState(ClientState):
    """The settings of a client. Angles are degrees; None means never set."""

    ra: float | None = None
    dec: float | None = None
    az: float | None = None
    alt: float | None = None
    #: The selected object: an entry of a catalogue or a moving object, and its description.
    selected_entry: CatalogObject | None = None
    moving_object: MoonPlace | PlanetPlace | None = None
    object_text: str | None = None
    moon_place: MoonPlace = _MOON_CENTRE
    #: The chosen catalogues; None after a catalogue was refused. The default of ``star_catalog`` depends on the model.
    deep_sky_catalog: str | None = "NGC"
    star_catalog: int | Literal["model"] | None = "model"
    #: The catalogues chosen in the mount's own library, by command.
    mount_catalogs: Mapping[str, Fields] = {}
    search: LibraryLimits = LibraryLimits()
    #: Altitude limits, degrees, and the fastest slew, degrees per second.
    lowest: float | None = None
    highest: float | None = None
    fastest: float | None = None
    #: The rate of motion by hand, and the rates for one axis, degrees per second.
    rate: Rate | None = None
    rate_ra: float | None = None
    rate_dec: float | None = None
    focus_speed: int = 2
    #: Whether the client requested land mode: its gotos then leave tracking off.
    land_mode: bool = False
    #: The site that this client has selected, from 0.
    site_index: int | None = None
    #: Local time minus UTC, hours; the clock being set; the date set last, and the host's time then; the date and
    #: seconds of the day sent last, the host's time then, and the offset in hours.
    utc_offset: float | None = None
    clock_draft: ClockDraft | None = None
    date_set: tuple[date, float] | None = None
    local_time_sent: tuple[date, float, float, float] | None = None
    twelve_hour_clock: bool = False
    help_lines: tuple[str, ...] = ()
    help_line: int = 0

    def deselect(self) -> None:
        """Forget the selected object, but keep its coordinates."""
        self.selected_entry = self.moving_object = self.object_text = None

    def select_nothing(self, reason: str) -> None:
        """Clear the target after a failed selection; ``reason`` is the text of the replies to :LI and the next :MS."""
        self.deselect()
        self.ra = self.dec = None
        self.object_text = reason


class LxSession(Session):
    """The session of an LX200 client."""

    client_state_type = LxClientState
    client: LxClientState

    @property
    def limits(self) -> AltitudeLimits:
        """The altitude limits in force for this client."""
        return self.client_settings.limits.narrowed(self.client.lowest, self.client.highest)
