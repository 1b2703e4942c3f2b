"""Where a gateway that serves is shown besides its surfaces: on the console's page, and on an MQTT broker.

No program waits for either: the console is opened once the surfaces are ready, and the broker is connected to beside
all else. What is not wanted is not loaded.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from gateway.app.config import Config, MountConfig, SurfaceConfig
from gateway.app.config.tables import ConsoleConfig
from gateway.cli.serve.live import Screen
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.transport.listening import SERVED, split_address

if TYPE_CHECKING:
    from gateway.app.discovery.offer import Offer
    from gateway.app.gateway import Gateway
    from gateway.clients.access import Access
    from gateway.console.server import Console
    from gateway.fleet import client as brokers
    from gateway.fleet.station import Station


async def open_console(config: Config, gateways: Sequence[Gateway], screen: Screen) -> Console | None:
    """Open the page and say where it is; None where there is to be none, or where it cannot be opened."""
    if config.page is None:
        return None
    console = await asyncio.to_thread(_made_ready)  # a quarter of a second that nobody is to wait for
    page = console(gateways, _access(config.page), config.page.pin or "", config.page.names, _doors(gateways))
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
    for line in from_elsewhere(page):
        screen.say(line)
    return page


def answered_there(config: Config, mount: MountConfig) -> list[SurfaceConfig]:
    """The surfaces of programs that speak HTTP, which the console's server answers by the console's rules."""
    page = config.page
    if page is None:
        return []
    looks = page.read_only if page.pin is None else True
    return [
        SurfaceConfig(at=f"{name}@{SERVED}", mount=mount.name, allow=page.allow, read_only=looks)
        for name, spec in PROTOCOLS.items()
        if spec.web is not None
    ]


def _doors(gateways: Sequence[Gateway]) -> dict[int, Access]:
    """The ports of surfaces where browsers come in, too, and who may do what there."""
    return {
        split_address(port.where)[1]: reception.access
        for gateway in gateways
        for endpoint, port, reception in zip(gateway.endpoints, gateway.ports, gateway.receptions, strict=True)
        if endpoint.protocol == ANY
    }


def _made_ready() -> type[Console]:
    """The web server, loaded."""
    made: type[Console] = import_module("gateway.console.server").Console
    return made


def _access(page: ConsoleConfig) -> Access:
    from gateway.app.bindings import admission
    from gateway.clients.access import Access

    return Access(*admission(page))


def offer(page: Console) -> Offer:
    """The console as something to be found on the network."""
    from gateway.app.discovery.offer import Offer

    return Offer("http", "mount-gateway", "tcp", page.host, page.port)


def to_be_found(page: Console | None) -> list[Offer]:
    """The same server as programs that speak HTTP look for it."""
    from gateway.app.discovery.offer import Offer

    speaking = [name for name, spec in PROTOCOLS.items() if spec.web is not None]
    return [Offer(name, "", "tcp", one.host, one.port) for one in announced(page) for name in speaking]


def announced(page: Console | None) -> list[Offer]:
    """What is told on the network of a console: nothing of one that only this computer reaches."""
    return [found] if page is not None and (found := offer(page)).wide else []


def from_elsewhere(page: Console) -> list[str]:
    """What to type on a phone, and the same as a QR code, where other computers reach the page."""
    from gateway.app.discovery.offer import to_type

    found = offer(page)
    if not found.wide:
        return []
    addresses = [f"http://{f'[{address}]' if ':' in address else address}:{page.port}/" for address in to_type(found)]
    if not addresses:
        return [f"no other computer reaches the console's port {page.port}: this one is in no network now"]
    return [f"on your phone: {' or '.join(addresses)}", *qr_code(addresses[0])]


def qr_code(address: str) -> list[str]:
    """An address as a QR code of block characters, where a terminal shows it and the library is there."""
    import sys

    if not sys.stdout.isatty():
        return []
    try:
        import segno
    except ImportError:
        return []
    import io

    drawn = io.StringIO()
    segno.make(address, micro=False, error="l").terminal(drawn, compact=True)
    return drawn.getvalue().rstrip("\n").split("\n")


def let_in(config: Config) -> brokers.Access | None:
    """What the broker asks for; None where there is to be none. Raises UserError for what is missing."""
    mqtt = config.mqtt
    if mqtt is None:
        return None
    from gateway.fleet.client import access

    return access(mqtt.at, mqtt.user, mqtt.password_file, mqtt.ca)


def open_broker(
    config: Config, access: brokers.Access | None, gateways: Sequence[Gateway], screen: Screen
) -> Station | None:
    """Show the mounts on the broker, as soon as it is there and for as long as the gateway runs."""
    if access is None or config.mqtt is None:
        return None
    from gateway.fleet.station import Station

    station = Station(config.mqtt, access, gateways, screen.say, screen.warn)
    station.start()
    return station
