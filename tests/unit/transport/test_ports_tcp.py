"""TCP surfaces: addresses of both kinds, a port that is free again at once, connections that die."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.core.errors import UserError
from gateway.transport import open_port
from gateway.transport.handler import NewConnection
from gateway.transport.listening import split_address
from gateway.transport.tcp import TcpPort
from tests.unit.transport.test_ports_rfc2217 import Echo

pytestmark = pytest.mark.real_time


async def echo_at(where: str) -> TcpPort:
    port = await open_port(where, lambda connected: Echo(connected.write))
    assert isinstance(port, TcpPort)
    return port


async def reaches(host: str, port: TcpPort) -> bool:
    reader, writer = await asyncio.open_connection(host, split_address(port.address)[1])
    writer.write(b"?")
    async with asyncio.timeout(60):
        heard = await reader.readexactly(1)
    writer.close()
    await writer.wait_closed()
    return heard == b"?"


def has_ipv6() -> bool:
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False


IPV6 = pytest.mark.skipif(not has_ipv6(), reason="this computer has no IPv6")


@IPV6
@pytest.mark.parametrize("scheme", ["tcp", "rfc2217"])
async def test_tcp_surface_serves_ipv6(scheme: str) -> None:
    port = await echo_at(f"{scheme}://[::1]:0")
    assert port.address.startswith(f"{scheme}://[::1]:")
    assert await reaches("::1", port)
    await port.close()
    both = await echo_at(f"{scheme}://[::]:0")
    assert await reaches("::1", both) and await reaches("127.0.0.1", both)
    await both.close()


async def test_closed_tcp_port_is_free_again_at_once() -> None:
    """Connections that were closed from this side linger in the system; they must not hold the port."""
    port = await echo_at("tcp://127.0.0.1:0")
    client = socket.create_connection(("127.0.0.1", split_address(port.address)[1]))
    while not port.connections:
        await asyncio.sleep(0)
    where = port.address
    await port.close()
    again = await echo_at(where)
    assert again.address == where
    with pytest.raises(UserError, match="the port is in use"):
        await echo_at(where)
    client.close()
    await again.close()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="the system does not show its timers")
async def test_tcp_surface_enables_keepalive() -> None:
    port = await echo_at("tcp://127.0.0.1:0")
    reader, writer = await asyncio.open_connection("127.0.0.1", split_address(port.address)[1])
    writer.write(b"?")
    await reader.readexactly(1)
    (connection,) = port.connections
    stream = connection._transport.get_extra_info("socket")
    tcp = socket.IPPROTO_TCP
    assert stream.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
    assert stream.getsockopt(tcp, socket.TCP_NODELAY) == 1
    silent = stream.getsockopt(tcp, socket.TCP_KEEPIDLE) + stream.getsockopt(
        tcp, socket.TCP_KEEPINTVL
    ) * stream.getsockopt(tcp, socket.TCP_KEEPCNT)
    assert silent <= 60 and stream.getsockopt(tcp, socket.TCP_USER_TIMEOUT) <= 60_000
    writer.close()
    await port.close()


@pytest.mark.parametrize("where", ["tcp://::1:4030", "rfc2217://127.0.0.1", "rfc2217://:70000", "tcp://[::1:4030"])
def test_invalid_tcp_address_is_reported(where: str) -> None:
    with pytest.raises(UserError, match=f"{where[:3]}.*HOST:PORT|0 .any free one. to 65535"):
        split_address(where)


@pytest.mark.parametrize("scheme", ["tcp", "rfc2217"])
def test_tcp_writer_learns_how_much_a_slow_reader_has_pending(scheme: str) -> None:
    """What is pushed goes by it: nothing is added to what is not taken."""

    async def main() -> None:
        writes: list[Callable[[bytes], Any]] = []

        def arrive(connected: NewConnection) -> Echo:
            writes.append(connected.write)
            return Echo(connected.write)

        port = await open_port(f"{scheme}://127.0.0.1:0", arrive)
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", split_address(port.address)[1]))
        async with asyncio.timeout(60):
            while not writes:
                await asyncio.sleep(0)
        assert not writes[0](b"")
        waiting, written = 0, 0
        while not waiting and written < 2**26:
            waiting, written = writes[0](bytes(16384)), written + 16384
        assert 0 < waiting <= 16384
        assert writes[0](b"") == waiting
        client.setblocking(False)
        async with asyncio.timeout(60):
            while writes[0](b""):
                with contextlib.suppress(BlockingIOError):
                    client.recv(65536)
                await asyncio.sleep(0)
        client.close()
        await port.close()

    asyncio.run(main())
