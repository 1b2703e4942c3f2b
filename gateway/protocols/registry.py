"""The list of all protocols: each has a folder here, a folder under ``mappings/``, and one entry in the list.

All other code reads this list and names no protocol. By default clients speak the first, the mount the second.
"""

from __future__ import annotations

from gateway.protocols.alpaca.spec import SPEC as ALPACA
from gateway.protocols.base.spec import ProtocolSpec
from gateway.protocols.lx200.spec import SPEC as LX200
from gateway.protocols.nexstar.spec import SPEC as NEXSTAR
from gateway.protocols.stellarium.spec import SPEC as STELLARIUM

PROTOCOLS: dict[str, ProtocolSpec] = {spec.name: spec for spec in (LX200, NEXSTAR, STELLARIUM, ALPACA)}

#: The name, in place of a protocol, of a surface that recognises the protocol of each connection by its first bytes.
ANY = "any"
#: The suggested TCP port for such a surface.
ANY_PORT = 4040


def accepted_protocols(protocol: str) -> list[str]:
    """Return the protocols that a surface accepts: ``protocol``, or for ``any`` all that use a byte stream."""
    return streams() if protocol == ANY else [protocol]


def surfaces() -> list[str]:
    """Return the protocols that have a surface."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_surface is not None]


def usual_ports() -> dict[str, int]:
    """Return the usual TCP port of each kind of surface."""
    return {ANY: ANY_PORT, **{name: PROTOCOLS[name].usual_port for name in surfaces()}}


def streams() -> list[str]:
    """Return the protocols with a surface that use a byte stream, not HTTP."""
    return [name for name in surfaces() if PROTOCOLS[name].web is None]


def drivers() -> list[str]:
    """Return the protocols that have a driver."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_driver is not None]


def simulated_protocols() -> list[str]:
    """Return the protocols that have a simulated mount."""
    return [name for name, spec in PROTOCOLS.items() if spec.make_simulator is not None]


def protocol_pairs() -> list[tuple[str, str]]:
    """Return every pair of a surface and a mount of another protocol; mounts that are reached over HTTP come last."""
    found = [(surface, mount) for surface in surfaces() for mount in drivers() if surface != mount]
    return sorted(found, key=lambda pair: PROTOCOLS[pair[1]].make_http_dialect is not None)


def other_surface(mount_protocol: str) -> str:
    """Return the protocol that most clients of such a mount speak: the first with a surface, except the mount's own."""
    return next((name for name in surfaces() if name != mount_protocol), mount_protocol)


def guess_protocol(sent: bytes) -> str | None:
    """Return the most probable protocol of the bytes a client has sent; None if they look like no protocol."""
    if not sent:
        return None
    sure, name = max(((spec.likelihood(sent), name) for name, spec in PROTOCOLS.items()), key=lambda match: match[0])
    return name if sure > 0.0 else None
