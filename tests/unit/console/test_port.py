"""The console's port before the web server is there: whom it lets wait, for how long, and how many."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from gateway.clients.any_protocol import web as waiting
from gateway.clients.any_protocol.web import Web
from gateway.console import port as port_module
from gateway.console.port import ConsolePort


@asynccontextmanager
async def opened(number: int = 0) -> AsyncIterator[ConsolePort]:
    port = ConsolePort(Web(asyncio.get_running_loop().call_later))
    await port.open("127.0.0.1", number)
    try:
        yield port
    finally:
        port.web.close()
        port.close()


class Server(asyncio.Protocol):
    """Stands for the web server: sends back what it gets."""

    def __init__(self, transport: asyncio.Transport, data: bytes) -> None:
        self.transport = transport
        transport.set_protocol(self)
        self.data_received(data)

    def data_received(self, data: bytes) -> None:
        self.transport.write(data.upper())


def test_the_first_byte_wants_the_server_and_nothing_is_lost_until_it_is_there() -> None:
    async def program() -> None:
        async with opened() as port:
            reader, writer = await asyncio.open_connection(port.host, port.port)
            await asyncio.sleep(0.05)
            assert not port.web.wanted.is_set(), "somebody who only connects loads nothing"
            writer.write(b"get /")
            await asyncio.wait_for(port.web.wanted.wait(), 20.0)
            writer.write(b" now")
            while port.web._waiting[0].sent != b"get / now":
                await asyncio.sleep(0.005)
            port.web.open(Server)
            assert await asyncio.wait_for(reader.readexactly(9), 20.0) == b"GET / NOW"
            writer.write(b"!")
            assert await asyncio.wait_for(reader.readexactly(1), 20.0) == b"!"
            assert not port.room._guests, "its place is at the server now"
            writer.close()
            later, writer = await asyncio.open_connection(port.host, port.port)
            writer.write(b"x")
            assert await asyncio.wait_for(later.readexactly(1), 20.0) == b"X"
            writer.close()

    asyncio.run(program())


def test_who_sends_nothing_has_to_go_and_so_does_who_goes_by_himself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(port_module, "SILENT", 0.05)

    async def program() -> None:
        async with opened() as port:
            reader, writer = await asyncio.open_connection(port.host, port.port)
            with contextlib.suppress(ConnectionError):
                assert await asyncio.wait_for(reader.read(1), 20.0) == b""
            writer.close()
            _, writer = await asyncio.open_connection(port.host, port.port)
            writer.write(b"get")
            await asyncio.wait_for(port.web.wanted.wait(), 20.0)
            writer.transport.abort()
            while port.web._waiting or port.room._guests:
                await asyncio.sleep(0.005)

    asyncio.run(program())


@pytest.mark.parametrize("why", ["no server", "too much"])
def test_who_cannot_be_served_is_told(why: str) -> None:
    async def program() -> bytes:
        async with opened() as port:
            reader, writer = await asyncio.open_connection(port.host, port.port)
            writer.write(b"get")
            await asyncio.wait_for(port.web.wanted.wait(), 20.0)
            if why == "no server":
                port.web.close()
            else:
                writer.write(bytes(2 * waiting.MAX_BYTES))
            told = await asyncio.wait_for(reader.read(12), 20.0)
            writer.close()
            return told

    assert asyncio.run(program()) == (b"HTTP/1.1 404" if why == "no server" else b"HTTP/1.1 503")


def test_the_next_free_port_is_taken_and_none_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    async def program() -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            number = taken.getsockname()[1]
            async with opened(number) as port:
                assert number < port.port <= number + port_module.OTHERS
                assert port.where == f"http://127.0.0.1:{port.port}/"
            monkeypatch.setattr(port_module, "OTHERS", 0)
            with pytest.raises(OSError, match="in use"):
                await ConsolePort(Web()).open("127.0.0.1", number)

    asyncio.run(program())
