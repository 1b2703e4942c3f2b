"""Builds the parts of a gateway from its configuration: drivers and transports for mounts, surfaces for ports."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from ipaddress import IPv4Network
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec

from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.app.config.programs import as_fields, first_bytes, programs, stops_all, text_delay, unmet_needs, with_needs
from gateway.app.config.tables import ConsoleConfig
from gateway.app.watchdog.client import Watchdog, WatchedMount
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import AccessRules, Networks, parse_networks
from gateway.clients.profiles import ClientProfile, EquinoxConverter, SurfaceBinding
from gateway.clients.reply_pace import HARDWARE_REPLY_TIME, delay_replies
from gateway.mount.controller import MountController
from gateway.mount.policy import Limits, Policy
from gateway.mount.shutdown import stop_commands
from gateway.protocols.base.frames import Framer
from gateway.protocols.base.reply_rules import ReplyParser, TableReplyParser
from gateway.protocols.base.session import SharedSettings
from gateway.protocols.base.spec import DriverSettings, MadeDriver, SurfaceSettings
from gateway.protocols.registry import ANY, PROTOCOLS, accepted_protocols
from gateway.transport import Accept, Listener, open_port
from gateway.transport.http_wire import HttpWire, request_bytes
from gateway.transport.listening import WEB_ADDRESS
from gateway.transport.tcp import is_exposed
from gateway.transport.web_server import WebPort, WebServer
from gateway.transport.wires import SerialTransport, Transport, bytes_on_wire

if TYPE_CHECKING:
    from gateway.clients.any_protocol.acceptor import AnyProtocolAcceptor

MakeFramer = Callable[[], Framer]


def make_driver(
    endpoint: Endpoint, config: MountConfig, now: Callable[[], float], warn: Callable[[str], None] | None = None
) -> MadeDriver:
    """Make the driver of a mount with its settings; ``now`` returns the seconds of a monotonic clock."""
    make = PROTOCOLS[endpoint.protocol].make_driver
    assert make is not None  # by the check of the configuration
    settings = DriverSettings(
        **_fields_from_config(config, DriverSettings)
        | {
            "model": endpoint.model,
            "version": endpoint.version,
            "park": config.park if isinstance(config.park, tuple) else None,
            "rates": tuple(config.rates or ()),
            "lowest": config.limits.lowest,
        }
    )
    made = make(settings, now)
    made[0].speed_factor = _speed_factor(endpoint, config.speed, warn)
    return made


def _speed_factor(endpoint: Endpoint, speed: float, warn: Callable[[str], None] | None) -> float:
    """Return how many times faster than a real mount this one slews: 1.0 on a serial port, else ``speed``."""
    elsewhere = "://" in endpoint.where
    if elsewhere and speed != 1.0 and warn is not None:
        warn(
            f"{endpoint}: speed = {speed:g} says that this mount is simulated and slews that many times faster than a "
            "real one; leave it out for a real mount"
        )
    return speed if elsewhere or endpoint.where == "sim" else 1.0


def make_surface(
    endpoint: Endpoint, config: SurfaceConfig, limits: Limits, guide_directions: str | None = None
) -> SurfaceBinding:
    """Make the surface for a port. ``guide_directions``: the mount's key, ``motor`` or ``sky``. Raises UserError."""
    spec = PROTOCOLS[endpoint.protocol]
    assert spec.make_surface is not None  # every protocol has one
    made = spec.make_surface(
        SurfaceSettings(
            endpoint.model,
            endpoint.version,
            config.precision,
            config.sync_text,
            limits,
            config.equinox or spec.equinox,
            config.degree or ("0xDF" if is_hardware_port(endpoint.where) else "*"),
        )
    )
    directions = config.guide_directions or guide_directions or spec.guides_by
    return SurfaceBinding(
        spec.title,
        made.surface,
        spec.new_framer,
        spec.opening_pattern,
        made.model,
        msgspec.structs.replace(made.client_settings, guides_by_sky=directions == "sky"),
        default_equinox=spec.equinox,
        releases_by_stop=stops_all(endpoint.protocol, config.client),
        fit_model=made.fit_model,
    )


async def open_surface(endpoint: Endpoint, surface: SurfaceConfig, accept: Accept, web: WebServer) -> Listener:
    """Open the port of a surface; ``web`` serves the protocols that use HTTP. Raises UserError."""
    spec = PROTOCOLS.get(endpoint.protocol)
    if endpoint.where == WEB_ADDRESS:
        return WebPort()
    if spec is None or spec.web is None:
        seconds = HARDWARE_REPLY_TIME if is_hardware_port(endpoint.where) else 0.0
        if surface.reply_after is not None:
            seconds = surface.reply_after / 1000.0
        return await open_port(endpoint.where, delay_replies(accept, seconds), surface.baud)
    return await web.listen(endpoint.where)


def is_hardware_port(address: str) -> bool:
    """Whether programs use this address like a telescope's serial port, and not as a plain network connection."""
    return not address.startswith("tcp://") and address not in (WEB_ADDRESS, "-")


Acceptor: TypeAlias = "ConnectionAcceptor | AnyProtocolAcceptor"  # accepts the connections of a surface


class AcceptorFactory:
    """Makes acceptors for surfaces. ``warn`` gets messages for the user; ``web`` serves HTTP on ``any@`` surfaces."""

    def __init__(
        self,
        controller: MountController,
        mount: Endpoint,
        config: MountConfig,
        shared_settings: SharedSettings,
        clock: Callable[[], float],
        sky: Sky,
        warn: Callable[[str], None],
        web: WebServer,
    ) -> None:
        self._controller, self._mount, self._config = controller, mount, config
        self._shared_settings, self._clock, self._warn, self._web = shared_settings, clock, warn, web
        self._converter = EquinoxConverter(sky, controller.sources.unix)
        #: The bindings of all surfaces with their protocols, and those that present the mount itself.
        self.bindings: list[tuple[str, SurfaceBinding]] = []
        self.native_bindings: list[SurfaceBinding] = []

    def make(self, surface_number: int, endpoint: Endpoint, surface: SurfaceConfig) -> Acceptor:
        """Make the acceptor of a surface; ``surface_number`` counts surfaces from 1. Raises UserError."""
        if endpoint.protocol != ANY:
            return self._make_acceptor(surface_number, endpoint, surface)
        acceptors, titles = {}, ", ".join(PROTOCOLS[name].title for name in accepted_protocols(ANY))
        for protocol in accepted_protocols(ANY):
            part = with_needs(msgspec.structs.replace(surface, at=f"{protocol}@{endpoint.where}"))
            acceptors[protocol] = self._make_acceptor(surface_number, Endpoint(protocol, endpoint.where), part, titles)
        from gateway.clients.any_protocol.acceptor import AnyProtocolAcceptor

        return AnyProtocolAcceptor(acceptors, self._web)

    def _make_acceptor(
        self, surface_number: int, endpoint: Endpoint, surface: SurfaceConfig, protocol_titles: str = ""
    ) -> ConnectionAcceptor:
        """Make a surface's acceptor for one protocol. ``protocol_titles`` is empty for a surface of one protocol."""
        rules, bind = access_rules(surface, self._config), partial(self._bind, endpoint, surface, protocol_titles)
        later = endpoint.where == WEB_ADDRESS and endpoint.protocol != self._mount.protocol  # with the web server
        made, where, only = bind if later else bind(), endpoint.where, not protocol_titles
        return ConnectionAcceptor(
            self._controller, made, self._shared_settings, self._clock, surface_number, rules, where, self._warn, only
        )

    def _bind(self, endpoint: Endpoint, surface: SurfaceConfig, protocol_titles: str) -> SurfaceBinding:
        binding = make_surface(endpoint, surface, self._config.limits, self._config.guide_directions)
        binding.surface.speaks_mount_protocol = endpoint.protocol == self._mount.protocol
        if presents_mount(self._mount, endpoint):
            binding = msgspec.structs.replace(binding, fit_model=None)
            self.native_bindings.append(binding)
        binding = msgspec.structs.replace(
            binding,
            protocol_titles=protocol_titles or binding.protocol_titles,
            j2000_converter=self._converter if (surface.equinox or binding.default_equinox) == "j2000" else None,
            model_converter=None if surface.equinox else self._converter,
            profiles=tuple(profiles_of(endpoint.protocol, surface, self._converter)),
            hold_time=text_delay(surface, endpoint.protocol, surface.client),
        )
        self.bindings.append((endpoint.protocol, binding))
        return binding


def framer_and_parser(protocol: str, model: str | None = None) -> tuple[MakeFramer, ReplyParser]:
    """Return the factory of a protocol's framer, and a parser for the replies of a mount's model (None: unknown)."""
    spec = PROTOCOLS[protocol]
    if spec.reply_rules is None:
        return spec.new_framer, TableReplyParser(spec.commands)
    return spec.new_framer, spec.reply_rules(model) if model in spec.commands.dialect_by_model else spec.reply_rules()


def policy_of(config: MountConfig) -> Policy:
    """Return the operator's settings in the form that the controller takes."""
    return Policy(**_fields_from_config(config, Policy) | {"own_park": config.park is not None})


def _fields_from_config(config: MountConfig, struct: type[msgspec.Struct]) -> dict[str, Any]:
    """Return the configured values for those fields of ``struct`` that have the name of a key."""
    return {name: getattr(config, name) for name in struct.__struct_fields__ if hasattr(config, name)}


def access_rules(surface: SurfaceConfig, config: MountConfig) -> AccessRules:
    """Return the access rules of a surface: networks, read-only, connection limit, hibernation. Raises UserError."""
    return AccessRules(*access_networks(surface), surface.max_clients, config.hibernate)


def access_networks(config: SurfaceConfig | ConsoleConfig) -> tuple[Networks | None, bool | Networks]:
    """Return the networks that may connect (None: all), and those that may only read (True: all). Raises UserError."""
    read_only = config.read_only
    allowed = None if config.allow is None else parse_networks(config.allow)
    return allowed, read_only if isinstance(read_only, bool) else parse_networks(read_only)


def exposure_warning(address: str, surface: SurfaceConfig, networks_of: Callable[[str], Sequence[IPv4Network]]) -> str:
    """Return the warning for a port that other computers can reach; empty if there is nothing to warn of.

    ``networks_of`` returns the networks of this computer from which phones reach an address.
    """
    if not is_exposed(address):
        return ""
    reached = networks_of(address)
    if surface.allow is not None:
        allowed = parse_networks(surface.allow)
        outside = [
            network
            for network in reached
            if not any(network.overlaps(other) for other in allowed if other.version == 4)
        ]
        return f"{address}: allow excludes the network {outside[0]}, from which phones connect" if outside else ""
    if surface.read_only is True:
        return ""
    only = "".join(f"{network}," for network in reached[:1])
    return (
        f"{address} has no password: anyone on your network can move the mount. --allow {only}127.0.0.1 lets in only "
        f"{'that network and ' if only else ''}this computer"
    )


def profiles_of(protocol: str, surface: SurfaceConfig, converter: EquinoxConverter) -> Iterator[ClientProfile]:
    """Yield a profile for each program that a surface recognises by its first bytes."""
    for first, program in first_bytes(surface).items():
        needs = as_fields(unmet_needs(surface, program))
        equinox = converter if needs.pop("equinox", None) == "j2000" else None
        row = programs(protocol)[program]
        yield ClientProfile(first, row.name, needs, equinox, text_delay(surface, protocol, program), row.stops_arrows)


def watch_mount(
    watchdog: Watchdog,
    title: str,
    lock: Path | None,
    controller: Callable[[], MountController],
    on_stop: Callable[[], None],
) -> WatchedMount:
    """Register the mount with the watchdog process. ``controller`` is first called when a motion is about to begin."""

    @cache
    def encode_for_wire(url: str, protocol: str, command: bytes) -> bytes:
        if (make_dialect := PROTOCOLS[protocol].make_http_dialect) is None:
            return bytes_on_wire(url, command)
        return request_bytes(url, make_dialect(url).request(command))

    def stop_bytes() -> list[bytes]:
        line, driver = controller().line, controller().driver
        return [
            encode_for_wire(line.wire.name, driver.protocol.name, command)
            for command in stop_commands(driver, line.reply_rules)
        ]

    return watchdog.watch(
        title, lock, stop_bytes, lambda: controller().reconciler.busy, on_stop, lambda: controller().watch.on_clear_path
    )


def presents_mount(mount: Endpoint, surface: Endpoint) -> bool:
    """Whether a surface presents the mount itself: it has the mount's protocol, and the user named no model.

    A mount whose model speaks a dialect of the protocol is presented as a standard model instead.
    """
    is_dialect = mount.model in PROTOCOLS[mount.protocol].commands.dialect_by_model
    return mount.protocol == surface.protocol and surface.model is None and surface.version is None and not is_dialect


def configure_binding(controller: MountController, binding: SurfaceBinding) -> None:
    """Make a surface present the model and version that the mount has reported, and reply in the mount's notation."""
    binding.model.update(controller.driver.presented_model())
    binding.surface.to_mount_form = controller.line.reply_rules.in_mount_notation


def make_transport(mount: Endpoint, config: MountConfig, watchdog_mount: WatchedMount | None) -> Transport:
    """Make the transport to a mount; the watchdog process may use the same port."""
    if mount.where == "sim":
        from gateway.app.simulated import simulated_transport

        return simulated_transport(mount, config)
    if (make_dialect := PROTOCOLS[mount.protocol].make_http_dialect) is not None:
        return HttpWire(mount.where, make_dialect(mount.where), watchdog_mount)
    return SerialTransport(mount.where, config.baud, watchdog_mount)
