"""Who may speak to the console: its own page, in a browser that reached it by an address of this computer.

A page of somebody else's that runs in the same browser may send requests here, or have its own name point here (DNS
rebinding). So ``Host`` must be an address or a name of this computer, ``Origin`` must be the page's own, and whatever
acts needs the token that only the served page holds. The port is not compared: an SSH tunnel may have another one.
"""

from __future__ import annotations

import hmac
import socket
from collections.abc import Iterable, Mapping
from functools import lru_cache
from ipaddress import ip_address

from gateway.app.discovery.addresses import held

#: Everything the page needs comes from here; nothing else is loaded, framed or run.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


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


def same_origin(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from the page itself. One without ``Origin`` comes from no page of somebody else's."""
    if origin is None:
        return True
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and host_of(rest) == host_of(host or "")


def from_elsewhere(headers: Mapping[str, str]) -> bool:
    """Whether the browser itself says that another site's page sends this."""
    return headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin")


def same_token(given: str | None, token: str) -> bool:
    """Compared in a time that tells nothing."""
    return hmac.compare_digest((given or "").encode(), token.encode())
