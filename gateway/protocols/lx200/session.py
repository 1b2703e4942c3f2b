"""What one client of the LX200 surface has set for itself."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Literal

from msgspec import Struct

from gateway.astro.catalog.objects import Entry
from gateway.core.operations import Fields, MoonPlace, PlanetPlace, Rate
from gateway.protocols.base.session import AltitudeLimits, Kept, Session

#: The place on the Moon whose halves were not set yet.
_MIDDLE = MoonPlace(0.0, 0.0)


class Draft(Struct):
    """Pieces of a clock that were set and not handed on yet. ``time`` is seconds of a day, and when that was said.

    ``carried`` (``time``, ``day``) are those that come of a time which was handed on before, and not of this client's
    next pieces.
    """

    time: tuple[float, float] | None = None
    day: date | None = None
    offset: float | None = None
    touched: float = 0.0
    stamped: bool = False
    carried: frozenset[str] = frozenset()

    @property
    def complete(self) -> bool:
        """Whether everything is there that makes an instant."""
        return None not in (self.time, self.day, self.offset) and not self.carried

    def clear(self) -> None:
        """Everything in it was handed on."""
        self.time = self.day = self.offset = None
        self.touched, self.stamped, self.carried = 0.0, False, frozenset()


class SearchLimits(Struct, frozen=True):
    """What ``browse`` and ``identify`` go by: magnitudes, sizes in arcminutes, kinds, quality, the field's diameter."""

    brighter: float = -5.5
    fainter: float = 20.0
    field: int = 15
    larger: int = 0
    smaller: int = 200
    types: str = "GPDCO"
    quality: str = "VP"


class LxKept(Kept):
    """Angles are degrees; None is what was never set."""

    ra: float | None = None
    dec: float | None = None
    az: float | None = None
    alt: float | None = None
    #: The object that was selected: from a catalogue, or one that moves, and its name.
    entry: Entry | None = None
    moving: MoonPlace | PlanetPlace | None = None
    object: str | None = None
    moon: MoonPlace = _MIDDLE
    #: The catalogues that were chosen: None where one was refused. ``stars`` begins with what the model has.
    deep_sky: str | None = "NGC"
    stars: int | Literal["model"] | None = "model"
    #: The same in the mount's own library, by command.
    own_catalogs: Mapping[str, Fields] = {}
    search: SearchLimits = SearchLimits()
    #: Altitude limits, and the fastest slew, degrees a second.
    lowest: float | None = None
    highest: float | None = None
    fastest: float | None = None
    #: The rate of the arrows, and those of one axis alone, degrees a second.
    rate: Rate | None = None
    rate_ra: float | None = None
    rate_dec: float | None = None
    focus_speed: int = 2
    #: Land mode was asked for: a stopped drive stays stopped.
    land: bool = False
    #: The site that this client has selected, from 0.
    site: int | None = None
    #: Hours, local minus UTC; the local time and date that were handed on or set, with the host's time then.
    offset: float | None = None
    draft: Draft | None = None
    dated: tuple[date, float] | None = None
    local: tuple[date, float, float, float] | None = None
    twelve: bool = False
    help: tuple[str, ...] = ()
    help_line: int = 0

    def deselect(self) -> None:
        """The target is no object any more."""
        self.entry = self.moving = self.object = None

    def select_nothing(self, words: str) -> None:
        """A selection has failed: no goto follows to the last one. These words say why, to :LI and to the next :MS."""
        self.deselect()
        self.ra = self.dec = None
        self.object = words


class LxSession(Session):
    state = LxKept
    kept: LxKept

    @property
    def limits(self) -> AltitudeLimits:
        """The altitude limits in force for this client."""
        return self.settings.limits.narrowed(self.kept.lowest, self.kept.highest)
