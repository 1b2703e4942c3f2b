"""The web server under attack: what is half sent or idle ends, who finds no place is told so, a stop gets in."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from aiohttp import web

from gateway.core.errors import UserError
from gateway.transport.listening import split_address
from gateway.transport.room import RESERVED_PLACES, ConnectionQuota, host_capacity
from gateway.transport.web_server import IDLE_TIMEOUT, MAX_CONNECTIONS, MAX_EARLY_BYTES, REQUEST_TIMEOUT, WebServer
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

GET = b"GET / HTTP/1.1\r\nHost: here\r\n\r\n"
HALF = b"GET / HTTP/1.1\r\nHost: here\r\nX-a:"
POST = b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: 99\r\n\r\n"


class Line(asyncio.Transport):
    """A connection to the server from this host, with nothing behind it but a test, which has ``sent`` this already."""

    def __init__(self, server: WebServer, host: str = "127.0.0.1", sent: bytes = b"") -> None:
        super().__init__({"peername": (host, 1), "sockname": ("127.0.0.1", 80)})
        self.heard, self.closed_after = b"", -1.0
        self._loop = asyncio.get_running_loop()
        self._began = self._loop.time()
        server.take_over(self, sent)

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        assert isinstance(protocol, asyncio.Protocol)
        self._protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol:
        return self._protocol

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.heard += data

    def is_closing(self) -> bool:
        return self.closed_after >= 0.0

    def close(self) -> None:
        if not self.is_closing():
            self.closed_after = self._loop.time() - self._began
            self._loop.call_soon(self._protocol.connection_lost, None)

    abort = close

    def pause_reading(self) -> None: ...
    def resume_reading(self) -> None: ...

    def says(self, data: bytes) -> None:
        if not self.is_closing():
            self._protocol.data_received(data)

    async def trickles(self, data: bytes) -> None:
        """Send a byte every two seconds."""
        for number in range(len(data)):
            self.says(data[number : number + 1])
            await asyncio.sleep(2.0)


class Site:
    """What the server serves: it answers after as many seconds as the body says. Loading it waits for ``loaded``."""

    def __init__(self) -> None:
        self.wanted, self.loaded = False, asyncio.Event()

    async def load(self) -> web.Application:
        self.wanted = True
        await self.loaded.wait()
        app = web.Application()
        app.add_routes([web.route("*", "/", self.answer)])
        return app

    async def answer(self, request: web.Request) -> web.Response:
        await asyncio.sleep(float(await request.text() or 0))
        return web.Response(text="done")


@asynccontextmanager
async def serving() -> AsyncIterator[WebServer]:
    site = Site()
    site.loaded.set()
    server = WebServer(site.load)
    try:
        yield server
    finally:
        await server.close()


@each("sent", [b"", b"G", HALF, GET[:-1], POST, POST + b"1"])
async def test_incomplete_http_request_ends_its_connection(sent: bytes) -> None:
    async with serving() as server:
        line = Line(server, sent=sent)
        await asyncio.sleep(REQUEST_TIMEOUT - 1.0)
        assert not line.is_closing()
        await asyncio.sleep(2.0)
        assert line.closed_after == REQUEST_TIMEOUT and line.heard == b""


@each("sent", [GET, POST + b"9" * 99])
async def test_http_request_sent_byte_by_byte_is_closed_after_the_timeout(sent: bytes) -> None:
    async with serving() as server:
        line = Line(server)
        await line.trickles(sent)
        assert line.closed_after == REQUEST_TIMEOUT and line.heard == b""


async def test_http_client_is_closed_when_idle_but_not_while_awaiting_a_reply() -> None:
    async with serving() as server:
        line = Line(server)
        for number in range(1, 4):
            line.says(POST.replace(b"99", b"3"))
            await asyncio.sleep(REQUEST_TIMEOUT - 1.0)
            line.says(b"120")
            await asyncio.sleep(125.0)
            assert line.heard.count(b"done") == number and not line.is_closing()
            await asyncio.sleep(IDLE_TIMEOUT - 10.0)
        line.close()
        half = Line(server, sent=GET)
        await asyncio.sleep(1.0)
        half.says(HALF)
        await asyncio.sleep(REQUEST_TIMEOUT - 1.0)
        assert not half.is_closing()
        await asyncio.sleep(2.0)
        assert half.is_closing()
        idle = Line(server, sent=GET)
        await asyncio.sleep(IDLE_TIMEOUT - 1.0)
        assert b"done" in idle.heard and not idle.is_closing()
        await asyncio.sleep(2.0)
        assert idle.is_closing()


async def test_http_client_that_leaves_early_is_not_reported(caplog: pytest.LogCaptureFixture) -> None:
    async with serving() as server:
        Line(server, sent=GET)
        await asyncio.sleep(1.0)
        line = Line(server, sent=POST + b"1")
        await asyncio.sleep(1.0)
        line.close()
        await asyncio.sleep(1.0)
    assert not caplog.records


# --- places -----------------------------------------------------------------------------------------------------------


@each(
    ("host", "most", "places"),
    [
        ("10.0.0.1", 64, 48),
        ("10.0.0.1", 400, 300),
        ("10.0.0.1", 2, 2),
        ("10.0.0.1", 1, 1),
        ("::ffff:10.0.0.1", 8, 6),
        ("fe80::1%eth0", 8, 6),
        ("127.0.0.1", 8, 8),
        ("::1", 8, 8),
        ("::ffff:127.0.0.2", 8, 8),
        ("/dev/ttyUSB0", 8, 8),
    ],
)
def test_one_address_gets_three_quarters_of_the_http_connections_and_this_computer_all(
    host: str, most: int, places: int
) -> None:
    assert host_capacity(host, most) == places


def test_two_http_connections_are_reserved_for_new_addresses() -> None:
    room = ConnectionQuota(8)
    assert [room.acquire("10.0.0.1") for _ in range(7)] == [True] * 6 + [False]
    assert room.acquire("10.0.0.2") and not room.acquire("10.0.0.2")
    assert room.acquire("10.0.0.3") and not room.acquire("10.0.0.4"), "all are taken"
    room.release("10.0.0.1")
    assert not room.acquire("10.0.0.1"), "the last ones are not for it"
    assert room.acquire("10.0.0.4")


@each("sent", [b"", HALF, GET])
@each("hosts", [1, 2, 7])
async def test_http_attack_from_some_addresses_does_not_block_a_stop(sent: bytes, hosts: int) -> None:
    """Half-sent, silent and whole ones, again and again; LX200 programs and a page at another address are answered."""
    async with serving() as server, Bridge() as bridge:
        program, loop = bridge.client(), asyncio.get_running_loop()
        Line(server, sent=GET).close()
        await asyncio.sleep(1.0)
        lines = list[Line]()
        for _ in range(4):
            lines += [Line(server, f"10.0.0.{number % hosts}", sent) for number in range(2 * MAX_CONNECTIONS)]
            await asyncio.sleep(0.5)
            there = [line for line in lines if not line.is_closing()]
            assert len(there) == (
                host_capacity("10.0.0.1", MAX_CONNECTIONS) if hosts == 1 else MAX_CONNECTIONS - RESERVED_PLACES
            )
            assert all(b"503" in line.heard for line in lines if line.closed_after == 0.0)
            began = loop.time()
            assert len(await program.ask(b":GR#")) == 9
            assert loop.time() - began < 0.5
            stop = Line(server, "10.0.9.9", GET)
            await asyncio.sleep(0.1)
            assert b"done" in stop.heard
            stop.close()
            await asyncio.sleep(0.4)
        await asyncio.sleep(IDLE_TIMEOUT if sent == GET else REQUEST_TIMEOUT)
        assert all(line.is_closing() for line in lines)
        assert b"done" in (await _answered(server, "10.0.0.1"))


async def _answered(server: WebServer, host: str) -> bytes:
    line = Line(server, host, GET)
    await asyncio.sleep(1.0)
    return line.heard


# --- before it is loaded ----------------------------------------------------------------------------------------------


async def test_first_http_byte_loads_the_application_and_is_not_lost() -> None:
    site = Site()
    server = WebServer(site.load)
    line = Line(server)
    await asyncio.sleep(1.0)
    assert not site.wanted, "somebody who only connects loads nothing"
    line.says(GET[:9])
    await asyncio.sleep(1.0)
    assert site.wanted
    line.says(GET[9:])
    site.loaded.set()
    await asyncio.sleep(1.0)
    assert line.heard.endswith(b"done")
    await server.close()
    assert line.is_closing()


@each(("why", "told"), [("none", b"404"), ("ends", b"404"), ("too much", b"503"), ("too late", b"503")])
async def test_http_client_that_cannot_be_served_gets_404_or_503(why: str, told: bytes) -> None:
    server = WebServer(None if why == "none" else Site().load)
    line = Line(server, sent=GET)
    if why == "too much":
        line.says(bytes(MAX_EARLY_BYTES))
    elif why == "ends":
        await server.close()
    await asyncio.sleep(1.0 if why != "too late" else REQUEST_TIMEOUT)
    assert line.heard.startswith(b"HTTP/1.1 " + told) and line.is_closing()
    await server.close()


@pytest.mark.real_time
async def test_web_server_takes_the_next_free_port_and_reports_none_as_an_error() -> None:
    server = WebServer()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"tcp://127.0.0.1:{(number := taken.getsockname()[1])}"
        port = await server.listen(where, max_tries=50)
        assert number < split_address(port.address)[1] <= number + 50
        with pytest.raises(UserError, match="in use"):
            await server.listen(where)
    await server.close()
