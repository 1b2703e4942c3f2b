"""Answers ASCOM's discovery, in which a program asks all computers in the network for their Alpaca ports.

The request is sent to UDP port 32227, by broadcast or to an IPv6 multicast group; the answer is one line of JSON. The
servers of one computer share that UDP port. A loopback port is only reported to programs on this computer.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import struct
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from ipaddress import ip_address
from typing import Any, cast

from gateway.system.own_names import interface_addresses
from gateway.transport.web_server import WebDevice

DISCOVERY_PORT, MULTICAST_GROUP = 32227, "ff12::a1:9aca"
#: The beginning of a discovery request; its last digit is the version.
DISCOVERY_REQUEST = b"alpacadiscovery1"

#: The numeric address and the port that a server listens on.
HostAndPort = tuple[str, int]


class _DiscoveryResponder(asyncio.DatagramProtocol):
    def __init__(self, addresses: Sequence[HostAndPort]) -> None:
        self._addresses = addresses

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        for reply in discovery_replies(data, self._addresses, addr[0]):
            with contextlib.suppress(OSError):
                self._transport.sendto(reply, addr)


def discovery_replies(request: bytes, addresses: Sequence[HostAndPort], client_host: str) -> Iterable[bytes]:
    """Yield an answer for each port that ``client_host`` can reach; nothing if ``request`` is no discovery request."""
    if not request.startswith(DISCOVERY_REQUEST):
        return
    theirs = ip_address(client_host.partition("%")[0])
    local = theirs.is_loopback or theirs in (address for _, address in interface_addresses())
    for host, port in addresses:
        ours = ip_address(host.partition("%")[0])
        if (local or not ours.is_loopback) and (ours.version == theirs.version or host == "::"):
            yield json.dumps({"AlpacaPort": port}).encode()


async def answer_discovery(addresses: Sequence[HostAndPort], port: int = DISCOVERY_PORT) -> Callable[[], None]:
    """Answer discovery until the returned function is called. Raises OSError if the UDP port cannot be opened."""
    loop = asyncio.get_running_loop()
    sockets = [_ipv4_socket(port)]
    if any(":" in host for host, _ in addresses):
        with contextlib.suppress(OSError):  # without IPv6, answer over IPv4 only
            sockets.append(_ipv6_socket(port))
    made = [await loop.create_datagram_endpoint(lambda: _DiscoveryResponder(addresses), sock=sock) for sock in sockets]

    def end() -> None:
        for transport, _ in made:
            transport.close()

    return end


def _shared_port_socket(family: socket.AddressFamily) -> socket.socket:
    """Return a UDP socket that shares its port with other programs."""
    made = socket.socket(family, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if hasattr(socket, "SO_REUSEPORT"):
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    made.setblocking(False)
    return made


def _ipv4_socket(port: int) -> socket.socket:
    made = _shared_port_socket(socket.AF_INET)
    try:
        made.bind(("0.0.0.0", port))
    except OSError as error:
        made.close()
        raise OSError(error.errno, f"UDP port {port}: {error.strerror}") from None
    return made


def _ipv6_socket(port: int) -> socket.socket:
    """Return a socket that has joined the multicast group on every interface that allows it."""
    made = _shared_port_socket(socket.AF_INET6)
    try:
        made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        made.bind(("::", port))
    except OSError:
        made.close()
        raise
    for number, _ in socket.if_nameindex():
        member = socket.inet_pton(socket.AF_INET6, MULTICAST_GROUP) + struct.pack("@I", number)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, member)
    return made


# --- Alpaca as a part of the web server -------------------------------------------------------------------------------


class AlpacaWeb:
    """Alpaca's part of the web server. The modules that serve requests are imported when the first client connects."""

    def load_modules(self) -> None:
        """Import the modules that serve requests, and with them aiohttp."""
        import_module("gateway.protocols.alpaca.http.server")

    def add_routes(self, app: Any, devices: Sequence[WebDevice]) -> None:
        """Add the routes of these devices to the aiohttp application."""
        from gateway.protocols.alpaca.http.server import AlpacaServer

        AlpacaServer(devices).add_to(app)

    async def answer_discovery(self, addresses: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Answer ASCOM's discovery; return the function that ends this. Raises OSError."""
        return await answer_discovery(addresses)
