"""Announcing: programs on the network find the surfaces that listen there, without anybody typing an address.

SkyFi's discovery, by which SkySafari finds a mount: it sends ``skyfi?``, or ``skyfi:NAME?`` when its user has named
one, to UDP port 4031 of everybody. The answer is the question with ``@`` and an address in the place of the question
mark: ``skyfi:NAME@192.168.1.5``. It holds no port: SkySafari connects to the one in its settings.

mDNS (RFC 6762) and DNS-SD (RFC 6763), where the extra ``mdns`` is installed: every offer is a service of a type such
as ``_lx200._tcp``, and the console is one of ``_http._tcp``, as other web pages are. No registered type means "a mount
that speaks LX200", so the protocol's own name is the type; the TXT record says which model is presented, on which
transport, and the name of the mount where there are several.

Both are silent unless asked. That an announcement fails is told, and costs nothing else.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, cast

from msgspec.structs import replace

from gateway.app.discovery.offer import EVERYWHERE, Offer, seen_from
from gateway.core.about import VERSION
from gateway.protocols.registry import PROTOCOLS, spoken
from gateway.system.own_commands import how_to_add
from gateway.system.own_names import held

if TYPE_CHECKING:
    from zeroconf import ServiceInfo
    from zeroconf.asyncio import AsyncZeroconf

PORT = 4031
#: Where SkySafari connects unless it is told otherwise.
USUAL = 4030
_QUESTION = re.compile(rb"(skyfi(?::[^?\x00-\x1f]{0,64})?)\?[\r\n\0]*", re.IGNORECASE)
#: The longest name of a service, in bytes.
LONGEST = 63


class Announcement:
    """What is announced until it is closed. ``warn`` is told what a user must know, ``note`` what one may."""

    def __init__(self, warn: Callable[[str], object], note: Callable[[str], object]) -> None:
        self._warn, self._note = warn, note
        self._skyfi: asyncio.DatagramTransport | None = None
        #: What ends the answers to programs that look for servers.
        self._found: list[Callable[[], None]] = []
        self._publishing: asyncio.Task[None] | None = None
        self._publisher: Publisher | None = None

    async def answer(self, offers: Sequence[Offer], host: str = "0.0.0.0", port: int = PORT) -> None:
        """Answer SkySafari's question for a SkyFi from now on, if there is anything to find."""
        offers = [offer for offer in offers if offer.protocol not in PROTOCOLS or PROTOCOLS[offer.protocol].web is None]
        if not any(offer.reached_by_ipv4 for offer in offers):
            return
        try:
            self._skyfi = await answer_skyfi(offers, host, port)
        except OSError as error:
            self._warn(f"SkySafari will not find this gateway by itself: UDP port {port}: {error.strerror or error}")

    async def let_find(self, offers: Sequence[Offer]) -> None:
        """Answer the questions of programs that look for servers of theirs, of every protocol that has such a way."""
        for name, spec in PROTOCOLS.items():
            places = [(offer.host, offer.port) for offer in offers if offer.protocol == name]
            if spec.web is None or not places:
                continue
            try:
                self._found.append(await spec.web().answer_discovery(places))
            except OSError as error:
                self._warn(
                    f"{spec.title} programs will not find this gateway by themselves: {error.strerror or error}; "
                    "type its address and port into them"
                )

    @property
    def skyfi_port(self) -> int:
        """The UDP port that is answered on; 0 when none is."""
        return 0 if self._skyfi is None else int(self._skyfi.get_extra_info("sockname")[1])

    def publish(self, offers: Sequence[Offer], interfaces: Sequence[str] | None = None) -> None:
        """Begin to answer for the offers by mDNS: on all interfaces, or on those with these addresses."""
        if offers:
            self._publishing = asyncio.get_running_loop().create_task(self._publish(offers, interfaces))

    async def _publish(self, offers: Sequence[Offer], interfaces: Sequence[str] | None) -> None:
        try:
            self._publisher = publish(interfaces)
            await self._publisher.add(offers)
        except ImportError:
            self._note(f"not announced by mDNS, for which zeroconf is needed; to install it, {how_to_add('mdns')}")
        except Exception as error:  # a library's own kinds, and the system's: no network, no multicast …
            self._note(f"not announced by mDNS: {error}")

    async def close(self) -> None:
        """Take everything back."""
        for end in self._found:
            end()
        if self._skyfi is not None:
            self._skyfi.close()
        if self._publishing is not None:
            self._publishing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._publishing
        if self._publisher is not None:
            await self._publisher.close()


class _Answering(asyncio.DatagramProtocol):
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


async def answer_skyfi(offers: Sequence[Offer], host: str, port: int) -> asyncio.DatagramTransport:
    """Answer for the offers until the transport is closed. Raises OSError."""
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(lambda: _Answering(offers), local_addr=(host, port))
    return transport


def answer(question: bytes, offers: Sequence[Offer], asker: tuple[str, int]) -> bytes:
    """The answer to somebody at (host, port); nothing for what is no such question."""
    match = _QUESTION.fullmatch(question)
    able = [offer for offer in offers if offer.reached_by_ipv4]
    if match is None or not able:
        return b""
    best = min(able, key=lambda offer: offer.port != USUAL)
    address = seen_from(asker) if best.host in EVERYWHERE else best.host
    return match[1] + b"@" + address.encode() if address else b""


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
