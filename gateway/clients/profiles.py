"""How a surface is presented on one port: its coordinates, and the profiles of known client programs.

A client program is recognised by its first bytes. Everything behind the surface uses the equinox of date; for clients
that use J2000, coordinates are converted in both directions.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.ephemeris.sky import Sky
from gateway.core import operations as op
from gateway.core.operations import Values
from gateway.protocols.base.frames import Framer
from gateway.protocols.base.session import ClientSettings
from gateway.protocols.base.surface import Surface
from gateway.protocols.wireformat.rows import Model


class EquinoxConverter:
    """Converts a client's J2000 coordinates to the equinox of date, and replies back to J2000."""

    def __init__(self, sky: Sky, unix_time: Callable[[], float]) -> None:
        self._sky, self._unix_time = sky, unix_time

    def to_equinox_of_date(self, operation: op.Operation) -> op.Operation:
        """Return an operation with its coordinates converted to the equinox of date."""
        if isinstance(operation, op.Goto | op.Sync | op.ToJ2000 | op.Choose):
            ra, dec = self._sky.from_j2000(operation.ra, operation.dec, self._unix_time())
            return replace(operation, ra=ra, dec=dec)
        return operation

    def to_client(self, operation: op.Operation, value: object) -> object:
        """Return ``value``, the controller's answer to an operation, with its coordinates converted to J2000."""
        if isinstance(value, op.Chosen) and value.place is not None:
            place = op.Equatorial(*self._sky.to_j2000(value.place.ra, value.place.dec, self._unix_time()))
            return replace(value, place=place)
        if isinstance(operation, op.Position | op.ToEquinoxOfDate | op.PlanetPlace | op.MoonPlace) and isinstance(
            value, op.Equatorial
        ):
            return op.Equatorial(*self._sky.to_j2000(value.ra, value.dec, self._unix_time()))
        return value


class ClientProfile(Struct, frozen=True):
    """Settings for the client ``program``, recognised because its connections begin with the bytes ``first_bytes``."""

    first_bytes: bytes
    program: str
    settings: Values
    converter: EquinoxConverter | None
    #: Seconds for which the text of a refusal is held back, for a program that may not read it; infinity: for ever.
    hold_time: float
    #: Whether the program sends a command that stops all motion when an arrow is released.
    releases_by_stop: bool


class SurfaceBinding(Struct, frozen=True):
    """A surface, and how one port presents it to clients."""

    #: The title of the port's protocol, or those of all its protocols.
    protocol_titles: str
    surface: Surface
    make_framer: Callable[[], Framer]
    #: A regular expression for the well-formed commands and idle bytes of the protocol, for ``StrangerFilter``.
    opening_pattern: bytes
    model: Model
    settings: ClientSettings
    j2000_converter: EquinoxConverter | None = None
    #: The converter to use if the presented model has J2000 coordinates; None if the user has chosen the equinox.
    model_converter: EquinoxConverter | None = None
    #: The equinox of the port's clients if the user does not set it: ``jnow`` or ``j2000``.
    default_equinox: str = "jnow"
    #: Seconds for which the text of a refusal is held back on the network, from a program that was not recognised.
    hold_time: float = 0.0
    #: Whether the client program sends a command that stops all motion when an arrow is released.
    releases_by_stop: bool = False
    #: Chooses the model by whether the mount is equatorial, is German (None: unknown), has GPS; None if the user did.
    fit_model: Callable[[bool, bool | None, bool], Model] | None = None
    profiles: tuple[ClientProfile, ...] = ()

    @property
    def converter(self) -> EquinoxConverter | None:
        """Converts the coordinates of the port's clients; None if these use the equinox of date."""
        return self.j2000_converter or (self.model_converter if self.model.get("equinox") == "j2000" else None)
