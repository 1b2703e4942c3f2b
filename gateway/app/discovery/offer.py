"""What there is to find: surfaces on the network."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable

from msgspec import Struct

from gateway.transport.listening import split_address

EVERYWHERE = ("0.0.0.0", "::")
SCHEMES = ("tcp", "rfc2217")


class Offer(Struct, frozen=True):
    """A surface on a port of its own; ``host`` is the address it listens on, in numbers, ``mount`` a name or empty."""

    protocol: str
    model: str
    scheme: str
    host: str
    port: int
    mount: str = ""

    @property
    def wide(self) -> bool:
        """Whether others than this computer can reach it."""
        return not ipaddress.ip_address(self.host.partition("%")[0]).is_loopback

    @property
    def reached_by_ipv4(self) -> bool:
        return "." in self.host or self.host == "::"


def offered(names: Iterable[str]) -> list[Offer]:
    """``PROTOCOL:MODEL@WHERE`` and maybe a mount's name, as the ready lines have it -> those on the network."""
    found = []
    for name in names:
        what, _, rest = name.partition("@")
        where, _, mount = rest.partition(" ")
        scheme = where.partition("://")[0]
        if scheme in SCHEMES:
            protocol, _, model = what.partition(":")
            host, port = split_address(where)
            found.append(Offer(protocol, model, scheme, host, port, mount))
    return found
