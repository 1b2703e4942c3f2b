"""Opens the console and the connection to an MQTT broker for a gateway that serves.

No program waits for either: the console's port is opened once the surfaces are ready, its web server is loaded when a
browser or another program sends something, and the broker is connected in the background.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from gateway.app.config import Config, MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.config.tables import ConsoleConfig
from gateway.cli.serve.live import Screen
from gateway.clients.access import AccessRules
from gateway.core.errors import UserError
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.transport.listening import WEB_ADDRESS, split_address
from gateway.transport.web_server import WebServer

if TYPE_CHECKING:
    from aiohttp import web

    from gateway.app.discovery.offer import Offer
    from gateway.app.discovery.served import PhoneInstructions
    from gateway.app.gateway import Gateway
    from gateway.fleet import client as brokers
    from gateway.fleet.station import MqttService


#: How many ports are tried after the console's, if that is taken.
MAX_PORTS_TRIED = 50


async def open_console(
    config: ConsoleConfig, web_server: WebServer, screen: Screen, phone_lines: PhoneInstructions
) -> None:
    """Open the console's port, or the next free port, and print its address; only warn if that fails."""
    from gateway.app.discovery.offer import web_address

    try:
        web_server.address = (await web_server.listen(config.at, MAX_PORTS_TRIED)).address
    except UserError as error:
        screen.warn(
            f"the console cannot be opened: {error}; the mount and its surfaces work without it, and --console "
            "tcp://HOST:PORT puts it elsewhere"
        )
        return
    for line in phone_lines.new_lines(console_offers(web_server)):
        screen.say(line)
        for row in qr_code(line):
            screen.say(row)
    screen.say(f"ready console {web_address(*split_address(web_server.address))}")


async def load_console(console_config: ConsoleConfig | None, gateways: Sequence[Gateway]) -> object:
    """Return the web application: the pages of the console, if it is configured, and those of the HTTP protocols."""
    from gateway.app.site import load_web_application

    if console_config is None:
        return await load_web_application(gateways)

    def load_console_routes() -> Callable[[web.Application], object]:
        from gateway.app.bindings import access_networks
        from gateway.console.server import Console

        access = AccessRules(*access_networks(console_config))
        return lambda app: Console(gateways, access, console_config.pin or "").add_to(app)

    return await load_web_application(gateways, console_config.names, load_console_routes)


def http_surfaces(config: Config, mount: MountConfig) -> list[SurfaceConfig]:
    """Return the surfaces of the HTTP protocols (Alpaca). The console's web server serves them by its access rules.

    Without a console, the mount's ``any`` ports serve them after their own check of access. Without either: none.
    """
    page = config.page
    if page is None and not any(parse_endpoint(surface.at).protocol == ANY for surface in config.surfaces_of(mount)):
        return []
    allow, read_only = (None, False) if page is None else (page.allow, page.read_only if page.pin is None else True)
    return [
        SurfaceConfig(at=f"{name}@{WEB_ADDRESS}", mount=mount.name, allow=allow, read_only=read_only)
        for name, spec in PROTOCOLS.items()
        if spec.web is not None
    ]


def http_offers(web_server: WebServer) -> list[Offer]:
    """Return the console's address once for each HTTP protocol, for answers to programs that search for a server."""
    from gateway.app.discovery.offer import Offer

    speaking = [name for name, spec in PROTOCOLS.items() if spec.web is not None]
    return [Offer(name, "tcp", offer.host, offer.port) for offer in console_offers(web_server) for name in speaking]


def console_offers(web_server: WebServer) -> list[Offer]:
    """Return the console's address to announce in the network; nothing if only this computer can reach it."""
    from gateway.app.discovery.offer import HTTP, Offer

    offers = [Offer(HTTP, "tcp", *split_address(web_server.address))] if web_server.address else []
    return [offer for offer in offers if offer.is_reachable_by_others]


def qr_code(line: str) -> list[str]:
    """Return a line's first web address as a QR code of block characters; empty without address, terminal or segno."""
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


def broker_access(config: Config) -> brokers.BrokerAccess | None:
    """Return the settings for the broker; None without a broker. Raises UserError for a missing or unusable one."""
    mqtt = config.mqtt
    if mqtt is None:
        return None
    from gateway.fleet.client import get_access

    return get_access(mqtt.at, mqtt.user, mqtt.password_file, mqtt.ca)


def open_broker(
    config: Config, access: brokers.BrokerAccess | None, gateways: Sequence[Gateway], screen: Screen
) -> MqttService | None:
    """Start to publish the mounts on the broker, and return the service; None if no broker is configured."""
    if access is None or config.mqtt is None:
        return None
    from gateway.fleet.station import MqttService

    station = MqttService(config.mqtt, access, gateways, screen.say, screen.warn)
    station.start()
    return station
