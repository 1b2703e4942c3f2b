"""How a surface is presented on one port, and what is different for programs that are known by their first bytes."""

from __future__ import annotations

import re
from collections.abc import Callable

from msgspec import Struct

from gateway.clients.equinox import Equinox
from gateway.core.operations import Values
from gateway.protocols.base.frames import Framer
from gateway.protocols.base.session import ClientSettings
from gateway.protocols.base.surface import Surface
from gateway.protocols.wireformat.rows import Model


class ClientProfile(Struct, frozen=True):
    """How a connection that begins with the bytes ``first`` is treated, because only one program begins so."""

    first: bytes
    program: str
    settings: Values
    equinox: Equinox | None


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
    equinox: Equinox | None = None
    #: What its programs count in where the user says nothing: ``jnow`` or ``j2000``.
    counts_in: str = "jnow"
    #: Whether the mount is equatorial, whether it is German, whether it has a GPS receiver -> the model to present;
    #: None where the user has named one.
    fit: Callable[[bool, bool | None, bool], Model] | None = None
    manners: tuple[ClientProfile, ...] = ()
