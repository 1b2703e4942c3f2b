"""The state of a client of a surface, and the settings that all clients of a mount share.

``Session.client`` holds the settings of the client; each protocol has a struct for them, and the next connection
of the same program begins with a copy. ``MountSettings`` holds what a real hand control stores for all programs: it is
frozen, all sessions share it through ``SharedSettings``, and only clients that may change settings replace it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from typing import Annotated, Protocol

from msgspec import Meta, Struct
from msgspec.structs import replace

from gateway.core.errors import ReadOnly
from gateway.core.operations import Values
from gateway.protocols.wireformat.rows import Model


class AltitudeLimits(Protocol):
    """The range of altitudes that the user allows, degrees."""

    @property
    def lowest(self) -> float: ...
    @property
    def highest(self) -> float: ...
    def narrowed(self, lowest: float | None, highest: float | None) -> AltitudeLimits:
        """Return the limits combined with those of a client, which cannot widen them."""

    def check_altitude(self, altitude: float) -> None:
        """Raise a Fault if the altitude of a target is outside the limits."""


class ClientSettings(Struct, frozen=True):
    """The settings that every client of a surface begins with."""

    limits: AltitudeLimits
    precision: str = "high"  # the format of coordinates in replies: high or low
    sync_text: str | None = None  # the reply to a sync; None: that of the presented model
    guides_by_sky: bool = False  # directions of guide pulses are those on the sky, not those of the motors


class NamedSite(Struct, frozen=True, omit_defaults=True):
    """A stored site, degrees, north and east positive. A name is 1 to 15 printable characters without ``#``."""

    name: Annotated[str, Meta(pattern=r"^[ -\"$-~]{1,15}$")] | None = None
    latitude: Annotated[float, Meta(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Meta(ge=-360, le=360)] | None = None


#: The site of a number under which nothing is stored.
UNNAMED_SITE = NamedSite()


class MountSettings(Struct, frozen=True):
    """The settings that all clients of a mount share. The first five are stored in the state file."""

    sites: Mapping[int, NamedSite] = {}
    #: The number of the site that was selected last, from 0; None if none ever was.
    site: int | None = None
    zone: tuple[float, int] | None = None  # hours of the time zone and of daylight saving; the sum is the UTC offset
    pec: bool | None = None  # whether periodic error correction is on, as last set; None if it never was
    motors: Mapping[str, int] = {}  # setting of a motor (``backlash 1 pos``, ``guide rate 2``) -> value
    manual_hertz: float | None = None  # the manual tracking rate, hertz (sidereal is 60.1); None if it never was set
    pulse_ends: Mapping[int, float] = {}  # axis -> Unix time at which its last guide pulse ends

    def site_at(self, index: int) -> NamedSite:
        return self.sites.get(index, UNNAMED_SITE)

    def with_site(self, index: int, site: NamedSite) -> MountSettings:
        """Return a copy with a site replaced."""
        return replace(self, sites={**self.sites, index: site})

    def with_motor_value(self, setting: str, value: int) -> MountSettings:
        """Return a copy with a value of a motor replaced."""
        return replace(self, motors={**self.motors, setting: value})


class SharedSettings:
    """Holds the current settings of a mount. ``changed`` is called when they must be written to the state file."""

    __slots__ = ("changed", "settings")

    def __init__(self, settings: MountSettings = MountSettings(), changed: Callable[[], None] = lambda: None) -> None:
        self.settings, self.changed = settings, changed


class ClientState(Struct):
    """The settings of a client."""

    precision: str


class Session:
    """One client of a surface: its settings, the model presented to it, and the settings shared by all clients.
    ``client``: the settings to begin with, copied. ``on_denied_change`` is called when a read-only client tries to
    change a setting.
    """

    #: Whether the next connection from the same host begins with the settings of this connection.
    inherits_settings = True
    #: The struct for the settings of a client of this protocol.
    client_state_type: type[ClientState] = ClientState
    client: ClientState

    def __init__(
        self,
        model: Model,
        client_settings: ClientSettings,
        clock: Callable[[], float],
        shared_settings: SharedSettings | None = None,
        client: ClientState | None = None,
        on_denied_change: Callable[[], None] | None = None,
    ) -> None:
        self.model, self.client_settings, self.clock = model, client_settings, clock
        self.shared_settings = shared_settings or SharedSettings()
        self._on_denied_change = on_denied_change
        #: The previous frame.
        self.last_frame = b""
        #: Why the current command was refused, if its protocol has no reply form for a refusal; else empty.
        self.refusal_reason = ""
        #: Whether the reply to the current command is a refusal that no other part of the gateway writes to the log.
        self.must_log_refusal = False
        self.client = self.client_state_type(client_settings.precision) if client is None else copy(client)

    def reset_client(self) -> None:
        """Reset the client's settings to their initial values."""
        self.client = self.client_state_type(self.client_settings.precision)

    def use_program_settings(self, settings: Values) -> None:
        """Use the settings that are configured for the client's program, now that the program is recognised."""
        self.client_settings = replace(self.client_settings, **settings)
        self.client.precision = settings.get("precision", self.client.precision)

    @property
    def shared(self) -> MountSettings:
        return self.shared_settings.settings

    def replace_shared(self, settings: MountSettings, *, save: bool = True) -> None:
        """Replace the shared settings, with ``save`` also in the state file. Raises ReadOnly if the client may not."""
        self.check_write_access()
        self.shared_settings.settings = settings
        if save:
            self.shared_settings.changed()

    def check_write_access(self) -> None:
        """Raise ReadOnly unless the client may change settings; for commands whose setting takes effect later."""
        if self._on_denied_change is not None:
            self._on_denied_change()
            raise ReadOnly

    def setting_or_constant(self, name: str) -> object:
        """Return the client's setting of this name; if it has none, the presented model's constant, or None."""
        value = getattr(self.client, name, None)
        return self.model.get(name) if value is None else value
