"""Announcing: programs on the network find the surfaces that listen there, without anybody typing an address.

Two ways, both silent unless asked: SkyFi's question and answer, by which SkySafari looks for its Wi-Fi adapters, and
mDNS (DNS-SD, "Bonjour"), where the extra ``mdns`` is installed. A surface that only this computer reaches is nobody
else's business, and is never announced. That an announcement fails is told, and costs nothing else.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence

from gateway.app.discovery.mdns import Publisher, publish
from gateway.app.discovery.offer import Offer, offered
from gateway.app.discovery.skyfi import PORT, answer_skyfi
from gateway.protocols.registry import PROTOCOLS
from gateway.system.own_commands import how_to_add

__all__ = ["Announcement", "Offer", "offered"]


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
