"""The surfaces that can be announced, and the addresses at which other computers reach them."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Callable, Iterable
from ipaddress import IPv4Address, IPv4Network, IPv6Address

from msgspec import Struct

from gateway.system.own_names import interface_addresses, ipv4_networks
from gateway.transport.listening import split_address, url_host

WILDCARD_ADDRESSES = ("0.0.0.0", "::")
NETWORK_SCHEMES = ("tcp", "rfc2217")
#: The protocol of an offer that is a web page.
HTTP = "http"
#: Interfaces of containers and virtual machines within this computer: other computers cannot use their addresses.
_INTERNAL_INTERFACES = ("docker", "br-", "veth", "virbr", "vmnet", "vboxnet", "lxc", "lxd", "podman")
#: A remote address, reserved for examples: the route to it begins at this computer's main address.
_REMOTE_ADDRESS = ("192.0.2.1", 9)

#: The addresses of this computer, each with the name of its interface.
Held = Iterable[tuple[str, IPv4Address | IPv6Address]]


class Offer(Struct, frozen=True):
    """A surface, or the console, on a network port; ``host`` is the numeric address to which the port is bound."""

    protocol: str
    scheme: str
    host: str
    port: int

    @property
    def is_reachable_by_others(self) -> bool:
        """Whether other computers can reach this port."""
        return not ipaddress.ip_address(self.host.partition("%")[0]).is_loopback

    @property
    def reached_by_ipv4(self) -> bool:
        return "." in self.host or self.host == "::"


def network_offers(endpoint_texts: Iterable[str]) -> list[Offer]:
    """Return the network surfaces among texts ``PROTOCOL:MODEL@WHERE [NAME]``, as in the ready lines."""
    offers = []
    for name in endpoint_texts:
        what, _, rest = name.partition("@")
        where = rest.partition(" ")[0]
        scheme = where.partition("://")[0]
        if scheme in NETWORK_SCHEMES:
            offers.append(Offer(what.partition(":")[0], scheme, *split_address(where)))
    return offers


def address_towards(client_address: tuple[str, int]) -> str:
    """Return this computer's address on the route to another computer; empty without a route. Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way:
        try:
            way.connect(client_address)
        except OSError:
            return ""
        return str(way.getsockname()[0])


def reachable_addresses(
    offer: Offer,
    list_interfaces: Callable[[], Held] = interface_addresses,
    get_main_address: Callable[[tuple[str, int]], str] = address_towards,
) -> list[str]:
    """Return the addresses at which others reach an offer, the likeliest first; IPv6 only if there is no IPv4."""
    if offer.host not in WILDCARD_ADDRESSES:
        return [offer.host] if offer.is_reachable_by_others else []
    outer = [
        address
        for name, address in list_interfaces()
        if not (address.is_loopback or address.is_link_local or name.lower().startswith(_INTERNAL_INTERFACES))
    ]
    ipv4 = [str(address) for address in outer if address.version == 4]
    ipv6 = [str(address) for address in outer if address.version == 6] if offer.host == "::" else []
    likeliest = get_main_address(_REMOTE_ADDRESS)
    return sorted(dict.fromkeys(ipv4 or ipv6), key=lambda address: address != likeliest)


def reachable_networks(where: str) -> list[IPv4Network]:
    """Return the IPv4 networks of the addresses at which other computers reach ``SCHEME://HOST:PORT``."""
    if where.partition("://")[0] not in NETWORK_SCHEMES:
        return []
    addresses = reachable_addresses(Offer("", "", *split_address(where)))
    known = {str(address): network for address, network in ipv4_networks()}
    return [known[address] for address in addresses if address in known]


def web_address(host: str, port: int) -> str:
    """Return the URL of a web page for a browser on this computer; ``host`` is the address at which it is served."""
    return f"http://{ {'0.0.0.0': '127.0.0.1', '::': '[::1]'}.get(host, url_host(host)) }:{port}/"


def phone_instruction(offer: Offer, addresses: list[str]) -> str:
    """Return the line that says what to type on a phone or another computer; for a web page, in its browser."""
    page = offer.protocol == HTTP
    if not addresses:
        port = f"the console's port {offer.port}" if page else f"port {offer.port}"
        help_page = "in the field: docs/programs/skysafari.md"
        return f"no other computer reaches {port}: this one is not in a network yet ({help_page})"
    if page:
        return f"on your phone: {' or '.join(f'http://{url_host(address)}:{offer.port}/' for address in addresses)}"
    where = " or ".join(addresses)
    if offer.scheme != "tcp":
        return f"on another computer: {offer.scheme}://{where}:{offer.port}"
    return f"on your phone: {where}, port {offer.port}"
