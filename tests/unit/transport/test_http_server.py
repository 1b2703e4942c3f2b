"""What is half sent to a web server ends in time, and a thousand of it leave the other ports alone."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from aiohttp import web

from gateway.diagnostics.virtual_time import run
from gateway.transport.http_server import MOST, WHOLE, HttpServer
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

GET = b"GET / HTTP/1.1\r\nHost: here\r\n\r\n"
HALF = b"GET / HTTP/1.1\r\nHost: here\r\nX-a:"
POST = b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: 99\r\n\r\n"


class Line(asyncio.Transport):
    """A connection to the server from this host, with nothing behind it but a test, which has ``sent`` this already."""

    def __init__(self, server: HttpServer, host: str = "127.0.0.1", sent: bytes = b"") -> None:
        super().__init__({"peername": (host, 1), "sockname": ("127.0.0.1", 80)})
        self.heard, self.closed_after = b"", -1.0
        self._loop = asyncio.get_running_loop()
        self._began = self._loop.time()
        self.set_protocol(protocol := server())
        protocol.connection_made(self)
        if sent:
            protocol.data_received(sent)

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


async def answer(request: web.Request) -> web.Response:
    """Read the whole body, and take as long as it says; without reading if the query says so."""
    await asyncio.sleep(0.0 if request.query_string else float(await request.text() or 0))
    return web.Response(text="done")


def serve(test: Callable[[HttpServer], Awaitable[None]]) -> None:
    async def program() -> None:
        app = web.Application()
        app.add_routes([web.route("*", "/", answer)])
        server = await HttpServer.start(app)
        try:
            await test(server)
        finally:
            await server.close()

    run(program())


@each("sent", [b"", b"G", HALF, GET[:-1], POST, POST + b"1", GET + HALF[:0]])
def test_a_request_that_is_not_whole_ends_its_connection(sent: bytes) -> None:
    async def test(server: HttpServer) -> None:
        line = Line(server, sent=sent)
        await asyncio.sleep(WHOLE - 1.0)
        assert not line.is_closing()
        await asyncio.sleep(60.0)
        assert line.is_closing() is (sent != GET)
        assert line.closed_after in (WHOLE, -1.0)
        line.close()

    serve(test)


@each("sent", [GET, POST + b"9" * 99])
def test_it_does_not_help_to_send_it_byte_by_byte(sent: bytes) -> None:
    async def test(server: HttpServer) -> None:
        line = Line(server)
        await line.trickles(sent)
        assert line.closed_after == WHOLE and line.heard == b""

    serve(test)


def test_who_is_answered_slowly_or_waits_between_two_requests_stays() -> None:
    async def test(server: HttpServer) -> None:
        line = Line(server)
        for number in range(1, 4):
            await asyncio.sleep(0.0 if number == 1 else 3.0 * WHOLE)
            line.says(POST.replace(b"99", b"2"))
            await asyncio.sleep(WHOLE - 1.0)
            line.says(b"30")
            await asyncio.sleep(40.0)
            assert line.heard.count(b"done") == number and not line.is_closing()
        line.says(HALF)
        await asyncio.sleep(WHOLE + 1.0)
        assert line.is_closing()

    serve(test)


def test_a_body_may_come_after_the_answer() -> None:
    async def test(server: HttpServer) -> None:
        line = Line(server)
        line.says(POST.replace(b"/ ", b"/?early "))
        await asyncio.sleep(3.0)
        assert b"done" in line.heard
        line.says(b"9" * 99)
        await asyncio.sleep(3.0 * WHOLE)
        assert not line.is_closing()
        line.says(HALF)
        await asyncio.sleep(WHOLE + 1.0)
        assert line.is_closing()

    serve(test)


def test_a_client_that_leaves_in_the_middle_is_no_failure_to_tell(caplog: pytest.LogCaptureFixture) -> None:
    async def test(server: HttpServer) -> None:
        line = Line(server)
        line.says(POST + b"1")
        await asyncio.sleep(WHOLE + 1.0)
        assert line.is_closing()

    serve(test)
    assert not caplog.records


def test_a_thousand_half_requests_end_and_programs_are_answered_meanwhile() -> None:
    async def test(server: HttpServer) -> None:
        async with Bridge() as bridge:
            program, loop = bridge.client(), asyncio.get_running_loop()
            lines = [Line(server, f"10.0.0.{number % 2}") for number in range(1000)]
            for line in lines:
                line.says(HALF)
            assert 0 < sum(not line.is_closing() for line in lines) <= MOST
            for _ in range(6):
                began = loop.time()
                assert len(await program.ask(b":GR#")) == 9
                assert loop.time() - began < 0.5
                stop = Line(server, "10.0.0.9")
                stop.says(GET)
                await asyncio.sleep(0.1)
                assert b"done" in stop.heard
                stop.close()
                for line in lines:
                    line.says(b"x")
                await asyncio.sleep(0.9)
            await asyncio.sleep(WHOLE)
            assert all(line.is_closing() for line in lines)

    serve(test)
