"""Opens a listening port at an address, with a clear message if that is not possible."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
from collections.abc import Callable

from gateway.core.errors import UserError
from gateway.system import processes

#: Maximum number of connections waiting to be accepted; clients that open a connection per command come in bursts.
ACCEPT_BACKLOG = 512
#: Schemes of addresses at which clients connect over the network.
NETWORK_SCHEMES = ("tcp://", "rfc2217://")
#: Used in place of an address if an existing web server serves the requests.
WEB_ADDRESS = "web"


async def listen(
    address: str, make_protocol: Callable[[], asyncio.BaseProtocol], max_tries: int = 0
) -> tuple[asyncio.Server, str]:
    """Listen on ``SCHEME://HOST:PORT``. Return the server and the address with the real port number. Raises UserError.

    ``make_protocol`` is called for every connection. Without a host only this computer can connect. Port 0 means any
    free port. If the port is in use, those after it are tried, up to ``max_tries`` in all. ``[::]`` is every address,
    IPv4 and IPv6.
    """
    host, port = split_address(address)
    try:
        for last in range(port, min(port + max_tries, 65535) if port else 0):
            with contextlib.suppress(OSError):
                server = await _listen_on(host, last, make_protocol)
                break
        else:
            server = await _listen_on(host, port, make_protocol)
    except UnicodeError:
        raise UserError(f"cannot listen on {address}: {host!r} is not a valid host name") from None
    except OSError as error:
        raise UserError(f"cannot listen on {address}: {_reason(error, host, port)}") from None
    real = server.sockets[0].getsockname()
    return server, f"{address.partition('://')[0]}://{url_host(real[0])}:{real[1]}"


async def _listen_on(host: str, port: int, make_protocol: Callable[[], asyncio.BaseProtocol]) -> asyncio.Server:
    loop = asyncio.get_running_loop()
    if host != "::":
        return await loop.create_server(make_protocol, host, port, backlog=ACCEPT_BACKLOG)
    both = socket.create_server(
        (host, port), family=socket.AF_INET6, backlog=ACCEPT_BACKLOG, dualstack_ipv6=socket.has_dualstack_ipv6()
    )
    return await loop.create_server(make_protocol, sock=both, backlog=ACCEPT_BACKLOG)


def _reason(error: OSError, host: str, port: int) -> str:
    if isinstance(error, socket.gaierror):
        return (
            f"no address is known for the name {host}; write 0.0.0.0 for every computer that can reach "
            "this one, or 127.0.0.1 for programs on it"
        )
    if isinstance(error, PermissionError):
        return "ports below 1024 are for the system's own services; take a higher one, such as 4030"
    if "assign requested" in str(error):
        return "this computer has no such address; 0.0.0.0 stands for all that it has, 127.0.0.1 for programs on it"
    if error.errno == errno.EADDRINUSE or "in use" in str(error):
        return f"the port is in use by {_port_holder(port)}"
    return error.strerror or str(error)


def _port_holder(port: int) -> str:
    """Return which program listens on a port, by name if it is visible, and what the user can do."""
    for pid, name in (owner for _, owner in processes.listeners_on([port]) if owner):
        if pid != os.getpid() and processes.is_gateway(pid):
            return f"another mount-gateway (process {pid}): end it, with Ctrl-C in its terminal, or write another port"
        if pid != os.getpid():
            return f"another program, {name} (process {pid}); write another port, or end that program"
    return "another program (another mount-gateway?); write another port, or end that program"


def split_address(url: str) -> tuple[str, int]:
    """Split ``SCHEME://HOST:PORT`` into (host, port); no host means 127.0.0.1. Raises UserError if it is malformed."""
    scheme, _, address = url.partition("://")
    host, colon, number = address.rpartition(":")
    digits = number.removeprefix("-")
    decimal = digits.isdecimal() and digits.isascii()
    if decimal and (len(digits) > 5 or not 0 <= int(number) <= 65535):
        raise UserError(f"{url}: a port is a number from 0 (any free one) to 65535")
    if not colon or not decimal or (":" in host and not (host.startswith("[") and host.endswith("]"))):
        raise UserError(f"{url}: write {scheme}://HOST:PORT, for example {scheme}://127.0.0.1:4030")
    return host.strip("[]") or "127.0.0.1", int(number)


def url_host(host: str) -> str:
    return f"[{host}]" if ":" in host else host
