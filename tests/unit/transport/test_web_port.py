"""The port of a web server that is not loaded yet: whom it lets wait, for how long, and how many."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from gateway.core.errors import UserError
from gateway.transport import web_port
from gateway.transport.listening import split_address
from gateway.transport.web_port import WebPort

PATIENCE = 60.0


class Server:
    """Stands for the web server, which takes a while to load, and sends back what it gets."""

    def __init__(self) -> None:
        self.wanted, self.loaded, self.closed = asyncio.Event(), asyncio.Event(), False
        self.connections = set[asyncio.Protocol]()

    async def load(self) -> Server:
        self.wanted.set()
        await self.loaded.wait()
        return self

    def __call__(self) -> asyncio.Protocol:
        return Echo(self)

    async def close(self) -> None:
        self.closed = True


class Echo(asyncio.Protocol):
    def __init__(self, server: Server) -> None:
        self.server = server

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.server.connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self.server.connections.discard(self)

    def data_received(self, data: bytes) -> None:
        self.transport.write(data.upper())


class Opened:
    def __init__(self, port: WebPort, server: Server) -> None:
        self.port, self.server = port, server
        self.callers: list[asyncio.StreamWriter] = []

    async def call(self, sent: bytes = b"") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection(*split_address(self.port.where))
        self.callers.append(writer)
        if sent:
            writer.write(sent)
            await asyncio.wait_for(self.server.wanted.wait(), PATIENCE)
        return reader, writer


@asynccontextmanager
async def opened(number: int = 0, others: int = 0) -> AsyncIterator[Opened]:
    server = Server()
    port = WebPort(server.load)
    await port.open(f"tcp://127.0.0.1:{number}", others)
    there = Opened(port, server)
    try:
        yield there
    finally:
        await port.close()
        for writer in there.callers:
            writer.transport.abort()
        async with asyncio.timeout(PATIENCE):
            while port.room._guests or server.connections:
                await asyncio.sleep(0.005)


async def heard(reader: asyncio.StreamReader, count: int) -> bytes:
    return await asyncio.wait_for(reader.readexactly(count), PATIENCE)


def test_the_first_byte_wants_the_server_and_nothing_is_lost_until_it_is_there() -> None:
    async def program() -> None:
        async with opened() as there:
            reader, writer = await there.call()
            await asyncio.sleep(0.05)
            assert not there.server.wanted.is_set(), "somebody who only connects loads nothing"
            writer.write(b"get /")
            await asyncio.wait_for(there.server.wanted.wait(), PATIENCE)
            writer.write(b" now")
            assert len(there.port.room._guests) == 1
            await asyncio.sleep(0.05)
            there.server.loaded.set()
            assert await heard(reader, 9) == b"GET / NOW"
            assert not there.port.room._guests, "its place is at the server now"
            later, writer = await there.call(b"x")
            assert await heard(later, 1) == b"X"
            assert not there.server.closed
        assert there.server.closed

    asyncio.run(program())


def test_who_sends_nothing_has_to_go_and_so_does_who_goes_by_himself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web_port, "SILENT", 0.05)

    async def program() -> None:
        async with opened() as there:
            reader, writer = await there.call()
            with contextlib.suppress(ConnectionError):
                assert await asyncio.wait_for(reader.read(1), PATIENCE) == b""
            _, writer = await there.call(b"get")
            writer.transport.abort()
            there.server.loaded.set()
            while there.port.room._guests:
                await asyncio.sleep(0.005)

    asyncio.run(program())


@pytest.mark.parametrize(
    ("why", "told"), [("ends", b"404"), ("none", b"404"), ("too much", b"503"), ("too late", b"503")]
)
def test_who_cannot_be_served_is_told(why: str, told: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    async def program() -> bytes:
        async with opened() as there:
            if why == "none":
                there.port._load = web_port.no_server
                there.server.wanted.set()
            if why == "too late":
                monkeypatch.setattr(web_port, "TIMEOUT", 0.05)
            reader, writer = await there.call(b"get")
            if why == "ends":
                await there.port.close()
            elif why == "too much":
                writer.write(bytes(2 * web_port.MAX_BYTES))
            return await heard(reader, 12)

    assert asyncio.run(program()) == b"HTTP/1.1 " + told


def test_no_more_may_wait_than_there_are_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web_port, "MOST", 4)

    async def program() -> None:
        async with opened() as there:
            for _ in range(9):
                await there.call(b"get")
            while len(there.port.room._guests) != 2:  # the last places are for another address
                await asyncio.sleep(0.005)

    asyncio.run(program())


def test_the_next_free_port_is_taken_and_none_is_an_error() -> None:
    async def program() -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            number = taken.getsockname()[1]
            async with opened(number, others=50) as there:
                assert number < split_address(there.port.where)[1] <= number + 50
            with pytest.raises(UserError, match="in use"):
                await WebPort().open(f"tcp://127.0.0.1:{number}")

    asyncio.run(program())
