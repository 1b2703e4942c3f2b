"""Checks of a configuration whose values have the right types.

Endpoints must name a known protocol and model, and have a valid address; limits must be in order; networks must be
valid; names must be unique and refer to something that exists; no port may be used twice.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import NamedTuple

from gateway.app.config.endpoints import parse_broker, parse_endpoint, suggest_address, suggest_choice
from gateway.app.config.keys import MountConfig
from gateway.app.config.programs import programs
from gateway.app.config.source import Place
from gateway.app.config.tables import Config
from gateway.clients.access import AccessRules, Networks, parse_networks
from gateway.core.errors import UserError
from gateway.protocols.registry import ANY, PROTOCOLS, accepted_protocols, drivers
from gateway.transport.listening import NETWORK_SCHEMES, split_address
from gateway.transport.tcp import is_exposed

#: The name that stands for all gateways on a broker.
ALL_GATEWAYS = "all"
_WILDCARDS = ("0.0.0.0", "::")


class Mistake(NamedTuple):
    """A mistake in the configuration: the path of its key, and a message with the correction."""

    key_path: Place
    message: str


def mistakes_in(config: Config, needs_surface: bool = True, has_file: bool = False) -> Iterator[Mistake]:
    """Yield the mistakes of a configuration whose values all have the right types, the most important first.

    ``needs_surface``: at least one surface is required. ``has_file``: the configuration is from a file, not only flags.
    """
    yield from _check_endpoints(config)
    for number, mount in enumerate(config.mount):
        lowest, highest = mount.limits.lowest, mount.limits.highest
        if lowest >= highest:
            yield Mistake(("mount", number, "lowest"), f"{lowest:g}: write less than highest, which is {highest:g}")
        yield from _check_park(number, mount)
    yield from _check_names(config)
    yield from _check_clients(config)
    yield from _check_access(config)
    yield from _check_console(config)
    yield from _check_mqtt(config)
    yield from _check_ports_unique(config)
    if needs_surface and not config.surface:
        driven = parse_endpoint(config.mount[0].at).protocol
        at = f"{next(name for name in drivers() if name != driven)}@tcp://127.0.0.1:4030"
        how = f'write [[surface]] into the file, and below it at = "{at}"' if has_file else f"--surface {at}"
        yield Mistake(("surface",), f"at least one surface is needed, where programs connect: {how}")


def _check_park(mount_index: int, mount: MountConfig) -> Iterator[Mistake]:
    """Check that ``park`` fits the mount: ``"mount"`` only if it has a park position of its own, else AZ,ALT."""
    try:
        spec = PROTOCOLS[parse_endpoint(mount.at).protocol]
    except (UserError, KeyError):
        return  # the check of the endpoint reports it
    if mount.park == "mount" and not spec.park_is_stored:
        reason = f"{spec.mount_phrase} has no park position of its own; write AZ,ALT or nothing"
        yield Mistake(("mount", mount_index, "park"), reason)
    elif isinstance(mount.park, tuple) and spec.park_is_stored:
        reason = (
            f'{spec.mount_phrase} parks at the position set with its keypad; write "mount" to allow that whatever '
            "lowest and highest say"
        )
        yield Mistake(("mount", mount_index, "park"), reason)


def _check_endpoints(config: Config) -> Iterator[Mistake]:
    for place, at in _all_endpoints(config):
        try:
            where = parse_endpoint(at, str(place[0])).where
            if place[0] == "mount" and at.startswith(f"{ANY}@"):
                listed = " or ".join(f"{name}@" for name in drivers())
                yield Mistake(place, f"{at}: {ANY} is for surfaces; write {listed} before a mount")
                continue
            if meant := suggest_address(where, place[0] == "surface"):
                yield Mistake(place, f"{at}: write {at.partition('@')[0]}@{meant}")
                continue
            spec = PROTOCOLS.get(parse_endpoint(at).protocol)
            if place[0] == "surface" and spec is not None and spec.web is not None and not where.startswith("tcp://"):
                reason = f"{at}: {spec.title} is spoken over HTTP; write {spec.name}@tcp://127.0.0.1:{spec.usual_port}"
                yield Mistake(place, reason)
                continue
            if place[0] == "surface" and where.startswith(NETWORK_SCHEMES):
                split_address(where)
        except UserError as error:
            yield Mistake(place, str(error))


def _all_endpoints(config: Config) -> Iterator[tuple[Place, str]]:
    """Yield every endpoint as the path of its key and its text."""
    yield from ((("mount", number, "at"), mount.at) for number, mount in enumerate(config.mount))
    yield from ((("surface", number, "at"), surface.at) for number, surface in enumerate(config.surface))


def _check_names(config: Config) -> Iterator[Mistake]:
    """Check that several mounts have unique names, and that every surface names its mount."""
    names = [mount.name for mount in config.mount]
    if not names:
        yield Mistake(("mount",), "at least one mount is needed")
    for number, name in enumerate(names):
        if name is None and len(names) > 1:
            yield Mistake(("mount", number, "name"), "is needed with several mounts")
        elif name is not None and name in names[:number]:
            yield Mistake(("mount", number, "name"), f"another mount already has the name {name!r}")
    known = [name for name in names if name is not None]
    for number, surface in enumerate(config.surface):
        if surface.mount is None and len(names) > 1:
            yield Mistake(
                ("surface", number, "mount"), f"is needed with several mounts; write one of {', '.join(known)}"
            )
        elif surface.mount is not None and surface.mount not in known:
            hint = suggest_choice(surface.mount, known) if known else "the mount has no name"
            yield Mistake(("surface", number, "mount"), f"no mount is called {surface.mount!r}; {hint}")
    for number, mount in enumerate(config.mount):
        if config.surface and not config.surfaces_of(mount):
            yield Mistake(("mount", number), f"no [[surface]] has mount = {mount.name!r}, so no program can reach it")


def _check_clients(config: Config) -> Iterator[Mistake]:
    for number, surface in enumerate(config.surface):
        if surface.client in ("auto", "any"):
            continue
        spoke = accepted_protocols(parse_endpoint(surface.at).protocol)
        known = [*dict.fromkeys(name for protocol in spoke for name in programs(protocol)), "auto", "any"]
        if surface.client not in known:
            reason = f"{surface.client!r}: this program is not known; {suggest_choice(surface.client, known)}"
            yield Mistake(("surface", number, "client"), reason)


def _check_access(config: Config) -> Iterator[Mistake]:
    """Check that networks are valid and only on surfaces with network connections, and ``names`` only on HTTP ones."""
    for number, surface in enumerate(config.surface):
        if surface.names and not speaks_http(surface.at):
            yield Mistake(("surface", number, "names"), "only programs that speak HTTP need this: alpaca@ and any@")
        for key, value in (("allow", surface.allow), ("read-only", surface.read_only)):
            if not isinstance(value, list):
                continue
            place: Place = ("surface", number, key)
            if not parse_endpoint(surface.at).where.startswith(NETWORK_SCHEMES):
                instead = "true or false" if key == "read-only" else "it on a surface at tcp://"
                yield Mistake(place, f"this surface has no network connections; write {instead}")
                continue
            try:
                allowed = parse_networks(value)
            except UserError as error:
                yield Mistake(place, str(error))
                continue
            if key == "allow" and (reason := _explain_excluded_hosts(parse_endpoint(surface.at).where, allowed)):
                yield Mistake(place, reason)


def speaks_http(endpoint: str) -> bool:
    """Whether programs that speak HTTP can use a surface."""
    protocol = parse_endpoint(endpoint).protocol
    return protocol == ANY or PROTOCOLS[protocol].web is not None


def _explain_excluded_hosts(where: str, allowed: Networks) -> str:
    """Return the message if no host in ``allowed`` can connect to this address; empty if any can."""
    host, port = split_address(where)
    if is_exposed(where) or AccessRules(allow=allowed).admits(host) or any(network.is_loopback for network in allowed):
        return ""
    return (
        f"no program could connect: only those of this computer reach {host}, and {host} is not among these networks; "
        f"let the surface listen at tcp://0.0.0.0:{port or 4030}, or add {host}"
    )


def _check_console(config: Config) -> Iterator[Mistake]:
    """Check the address of the console, and that its networks are valid."""
    console = config.page
    if console is None:
        return
    try:
        if not console.at.startswith("tcp://"):
            raise UserError(f"{console.at!r}: write tcp://127.0.0.1:4080, or off")
        split_address(console.at)
    except UserError as error:
        yield Mistake(("console", "at"), str(error))
    for key, value in (("allow", console.allow), ("read-only", console.read_only)):
        try:
            parse_networks(value if isinstance(value, list) else [])
        except UserError as error:
            yield Mistake(("console", key), str(error))


def _check_mqtt(config: Config) -> Iterator[Mistake]:
    """Check the broker's address, and that the gateway's name is not the name for all gateways."""
    mqtt = config.mqtt
    if mqtt is None:
        return
    try:
        broker = parse_broker(mqtt.at)
    except UserError as error:
        yield Mistake(("mqtt", "at"), str(error))
        return
    if mqtt.ca and not broker.tls:
        yield Mistake(("mqtt", "ca"), f"certificates are for TLS: write mqtts://{broker.host} in at")
    if mqtt.id == ALL_GATEWAYS:
        yield Mistake(("mqtt", "id"), f"{ALL_GATEWAYS!r} means every gateway on the broker; write another name")


def _check_ports_unique(config: Config) -> Iterator[Mistake]:
    """Check that no port is used twice, by mounts or by surfaces."""
    taken: list[tuple[str, str]] = []
    for place, at in _all_endpoints(config):
        where = parse_endpoint(at).where
        if where == "sim":
            continue
        address = _port_identity(where, place[0] == "surface")
        if any(_addresses_overlap(address, other) for other in taken):
            yield Mistake(place, f"{where} is already in use by another mount or surface; each needs its own")
        taken.append(address)


def _port_identity(where: str, is_surface: bool) -> tuple[str, str]:
    """Return what identifies a port: (HOST, "tcp PORT") if it listens on a network, else (path or URL, "")."""
    if is_surface and where.startswith(NETWORK_SCHEMES):
        host, port = split_address(where)
        return host.replace("localhost", "127.0.0.1"), f"tcp {port}"
    if "://" in where:
        return where, ""
    return os.path.abspath(os.path.expanduser(where.removeprefix("pty:"))), ""


def _addresses_overlap(address: tuple[str, str], other: tuple[str, str]) -> bool:
    if address[1] != other[1] or address[1] == "tcp 0":
        return False
    return address[0] == other[0] or (address[1] != "" and (address[0] in _WILDCARDS or other[0] in _WILDCARDS))
