"""The toy protocol, as the registry of protocols has it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gateway.core.operations import Equatorial, Position
from gateway.protocols.base.spec import MadeSurface, ProtocolSpec, SurfaceSettings
from gateway.protocols.wireformat.command_set import load

if TYPE_CHECKING:
    from gateway.protocols.base.frames import Framer


def _framing() -> Framer:
    from gateway.protocols.toy.framing import Lines

    return Lines()


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.base.session import ClientSettings
    from gateway.protocols.base.surface import Surface
    from gateway.protocols.base.wants import Subscription

    surface = Surface(load("toy"), {})
    told = surface.protocol.commands["where"].replies[0][1]

    def position(seen: Equatorial) -> bytes:
        return told.encode({"ra": seen.ra, "dec": seen.dec})

    surface.subscriptions = lambda session: [Subscription(Position(), 0.5, position)]
    return MadeSurface(surface, {"name": "toy"}, ClientSettings(settings.limits))


SPEC = ProtocolSpec(
    name="toy",
    title="Toy",
    program_phrase="a toy",
    mount_phrase="a toy",
    menu_entry="Toy",
    mounts_phrase="toy",
    new_framer=_framing,
    opening_pattern=re.compile(rb"(?:[?!=][^\n]*\n)*"),
    make_surface=_make_surface,
    likelihood=lambda sent: 1.0 if sent[:1] in (b"?", b"!") and b"\n" in sent else 0.0,
)
