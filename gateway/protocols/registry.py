"""The list of protocols, and the only one: a protocol is a folder here, a folder under ``mappings/``, and one entry.

Everything else in the gateway reads this list and names none of them. What stands first is what is presented, and what
stands next is what is driven, where nobody says otherwise.
"""

from __future__ import annotations

from gateway.protocols.alpaca.spec import SPEC as ALPACA
from gateway.protocols.base.spec import ProtocolSpec
from gateway.protocols.lx200.spec import SPEC as LX200
from gateway.protocols.nexstar.spec import SPEC as NEXSTAR
from gateway.protocols.stellarium.spec import SPEC as STELLARIUM

PROTOCOLS: dict[str, ProtocolSpec] = {spec.name: spec for spec in (LX200, NEXSTAR, STELLARIUM, ALPACA)}

#: What stands in the place of a surface's protocol where each connection is told by its first bytes.
ANY = "any"
#: The TCP port that is suggested for such a surface.
ANY_PORT = 4040


def spoken(protocol: str) -> list[str]:
    """The protocols of a surface: its own, or all whose programs speak on a stream; HTTP goes to the web server."""
    return streams() if protocol == ANY else [protocol]


def surfaces() -> list[str]:
    """The protocols that programs may speak."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_surface is not None]


def usual_ports() -> dict[str, int]:
    """What may stand before the place of a surface, and the TCP port that is usual for it."""
    return {ANY: ANY_PORT, **{name: PROTOCOLS[name].usual_port for name in surfaces()}}


def streams() -> list[str]:
    """Those of them that are spoken on a stream of bytes, and not over HTTP."""
    return [name for name in surfaces() if PROTOCOLS[name].web is None]


def mounts() -> list[str]:
    """The protocols of mounts that can be driven."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_driver is not None]


def simulators() -> list[str]:
    """The protocols of mounts that can be simulated."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_simulator is not None]


def pairs() -> list[tuple[str, str]]:
    """Every surface on every mount of another protocol."""
    return [(surface, mount) for surface in surfaces() for mount in mounts() if surface != mount]


def other_surface(mount: str) -> str:
    """What programs most probably speak that are to be connected to a mount: the first surface of another protocol."""
    return next((name for name in surfaces() if name != mount), mount)


def guess(sent: bytes) -> str | None:
    """The protocol of what a client has sent, by what its commands look like; None where it looks like none."""
    if not sent:
        return None
    sure, name = max(((spec.recognises(sent), name) for name, spec in PROTOCOLS.items()), key=lambda found: found[0])
    return name if sure > 0.0 else None
