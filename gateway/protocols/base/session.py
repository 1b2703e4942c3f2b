"""What belongs to one client of a surface, and what all clients of a mount have in common.

``Session.kept`` is what the client itself has set; each protocol has its own struct for that, and the next connection
of the same program begins with a copy of it. ``MountSettings`` is what a real hand control would keep for everybody: a
frozen value in a box that all sessions hold, so it can only be replaced, and only by who may.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Protocol

from msgspec import Meta, Struct
from msgspec.structs import replace

from gateway.core.errors import ReadOnly
from gateway.protocols.wireformat.rows import Model


class AltitudeLimits(Protocol):
    """The altitudes that the operator allows, in degrees."""

    @property
    def lowest(self) -> float: ...
    @property
    def highest(self) -> float: ...
    def narrowed(self, lowest: float | None, highest: float | None) -> AltitudeLimits: ...
    def check_altitude(self, altitude: float) -> None: ...


class ClientSettings(Struct, frozen=True):
    """What holds for every client of a surface, until it sets something else."""

    limits: AltitudeLimits
    precision: str = "high"
    sync_text: str | None = None


class NamedSite(Struct, frozen=True, omit_defaults=True):
    """One of the four: degrees, north and east positive. A name is 1 to 15 printable characters without ``#``."""

    name: Annotated[str, Meta(pattern=r"^[ -\"$-~]{1,15}$")] | None = None
    latitude: Annotated[float, Meta(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Meta(ge=-360, le=360)] | None = None


#: A site of which nothing is stored.
UNNAMED = NamedSite()


class MountSettings(Struct, frozen=True):
    """What all clients of a mount have in common. The first five outlive the gateway.

    ``zone`` is in hours, with those of daylight saving; ``motors`` are values of the two motors by their names
    (``backlash 1 pos``, ``guide rate 2``); ``pulse_ends`` is when the last guide pulse of an axis is over, Unix time.
    """

    sites: Mapping[int, NamedSite] = {}
    #: The site that was selected last, from 0; None: none ever was.
    site: int | None = None
    zone: tuple[float, int] | None = None
    pec: bool | None = None
    motors: Mapping[str, int] = {}
    manual_hertz: float | None = None
    pulse_ends: Mapping[int, float] = {}

    def stored(self, index: int) -> NamedSite:
        return self.sites.get(index, UNNAMED)

    def with_site(self, index: int, site: NamedSite) -> MountSettings:
        """The same with something else stored of one site."""
        return replace(self, sites={**self.sites, index: site})

    def with_motor(self, name: str, value: int) -> MountSettings:
        """The same with another value of a motor."""
        return replace(self, motors={**self.motors, name: value})


class Shared:
    """The settings of a mount as they are now. ``changed`` is called when the lasting part is another one."""

    __slots__ = ("changed", "settings")

    def __init__(self, settings: MountSettings = MountSettings(), changed: Callable[[], None] = lambda: None) -> None:
        self.settings, self.changed = settings, changed


class Kept(Struct):
    """What a client has set for itself."""

    precision: str


class Session:
    """What belongs to one client of a surface: what it has set, what it is presented, and what it has in common."""

    #: Whether the next connection of the same host goes on with what this one has set.
    inherits = True
    #: What a client of this protocol can set for itself.
    state: type[Kept] = Kept
    kept: Kept

    def __init__(
        self, model: Model, settings: ClientSettings, clock: Callable[[], float], shared: Shared | None = None
    ) -> None:
        self.model, self.settings, self.clock = model, settings, clock
        self.common = shared or Shared()
        #: For a client that only looks: called when it tries to set something.
        self.may_not_set: Callable[[], None] | None = None
        #: The frame before this one.
        self.last = b""
        #: What the command just handled asked for in vain, where its protocol has no form to say so; empty: nothing.
        self.refused = ""
        self.forget()

    def forget(self) -> None:
        """This client's state as at power-on."""
        self.kept = self.state(self.settings.precision)

    @property
    def shared(self) -> MountSettings:
        return self.common.settings

    def set_for_all(self, settings: MountSettings, *, lasting: bool = True) -> None:
        """Set what all clients have in common; ``lasting``: it outlives the gateway. Raises ReadOnly."""
        self.check_may_set()
        self.common.settings = settings
        if lasting:
            self.common.changed()

    def check_may_set(self) -> None:
        """For what is set later than it is answered. Raises ReadOnly for a client that only looks."""
        if self.may_not_set is not None:
            self.may_not_set()
            raise ReadOnly

    def known(self, name: str) -> object:
        """A kept value, else the presented model's constant, else None."""
        value = getattr(self.kept, name, None)
        return self.model.get(name) if value is None else value
