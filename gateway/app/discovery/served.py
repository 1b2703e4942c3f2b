"""The present addresses of a gateway's surfaces and console, as users type them into a program.

A computer gets its addresses after the gateway has started (Wi-Fi), and new ones later (a new lease). So they are
looked up each time they are shown; ``PhoneInstructions`` returns only lines that are new.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from gateway.app.discovery.offer import HTTP, Offer, network_offers, phone_instruction, reachable_addresses, web_address
from gateway.app.mount_state import MountState
from gateway.app.state.store import StateStore
from gateway.app.status import ServedSurface
from gateway.transport.listening import split_address
from gateway.transport.web_server import WebServer

#: The name of the console among the surfaces.
CONSOLE_PROTOCOL = "console"


class RunningGateway(Protocol):
    """The attributes of ``Gateway`` that this module needs."""

    web: WebServer
    store: StateStore | None

    @property
    def open_failure(self) -> str: ...
    def names(self) -> Sequence[str]: ...
    def state(self) -> MountState: ...


def served_surfaces(gateway: RunningGateway) -> Iterator[ServedSurface]:
    """Yield every surface of a gateway, then its console."""
    for name in gateway.names():
        what, _, rest = name.partition("@")
        where = rest.partition(" ")[0]
        yield _make_served(what, where, next(iter(network_offers([name])), None))
    if gateway.web.address:
        host, port = split_address(gateway.web.address)
        yield _make_served(CONSOLE_PROTOCOL, web_address(host, port), Offer(HTTP, "tcp", host, port))


def _make_served(name: str, where: str, offer: Offer | None) -> ServedSurface:
    """Return a surface with its addresses; ``offer`` is None for a serial port, real or virtual."""
    if offer is None:
        return ServedSurface(name, where)
    if not offer.is_reachable_by_others:
        return ServedSurface(name, where, (), "this computer only")
    addresses = reachable_addresses(offer)
    return ServedSurface(name, where, tuple(addresses), phone_instruction(offer, addresses))


class PhoneInstructions:
    """Makes the lines that show what to type on a phone, and remembers them, so that each is printed only once."""

    def __init__(self) -> None:
        self._logged_lines: dict[tuple[str, int], str] = {}

    def new_lines(self, offers: Iterable[Offer]) -> list[str]:
        """Return the lines of offers that are new or whose line has changed since the last call."""
        lines = []
        for offer in offers:
            key, line = (offer.protocol, offer.port), phone_instruction(offer, reachable_addresses(offer))
            if offer.is_reachable_by_others and self._logged_lines.get(key) != line:
                self._logged_lines[key] = line
                lines.append(line)
        return lines
