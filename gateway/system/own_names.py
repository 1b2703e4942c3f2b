"""What this computer is called, and the addresses that it has: by these a request is told that means this computer.

A web page of somebody else's may have its own name point here (DNS rebinding): then the name in its requests is none of
ours, though they arrive.
"""

from __future__ import annotations

import socket
from collections.abc import Iterable, Iterator
from functools import lru_cache
from ipaddress import IPv4Address, IPv6Address, ip_address


def held() -> Iterator[tuple[str, IPv4Address | IPv6Address]]:
    """Every address of this computer with the name of its interface."""
    import ifaddr  # not before somebody asks: loading it would delay every start

    for adapter in ifaddr.get_adapters():
        for one in adapter.ips:
            text = one.ip if isinstance(one.ip, str) else one.ip[0]
            yield str(adapter.nice_name), ip_address(text)


def host_of(header: str) -> str:
    """The host without its port, in lower case: ``[::1]:4080`` is ``::1``."""
    if header.startswith("["):
        return header[1:].partition("]")[0].lower()
    return header.rpartition(":")[0].lower() if header.count(":") == 1 else header.lower()


@lru_cache(maxsize=1)
def own_names() -> frozenset[str]:
    """What this computer is called: localhost, its host name, and that name as mDNS has it."""
    name = socket.gethostname().lower().partition(".")[0]
    return frozenset(("localhost", name, f"{name}.local", socket.gethostname().lower()))


def known_host(header: str | None, local: str, names: Iterable[str] = ()) -> bool:
    """Whether ``Host`` is an address of this computer, or a name of it or one of ``names``.

    ``local`` is the address at which the connection came in. Rebinding needs a name, or an address that is not ours.
    """
    host = host_of(header or "")
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return host in own_names() or host in {name.lower() for name in names}
    return address.is_loopback or _plain(local) == _plain(str(address)) or str(address) in own_addresses()


def _plain(address: str) -> str:
    """Without the zone of IPv6 and without what wraps an IPv4 address."""
    return address.partition("%")[0].removeprefix("::ffff:")


def own_addresses() -> frozenset[str]:
    """Every address of this computer, as it is now."""
    return frozenset(str(address) for _, address in held())
