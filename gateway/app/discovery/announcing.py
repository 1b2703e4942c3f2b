"""Announces surfaces on the network, so that programs find them and users need not type an address.

SkySafari finds a mount by SkyFi's discovery: it broadcasts ``skyfi?``, or ``skyfi:NAME?`` if its user has named a
mount, to UDP port 4031. The answer is the question with ``@`` and an address in place of the question mark:
``skyfi:NAME@192.168.1.5``. It contains no port: SkySafari connects to the port in its settings.

mDNS (RFC 6762) and DNS-SD (RFC 6763) need the extra ``mdns``. Every offer is a service of a type such as
``_lx200._tcp``, and the console is one of type ``_http._tcp``. No registered type means "a mount that speaks LX200", so
the type is the protocol's name. The TXT record has the presented model, the transport, and the mount's name if there
are several mounts.

SkyFi only answers questions; mDNS also announces a service when it begins. If an announcement fails, a message says so,
and everything else works.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import re
import socket
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, cast

from msgspec.structs import replace

from gateway.app.discovery.offer import EVERYWHERE, Offer, address_towards
from gateway.core.about import version
from gateway.protocols.registry import PROTOCOLS, spoken
from gateway.system.own_commands import how_to_add
from gateway.system.own_names import interface_addresses

if TYPE_CHECKING:
    from zeroconf import ServiceInfo
    from zeroconf.asyncio import AsyncZeroconf

PORT = 4031
#: The port in SkySafari's default settings.
USUAL = 4030
_QUESTION = rb"(?i)(skyfi(?::[^?\x00-\x1f]{0,64})?)\?[\r\n\0]*"
#: The longest name of a service, in bytes.
LONGEST = 63


class Announcement:
    """All announcements, until it is closed. ``warn`` gets messages for the user, ``note`` gets lines for the log."""

    def __init__(self, warn: Callable[[str], object], note: Callable[[str], object]) -> None:
        self._warn, self._note = warn, note
        self._skyfi: asyncio.DatagramTransport | None = None
        #: Functions that end the protocols' own discovery answers.
        self._discovery_ends: list[Callable[[], None]] = []
        self._publishing: asyncio.Task[None] | None = None
        self._zeroconf: AsyncZeroconf | None = None

    async def answer(self, offers: Sequence[Offer], host: str = "0.0.0.0", port: int = PORT) -> None:
        """Answer SkySafari's SkyFi discovery from now on, if there is a surface that it can use."""
        offers = [offer for offer in offers if offer.protocol not in PROTOCOLS or PROTOCOLS[offer.protocol].web is None]
        if not any(offer.reached_by_ipv4 for offer in offers):
            return
        try:
            self._skyfi, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: _SkyFiProtocol(offers), local_addr=(host, port)
            )
        except OSError as error:
            why = f": {os.strerror(error.errno).lower() if error.errno else error}"  # asyncio's text is for programmers
            if error.errno == errno.EADDRINUSE:
                why = " is in use by another program (another mount-gateway?)"
            self._warn(
                f"SkySafari will not find this gateway by itself: UDP port {port}{why}; type address and port into it"
            )

    async def answer_discovery(self, offers: Sequence[Offer]) -> None:
        """Answer discovery requests from now on, for every protocol that has a discovery of its own."""
        for name, spec in PROTOCOLS.items():
            places = [(offer.host, offer.port) for offer in offers if offer.protocol == name]
            if spec.web is None or not places:
                continue
            try:
                self._discovery_ends.append(await spec.web().answer_discovery(places))
            except OSError as error:
                self._warn(
                    f"{spec.title} programs will not find this gateway by themselves: {error.strerror or error}; "
                    "type its address and port into them"
                )

    @property
    def skyfi_port(self) -> int:
        """The UDP port of the SkyFi answers; 0 if there are none."""
        return 0 if self._skyfi is None else int(self._skyfi.get_extra_info("sockname")[1])

    def publish(self, offers: Sequence[Offer], interfaces: Sequence[str] | None = None) -> None:
        """Begin to announce these offers by mDNS, and no others, on all interfaces or on those with these addresses."""
        if offers:
            before, loop = self._publishing, asyncio.get_running_loop()
            self._publishing = loop.create_task(self._publish(offers, interfaces, before))

    async def _publish(
        self, offers: Sequence[Offer], interfaces: Sequence[str] | None, before: asyncio.Task[None] | None
    ) -> None:
        if before is not None:
            await before
        try:
            await self._withdraw()
            self._zeroconf = open_zeroconf(interfaces)
            await register(self._zeroconf, offers)
        except ImportError:
            self._note(f"not announced by mDNS, for which zeroconf is needed; to install it, {how_to_add('mdns')}")
        except Exception as error:  # zeroconf's own errors, and the system's: no network, no multicast …
            self._note(f"not announced by mDNS: {error}")

    async def close(self) -> None:
        """Withdraw all announcements."""
        for end in self._discovery_ends:
            end()
        if self._skyfi is not None:
            self._skyfi.close()
        if self._publishing is not None:
            self._publishing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._publishing
        await self._withdraw()

    async def _withdraw(self) -> None:
        if self._zeroconf is not None:
            await self._zeroconf.async_unregister_all_services()
            await self._zeroconf.async_close()


class _SkyFiProtocol(asyncio.DatagramProtocol):
    def __init__(self, offers: Sequence[Offer]) -> None:
        self._offers = offers
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        assert self._transport is not None
        reply = answer(data, self._offers, addr)
        if reply:
            self._transport.sendto(reply, addr)


def answer(question: bytes, offers: Sequence[Offer], asker: tuple[str, int]) -> bytes:
    """Return the answer to a SkyFi question from (host, port); empty for any other datagram."""
    match = re.fullmatch(_QUESTION, question)
    able = [offer for offer in offers if offer.reached_by_ipv4]
    if match is None or not able:
        return b""
    best = min(able, key=lambda offer: offer.port != USUAL)
    address = address_towards(asker) if best.host in EVERYWHERE else best.host
    return match[1] + b"@" + address.encode() if address else b""


async def register(zeroconf: AsyncZeroconf, offers: Sequence[Offer]) -> None:
    """Announce the offers; a name that another computer already has gets a number appended."""
    for announced in (replace(offer, protocol=name) for offer in offers for name in spoken(offer.protocol)):
        await (await zeroconf.async_register_service(service(announced), allow_name_change=True))


def open_zeroconf(interfaces: Sequence[str] | None) -> AsyncZeroconf:
    """Begin on the interfaces with these addresses, or all. Raises ImportError without zeroconf, OSError."""
    from zeroconf import InterfaceChoice
    from zeroconf.asyncio import AsyncZeroconf

    return AsyncZeroconf(interfaces=InterfaceChoice.All if interfaces is None else list(interfaces))


def service(offer: Offer) -> ServiceInfo:
    """Return an offer as a DNS-SD service."""
    from zeroconf import ServiceInfo

    kind, computer = f"_{offer.protocol}._tcp.local.", socket.gethostname().partition(".")[0]
    name = f"{offer.mount or 'Telescope'} on {computer}".encode()[:LONGEST].decode("utf-8", "ignore")
    record = {
        "txtvers": "1",
        "model": offer.model,
        "transport": offer.scheme,
        "mount": offer.mount,
        "gateway": version(),
    }
    return ServiceInfo(
        kind,
        f"{name}.{kind}",
        port=offer.port,
        server=f"{computer}-mount-gateway.local.",
        properties={key: value for key, value in record.items() if value},
        parsed_addresses=list(addresses(offer)),
    )


def addresses(offer: Offer) -> Iterator[str]:
    """Yield the address on which an offer listens; for a wildcard, all addresses of this computer of the
    same family.
    """
    if offer.host not in EVERYWHERE:
        yield offer.host
        return
    for _, address in interface_addresses():
        if not address.is_loopback and (address.version == 4 or offer.host == "::"):
            yield str(address)
