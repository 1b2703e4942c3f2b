"""Opens the console and the connection to an MQTT broker for a gateway that serves.

No program waits for either: the console's port is opened once the surfaces are ready, its web server is loaded when a
browser or another program sends something, and the broker is connected in the background.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gateway.app.config import Config, MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.config.tables import ConsoleConfig
from gateway.cli.serve.live import Screen
from gateway.clients.access import Access
from gateway.core.errors import UserError
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.system import garbage
from gateway.transport.listening import SERVED, split_address
from gateway.transport.web_port import WebPort

if TYPE_CHECKING:
    from gateway.app.discovery.offer import Offer
    from gateway.app.discovery.served import PhoneLines
    from gateway.app.gateway import Gateway
    from gateway.console.server import Console
    from gateway.fleet import client as brokers
    from gateway.fleet.station import Station


#: How many ports are tried after the console's, if that is taken.
OTHERS = 50


async def open_console(page: ConsoleConfig, web: WebPort, screen: Screen, phone: PhoneLines) -> None:
    """Open the console's port, or the next free one, and print its address."""
    from gateway.app.discovery.offer import web_address

    try:
        await web.open(page.at, OTHERS)
    except UserError as error:
        screen.warn(
            f"the console cannot be opened: {error}; the mount and its surfaces work without it, and --console "
            "tcp://HOST:PORT puts it elsewhere"
        )
        return
    screen.say(f"ready console {web_address(*split_address(web.where))}")
    for line in phone.news(console_offers(web)):
        screen.say(line)
        for row in qr_code(line):
            screen.say(row)


async def load_console(page: ConsoleConfig | None, gateways: Sequence[Gateway], opened: asyncio.Event) -> Console:
    """Load the web server once the gateways are open; without a page only for programs that speak HTTP."""
    await opened.wait()
    # loading takes a quarter of a second, and clients must not wait
    console = await asyncio.to_thread(_load_console, page is not None, gateways)
    names, ports = _names(gateways), _shared_ports(gateways)
    server = (
        console(gateways, names=names, ports=ports, page=False)
        if page is None
        else console(gateways, _access(page), page.pin or "", [*page.names, *names], ports)
    )
    await asyncio.sleep(0)  # each half takes milliseconds, and clients come between them
    await server.open()
    garbage.started()  # again, for the objects of the web server
    return server


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


def _load_console(page: bool, gateways: Sequence[Gateway]) -> type[Console]:
    """Load the web server and its page, on a thread that gives way to the loop five times sooner than threads do."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 5.0)
    try:
        from gateway.console.server import Console, page_files

        for spec in PROTOCOLS.values():
            if spec.web is not None:
                spec.web().load()
        for acceptor in [one for gateway in gateways for one in gateway.acceptors]:
            getattr(acceptor, "binding", None)  # makes what is presented to programs that speak HTTP
        if page:
            page_files()
        return Console
    finally:
        sys.setswitchinterval(usual)


def _access(page: ConsoleConfig) -> Access:
    from gateway.app.bindings import access_networks

    return Access(*access_networks(page))


def http_offers(web: WebPort) -> list[Offer]:
    """Return the console's server as offers of the HTTP protocols, for their own discovery."""
    from gateway.app.discovery.offer import Offer

    speaking = [name for name, spec in PROTOCOLS.items() if spec.web is not None]
    return [Offer(name, "", "tcp", one.host, one.port) for one in console_offers(web) for name in speaking]


def console_offers(web: WebPort) -> list[Offer]:
    """Return the offers to announce for a console: none if only this computer reaches it."""
    from gateway.app.discovery.offer import WEB, Offer

    offers = [Offer(WEB, "mount-gateway", "tcp", *split_address(web.where))] if web.where else []
    return [offer for offer in offers if offer.wide]


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
