"""Opens the console and the connection to an MQTT broker for a gateway that serves.

No program waits for either: the console's port is opened once the surfaces are ready, its web server is loaded when a
browser or another program sends something, and the broker is connected in the background.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from gateway.app.config import Config, MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.config.tables import ConsoleConfig
from gateway.cli.serve.live import Screen
from gateway.clients.access import Access
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.transport.listening import SERVED, split_address

if TYPE_CHECKING:
    from gateway.app.discovery.offer import Offer
    from gateway.app.discovery.served import PhoneLines
    from gateway.app.gateway import Gateway
    from gateway.clients.any_protocol.web import Web
    from gateway.console.port import ConsolePort
    from gateway.console.server import Console
    from gateway.fleet import client as brokers
    from gateway.fleet.station import Station


async def open_console(config: Config, web: Web, screen: Screen, phone: PhoneLines) -> ConsolePort | None:
    """Open the console's port and print its address; return None if it is off or cannot be opened."""
    if config.page is None:
        return None
    from gateway.console.port import ConsolePort

    page = ConsolePort(web)
    host, port = split_address(config.page.at)
    try:
        await page.open(host, port)
    except OSError as error:
        screen.warn(
            f"the console cannot be opened at {config.page.at}: {error.strerror or error}; the mount and its surfaces "
            "work without it, and --console tcp://HOST:PORT puts it elsewhere"
        )
        return None
    screen.say(f"ready console {page.where}")
    for line in phone.news(console_offers(page)):
        screen.say(line)
        for row in qr_code(line):
            screen.say(row)
    return page


async def load_console(page: ConsoleConfig, gateways: Sequence[Gateway]) -> Console:
    """Load the web server of a console whose port is open."""
    console = await asyncio.to_thread(_load_console)  # loading takes a quarter of a second, and clients must not wait
    names = [*page.names, *_names(gateways)]
    server = console(gateways, _access(page), page.pin or "", names, _shared_ports(gateways))
    await asyncio.sleep(0)  # each half takes milliseconds, and clients come between them
    await server.open()
    return server


async def open_programs(gateway: Gateway) -> Console:
    """Open a server without a console or a port: for the HTTP programs at the mount's ports for every protocol."""
    console = await asyncio.to_thread(_load_console)
    server = console([gateway], names=_names([gateway]), ports=_shared_ports([gateway]), page=False)
    await server.open()
    return server


def shares_port(gateway: Gateway) -> bool:
    """Whether programs that speak HTTP can arrive at a port for every protocol."""
    return any(endpoint.protocol == ANY for endpoint in gateway.endpoints)


def http_surfaces(config: Config, mount: MountConfig) -> list[SurfaceConfig]:
    """Return the surfaces of the HTTP protocols, which the console's server serves by the console's rules.

    Without a console they are served at the mount's ports for every protocol, which have admitted the client already.
    """
    page = config.page
    if page is None and not any(parse_endpoint(one.at).protocol == ANY for one in config.of(mount)):
        return []
    allow, looks = (None, False) if page is None else (page.allow, page.read_only if page.pin is None else True)
    return [
        SurfaceConfig(at=f"{name}@{SERVED}", mount=mount.name, allow=allow, read_only=looks)
        for name, spec in PROTOCOLS.items()
        if spec.web is not None
    ]


def _shared_ports(gateways: Sequence[Gateway]) -> dict[int, Access]:
    """Return the ports of surfaces that browsers can use, too, and the access rules of each."""
    return {
        split_address(port.where)[1]: acceptor.access
        for gateway in gateways
        for endpoint, port, acceptor in zip(gateway.endpoints, gateway.ports, gateway.acceptors, strict=True)
        if endpoint.protocol == ANY
    }


def _names(gateways: Sequence[Gateway]) -> list[str]:
    """Return the further names of this computer that the surfaces have."""
    return [name for gateway in gateways for surface in gateway.surfaces for name in surface.names]


def _load_console() -> type[Console]:
    """Load the web server, on a thread that gives way to the event loop five times sooner than threads usually do."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 5.0)
    try:
        made: type[Console] = import_module("gateway.console.server").Console
        for spec in PROTOCOLS.values():
            if spec.web is not None:
                spec.web()  # loads what serves its programs
        return made
    finally:
        sys.setswitchinterval(usual)


def _access(page: ConsoleConfig) -> Access:
    from gateway.app.bindings import access_networks

    return Access(*access_networks(page))


def console_offer(page: ConsolePort) -> Offer:
    """Return the console as an offer for announcements on the network."""
    from gateway.app.discovery.offer import WEB, Offer

    return Offer(WEB, "mount-gateway", "tcp", page.host, page.port)


def http_offers(page: ConsolePort | None) -> list[Offer]:
    """Return the console's server as offers of the HTTP protocols, for their own discovery."""
    from gateway.app.discovery.offer import Offer

    speaking = [name for name, spec in PROTOCOLS.items() if spec.web is not None]
    return [Offer(name, "", "tcp", one.host, one.port) for one in console_offers(page) for name in speaking]


def console_offers(page: ConsolePort | None) -> list[Offer]:
    """Return the offers to announce for a console: none if only this computer reaches it."""
    return [found] if page is not None and (found := console_offer(page)).wide else []


def qr_code(line: str) -> list[str]:
    """Return the first web address of a line as a QR code in block characters; empty without a terminal or the
    library."""
    address = next((word for word in line.split() if word.startswith("http://")), "")
    if not address or not sys.stdout.isatty():
        return []
    try:
        import segno
    except ImportError:
        return []
    import io

    drawn = io.StringIO()
    segno.make(address, micro=False, error="l").terminal(drawn, compact=True)
    return drawn.getvalue().rstrip("\n").split("\n")


def broker_access(config: Config) -> brokers.Access | None:
    """Return the credentials for the broker; None if none is configured. Raises UserError for what is missing."""
    mqtt = config.mqtt
    if mqtt is None:
        return None
    from gateway.fleet.client import access

    return access(mqtt.at, mqtt.user, mqtt.password_file, mqtt.ca)


def open_broker(
    config: Config, access: brokers.Access | None, gateways: Sequence[Gateway], screen: Screen
) -> Station | None:
    """Publish the mounts on the broker, as long as the gateway runs; return None if none is configured."""
    if access is None or config.mqtt is None:
        return None
    from gateway.fleet.station import Station

    station = Station(config.mqtt, access, gateways, screen.say, screen.warn)
    station.start()
    return station
