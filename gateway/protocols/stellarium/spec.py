"""The ``ProtocolSpec`` of Stellarium's telescope protocol. Programs speak it, no mount does."""

from __future__ import annotations

from gateway.protocols.base.spec import MadeSurface, ProtocolSpec, SurfaceSettings, lazy
from gateway.protocols.wireformat.command_set import load, surface_functions

NAME = "stellarium"
#: The header (length and type) of a goto, the only message that programs send.
GOTO_HEADER = b"\x14\0\0\0"


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.base.session import ClientSettings
    from gateway.protocols.base.surface import Surface
    from gateway.protocols.stellarium import surface as module

    surface = Surface(load(NAME), surface_functions(module))
    surface.session_type, surface.subscriptions = module.StellariumSession, module.subscriptions
    surface.has_replies = False
    return MadeSurface(surface, {"name": NAME}, ClientSettings(settings.limits))


SPEC = ProtocolSpec(
    name=NAME,
    title="Stellarium",
    program_phrase="a Stellarium",
    mount_phrase="a mount of Stellarium's own protocol",
    menu_entry="External software or a remote computer",
    mounts_phrase="Stellarium",
    usual_port=10001,
    equinox="j2000",
    new_framer=lazy("stellarium.surface", "StellariumFramer"),
    opening_pattern=rb"(?s)(?:\x14\0\0\0.{16})*",
    make_surface=_make_surface,
    likelihood=lambda sent: 1.0 if sent.startswith(GOTO_HEADER) else 0.0,
    greeting=GOTO_HEADER,
    mount_speaks_first=True,
)
