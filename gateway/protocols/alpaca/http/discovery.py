"""ASCOM's discovery: programs ask everybody on the network for Alpaca ports, and each port answers by itself.

A question comes to UDP port 32227, by broadcast, or over IPv6 to a group; the answer is one line of JSON. Several
servers of one computer share that port. One that only this computer reaches is told to programs of this computer alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import struct
from collections.abc import Callable, Iterable, Sequence
from ipaddress import ip_address
from typing import cast

from gateway.system.own_names import held

PORT, GROUP = 32227, "ff12::a1:9aca"
#: What a question begins with; the number behind it is the version.
QUESTION = b"alpacadiscovery1"

#: The address that a server listens on, in numbers, and its port.
Place = tuple[str, int]


class _Answering(asyncio.DatagramProtocol):
    def __init__(self, places: Sequence[Place]) -> None:
        self._places = places

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        for reply in answers(data, self._places, addr[0]):
            with contextlib.suppress(OSError):
                self._transport.sendto(reply, addr)


def answers(question: bytes, places: Sequence[Place], asker: str) -> Iterable[bytes]:
    """One for every place that the asker reaches; none to what is no such question."""
    if not question.startswith(QUESTION):
        return
    theirs = ip_address(asker.partition("%")[0])
    own = theirs.is_loopback or theirs in (address for _, address in held())
    for host, port in places:
        ours = ip_address(host.partition("%")[0])
        if (own or not ours.is_loopback) and (ours.version == theirs.version or host == "::"):
            yield json.dumps({"AlpacaPort": port}).encode()


async def answer_discovery(places: Sequence[Place], port: int = PORT) -> Callable[[], None]:
    """Answer until the returned function is called. Raises OSError where no question can be heard."""
    loop = asyncio.get_running_loop()
    sockets = [_ipv4(port)]
    if any(":" in host for host, _ in places):
        with contextlib.suppress(OSError):  # this computer has no IPv6
            sockets.append(_ipv6(port))
    made = [await loop.create_datagram_endpoint(lambda: _Answering(places), sock=one) for one in sockets]

    def end() -> None:
        for transport, _ in made:
            transport.close()

    return end


def _shared(family: socket.AddressFamily) -> socket.socket:
    """A socket whose port others may use, too."""
    made = socket.socket(family, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if hasattr(socket, "SO_REUSEPORT"):
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    made.setblocking(False)
    return made


def _ipv4(port: int) -> socket.socket:
    made = _shared(socket.AF_INET)
    try:
        made.bind(("0.0.0.0", port))
    except OSError as error:
        made.close()
        raise OSError(error.errno, f"UDP port {port}: {error.strerror}") from None
    return made


def _ipv6(port: int) -> socket.socket:
    """A member of the group on every interface that takes one."""
    made = _shared(socket.AF_INET6)
    try:
        made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        made.bind(("::", port))
    except OSError:
        made.close()
        raise
    for number, _ in socket.if_nameindex():
        member = socket.inet_pton(socket.AF_INET6, GROUP) + struct.pack("@I", number)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, member)
    return made
