"""How a surface is presented on one port: in which coordinates, and what is different for programs that are known.

A program is known by its first bytes. Everything behind the surface uses coordinates of date; who counts in J2000 has
them converted on the way in and out.
"""

from __future__ import annotations

import re
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


class J2000:
    """Turns a client's J2000 places into places of date, and answers the other way."""

    def __init__(self, sky: Sky, unix: Callable[[], float]) -> None:
        self._sky, self._unix = sky, unix

    def inward(self, operation: op.Operation) -> op.Operation:
        """What the client asked for, in coordinates of date."""
        if isinstance(operation, op.Goto | op.Sync | op.ToJ2000 | op.Choose):
            ra, dec = self._sky.to_of_date(operation.ra, operation.dec, self._unix())
            return replace(operation, ra=ra, dec=dec)
        return operation

    def outward(self, operation: op.Operation, value: object) -> object:
        """What the controller answered, in J2000."""
        if isinstance(value, op.Chosen) and value.place is not None:
            place = op.Equatorial(*self._sky.to_j2000(value.place.ra, value.place.dec, self._unix()))
            return replace(value, place=place)
        if isinstance(operation, op.Position | op.ToEquinoxOfDate | op.PlanetPlace | op.MoonPlace) and isinstance(
            value, op.Equatorial
        ):
            return op.Equatorial(*self._sky.to_j2000(value.ra, value.dec, self._unix()))
        return value


class ClientProfile(Struct, frozen=True):
    """How a connection that begins with the bytes ``first`` is treated, because only one program begins so."""

    first: bytes
    program: str
    settings: Values
    equinox: J2000 | None


class SurfaceBinding(Struct, frozen=True):
    """A surface as it is presented on one port."""

    #: The protocol's name where a person reads it.
    speaks: str
    surface: Surface
    framing: Callable[[], Framer]
    #: What a program may begin with, for ``Beginning``.
    beginning: re.Pattern[bytes]
    model: Model
    settings: ClientSettings
    equinox: J2000 | None = None
    #: What its programs count in where the user says nothing: ``jnow`` or ``j2000``.
    counts_in: str = "jnow"
    #: Whether the mount is equatorial, whether it is German, whether it has a GPS receiver -> the model to present;
    #: None where the user has named one.
    fit: Callable[[bool, bool | None, bool], Model] | None = None
    manners: tuple[ClientProfile, ...] = ()
