"""SkyFi's discovery, by which SkySafari finds a mount on the network by itself.

SkySafari sends ``skyfi?``, or ``skyfi:NAME?`` when its user has named one, to UDP port 4031 of everybody. The answer
is the question with ``@`` and an address in the place of the question mark: ``skyfi:NAME@192.168.1.5``. It holds no
port: SkySafari connects to the one in its settings, 4030 unless it was changed.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Sequence
from typing import cast

from gateway.app.discovery.offer import EVERYWHERE, Offer, seen_from

PORT = 4031
#: Where SkySafari connects unless it is told otherwise.
USUAL = 4030
_QUESTION = re.compile(rb"(skyfi(?::[^?\x00-\x1f]{0,64})?)\?[\r\n\0]*", re.IGNORECASE)


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
