"""mDNS (RFC 6762) and DNS-SD (RFC 6763): every offer is a service of a type such as
``_lx200._tcp``, and the console is one of ``_http._tcp``, as other web pages are.

No registered type means "a mount that speaks LX200", so the protocol's own name is the type; the TXT record says which
model is presented, on which transport, and the name of the mount where there are several.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from gateway.app.discovery.offer import EVERYWHERE, Offer
from gateway.core.about import VERSION
from gateway.protocols.registry import spoken
from gateway.system.own_names import held

if TYPE_CHECKING:
    from zeroconf import ServiceInfo
    from zeroconf.asyncio import AsyncZeroconf

#: The longest name of a service, in bytes.
LONGEST = 63


class Publisher:
    """Services that are there until it is closed."""

    def __init__(self, zeroconf: AsyncZeroconf) -> None:
        self._zeroconf = zeroconf

    async def add(self, offers: Sequence[Offer]) -> None:
        """Announce the offers; one whose name another computer has already gets a number behind it."""
        for one in (replace(offer, protocol=name) for offer in offers for name in spoken(offer.protocol)):
            await (await self._zeroconf.async_register_service(service(one), allow_name_change=True))

    async def close(self) -> None:
        """Say goodbye, and end."""
        await self._zeroconf.async_unregister_all_services()
        await self._zeroconf.async_close()


def publish(interfaces: Sequence[str] | None = None) -> Publisher:
    """A publisher on the interfaces with these addresses, or on all. Raises ImportError without zeroconf, OSError."""
    from zeroconf import InterfaceChoice
    from zeroconf.asyncio import AsyncZeroconf

    return Publisher(AsyncZeroconf(interfaces=InterfaceChoice.All if interfaces is None else list(interfaces)))


def service(offer: Offer) -> ServiceInfo:
    """An offer as DNS-SD has it."""
    from zeroconf import ServiceInfo

    kind, computer = f"_{offer.protocol}._tcp.local.", socket.gethostname().partition(".")[0]
    name = f"{offer.mount or 'Telescope'} on {computer}".encode()[:LONGEST].decode("utf-8", "ignore")
    record = {"txtvers": "1", "model": offer.model, "transport": offer.scheme, "mount": offer.mount, "gateway": VERSION}
    return ServiceInfo(
        kind,
        f"{name}.{kind}",
        port=offer.port,
        server=f"{computer}-mount-gateway.local.",
        properties={key: value for key, value in record.items() if value},
        parsed_addresses=list(addresses(offer)),
    )


def addresses(offer: Offer) -> Iterator[str]:
    """Where an offer is reached: the address it listens on, or all that this computer has of the kinds it takes."""
    if offer.host not in EVERYWHERE:
        yield offer.host
        return
    for _, address in held():
        if not address.is_loopback and (address.version == 4 or offer.host == "::"):
            yield str(address)
