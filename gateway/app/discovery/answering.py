"""Answers programs that look for a mount on the network, so that their users need not type an address.

SkySafari finds a mount by SkyFi's discovery: it broadcasts ``skyfi?``, or ``skyfi:NAME?`` if its user has named a
mount, to UDP port 4031. The answer is the query with ``@`` and an address in place of the question mark:
``skyfi:NAME@192.168.1.5``. The answer contains no port: SkySafari connects to the port in its settings.
If the discovery port cannot be opened, a message says so, and everything else works.
"""

from __future__ import annotations

import asyncio
import errno
import os
import re
from collections.abc import Callable, Sequence
from typing import cast

from gateway.app.discovery.offer import WILDCARD_ADDRESSES, Offer, address_towards
from gateway.protocols.registry import PROTOCOLS

SKYFI_DISCOVERY_PORT = 4031
#: The port in SkySafari's default settings.
SKYSAFARI_PORT = 4030
_SKYFI_QUERY = rb"(?i)(skyfi(?::[^?\x00-\x1f]{0,64})?)\?[\r\n\0]*"


class DiscoveryAnswers:
    """Answers discovery requests until it is closed. ``warn`` gets messages for the user."""

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._skyfi: asyncio.DatagramTransport | None = None
        #: Functions that end the discovery answers of protocols that have a discovery of their own.
        self._close_functions: list[Callable[[], None]] = []

    async def answer_skyfi(
        self, offers: Sequence[Offer], host: str = "0.0.0.0", port: int = SKYFI_DISCOVERY_PORT
    ) -> None:
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
                f"SkySafari cannot find this gateway by itself: UDP port {port}{why}; type address and port into it"
            )

    async def answer_discovery(self, offers: Sequence[Offer]) -> None:
        """Answer discovery requests from now on, for every protocol that has a discovery of its own."""
        for name, spec in PROTOCOLS.items():
            places = [(offer.host, offer.port) for offer in offers if offer.protocol == name]
            if spec.web is None or not places:
                continue
            try:
                self._close_functions.append(await spec.web().answer_discovery(places))
            except OSError as error:
                self._warn(
                    f"{spec.title} programs will not find this gateway by themselves: {error.strerror or error}; "
                    "type its address and port into them"
                )

    @property
    def skyfi_port(self) -> int:
        """The UDP port of the SkyFi answers; 0 if there are none."""
        return 0 if self._skyfi is None else int(self._skyfi.get_extra_info("sockname")[1])

    def close(self) -> None:
        """Stop answering discovery requests."""
        for end in self._close_functions:
            end()
        if self._skyfi is not None:
            self._skyfi.close()


class _SkyFiProtocol(asyncio.DatagramProtocol):
    def __init__(self, offers: Sequence[Offer]) -> None:
        self._offers = offers
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        assert self._transport is not None
        reply = skyfi_answer(data, self._offers, addr)
        if reply:
            self._transport.sendto(reply, addr)


def skyfi_answer(query: bytes, offers: Sequence[Offer], sender: tuple[str, int]) -> bytes:
    """Return the answer to a SkyFi query from ``sender`` (host, port); empty for any other datagram."""
    match = re.fullmatch(_SKYFI_QUERY, query)
    reachable = [offer for offer in offers if offer.reached_by_ipv4]
    if match is None or not reachable:
        return b""
    best = min(reachable, key=lambda offer: offer.port != SKYSAFARI_PORT)
    address = address_towards(sender) if best.host in WILDCARD_ADDRESSES else best.host
    return match[1] + b"@" + address.encode() if address else b""
