"""The names and addresses of this computer, to check that a web request is addressed to it.

The host name of a malicious web page may resolve to this computer (DNS rebinding): requests then carry that name.
"""

from __future__ import annotations

import socket
from collections.abc import Iterable, Iterator
from functools import lru_cache
from ipaddress import IPv4Address, IPv4Network, IPv6Address, ip_address


def interface_addresses() -> Iterator[tuple[str, IPv4Address | IPv6Address]]:
    """Yield every address of this computer with the name of its interface."""
    import ifaddr  # imported late, because it would delay every start

    for adapter in ifaddr.get_adapters():
        for address in adapter.ips:
            text = address.ip if isinstance(address.ip, str) else address.ip[0]
            yield str(adapter.nice_name), ip_address(text)


def ipv4_networks() -> Iterator[tuple[IPv4Address, IPv4Network]]:
    """Yield every IPv4 address of this computer with its network."""
    import ifaddr

    for adapter in ifaddr.get_adapters():
        for address in adapter.ips:
            if isinstance(address.ip, str):
                yield IPv4Address(address.ip), IPv4Network(f"{address.ip}/{address.network_prefix}", strict=False)


def host_of(header: str) -> str:
    """Return the host of a ``Host`` header without its port, in lower case: ``[::1]:4080`` is ``::1``."""
    if header.startswith("["):
        return header[1:].partition("]")[0].lower()
    return header.rpartition(":")[0].lower() if header.count(":") == 1 else header.lower()


@lru_cache(maxsize=1)
def own_names() -> frozenset[str]:
    """Return this computer's names: localhost, its host name, and its mDNS name."""
    name = socket.gethostname().lower().partition(".")[0]
    return frozenset(("localhost", name, f"{name}.local", socket.gethostname().lower()))


def is_own_host(header: str | None, local_address: str, extra_names: Iterable[str] = ()) -> bool:
    """Whether a ``Host`` header names this computer: any of its addresses or names, or any of ``extra_names``.
    ``local_address`` is the address at which the connection arrived. DNS rebinding sends another name or address.
    """
    host = host_of(header or "")
    if host and host in {host_of(name) for name in extra_names}:
        return True
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return host in own_names()
    if address.is_loopback or normalise_address(str(address)) == normalise_address(local_address):
        return True
    return str(address) in {str(own) for _, own in interface_addresses()}


def normalise_address(address: str) -> str:
    """Return an address without its IPv6 zone and without the prefix of an IPv4-mapped address."""
    return address.partition("%")[0].removeprefix("::ffff:")
