"""A mount over HTTP: lines become requests, only the newest answer counts, a read is repeated and an order never is."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from typing import Any

import pytest

from gateway.app.watchdog.process import ServedMount
from gateway.protocols.alpaca.driver.telescope_http import TelescopeHttp
from gateway.protocols.alpaca.http import chain
from gateway.transport.http_wire import HttpWire, request_bytes

pytestmark = pytest.mark.real_time
PATIENCE = 20.0
Answer = Callable[[bytes, asyncio.StreamWriter], Awaitable[None]]


class Watcher:
    def __init__(self) -> None:
        self.told: list[tuple[str, int, bool]] = []

    def reached(self, host: str, port: int, beside: bool) -> None:
        self.told.append((host, port, beside))

    def closed(self) -> None:
        pass


async def value(writer: asyncio.StreamWriter, value: str, status: str = "200 OK", close: bool = False) -> None:
    body = (
        value.encode() if status != "200 OK" else b'{"Value": %s, "ErrorNumber": 0,"ErrorMessage":""}' % value.encode()
    )
    writer.write(b"HTTP/1.1 %s\r\nContent-Length: %d\r\n\r\n%s" % (status.encode(), len(body), body))
    if close:
        writer.close()


@asynccontextmanager
async def server(answer: Answer) -> AsyncIterator[tuple[HttpWire, asyncio.Queue[bytes], list[str], list[bytes]]]:
    """A server, and the open wire to it: its lines, the reasons for which it was lost, and the requests."""
    asked: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                length = next((int(row[15:]) for row in head.split(b"\r\n") if row.startswith(b"Content-Length:")), 0)
                request = head.split(b" HTTP")[0] + b" " + await reader.readexactly(length)
                if b"/management/" in request:
                    await value(writer, "no such page", "404 Not Found")
                    continue
                if b"/connected" in request:
                    await value(writer, "true")
                    continue
                asked.append(request)
                await answer(request, writer)
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    listening = await asyncio.start_server(serve, "127.0.0.1", 0)
    url = f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}/3"
    wire, lines, lost = HttpWire(url, TelescopeHttp(url)), asyncio.Queue[bytes](), list[str]()
    await wire.open(lines.put_nowait, lost.append)
    try:
        async with asyncio.timeout(PATIENCE):
            yield wire, lines, lost, asked
    finally:
        await wire.close()
        listening.close()


async def test_alpaca_driver_line_becomes_an_http_request_with_its_reply() -> None:
    async def answer(request: bytes, writer: asyncio.StreamWriter) -> None:
        await value(writer, "12.5" if request.startswith(b"GET") else "null")

    async with server(answer) as (wire, lines, _, asked):
        wire.write(b"get canmoveaxis Axis=1\n")
        assert await lines.get() == b"12.5\n"
        wire.write(b"put tracking Tracking=true\n")
        assert await lines.get() == b"null\n"
        assert asked[0].startswith(b"GET /api/v1/telescope/3/canmoveaxis?Axis=1&ClientID=")
        assert asked[1].startswith(b"PUT /api/v1/telescope/3/tracking Tracking=True&ClientID=")
        assert asked[0].endswith(b"&ClientTransactionID=2 ") and asked[1].endswith(b"&ClientTransactionID=3")


@pytest.mark.parametrize("newer", [b"put tracking Tracking=true\n", b"put moveaxis Axis=0 Rate=1.5\n"])
async def test_http_stop_is_sent_again_after_the_answer_to_an_overtaken_order(newer: bytes) -> None:
    """Unless a newer motion has begun, which it would end."""
    release = asyncio.Event()

    async def answer(request: bytes, writer: asyncio.StreamWriter) -> None:
        if b"/slewto" in request:
            await release.wait()
        await value(writer, "null")

    async with server(answer) as (wire, lines, lost, asked):
        wire.write(b"put slewtocoordinatesasync RightAscension=1 Declination=1\n")
        while not asked:
            await asyncio.sleep(0.01)
        for order in (b"put abortslew\n", b"put moveaxis Axis=0 Rate=0.0\n", newer):
            wire.write(order)
            await lines.get()
        release.set()
        await asyncio.sleep(0.1)
        again = [request.split(b"/")[-1] for request in asked[4:]]
        assert len(again) == (0 if b"moveaxis" in newer else 2)
        assert all(request.startswith((b"abortslew", b"moveaxis Axis=0&Rate=0.0")) for request in again)
        assert lines.empty() and not lost


async def test_http_stop_on_a_closed_connection_is_repeated() -> None:
    closing = False

    async def answer(request: bytes, writer: asyncio.StreamWriter) -> None:
        nonlocal closing
        closing = not closing
        if closing:
            writer.transport.abort()
        else:
            await value(writer, "null")

    async with server(answer) as (wire, lines, lost, asked):
        wire.write(b"put moveaxis Axis=1 Rate=0.0\n")
        assert await lines.get() == b"null\n" and len(asked) == 2 and not lost


class OneAtATime(BaseHTTPRequestHandler):
    """Python's own server: it keeps a connection until the client closes it, and serves no other meanwhile."""

    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        told = b'{"Value": true, "ErrorNumber": 0}'
        self.send_response(200)
        self.send_header("Content-Length", str(len(told)))
        self.end_headers()
        self.wfile.write(told)
        self.server.asked.append(self.path.rpartition("/")[2])  # type: ignore[attr-defined]

    def do_PUT(self) -> None:
        self.do_GET()

    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.parametrize("kind", [HTTPServer, ThreadingHTTPServer])
def test_idle_connection_does_not_block_a_server_that_serves_one_at_a_time(kind: type[HTTPServer]) -> None:
    alone = kind is HTTPServer

    async def program(url: str, asked: list[str]) -> None:
        watcher, lines = Watcher(), asyncio.Queue[bytes]()
        wire = HttpWire(url, TelescopeHttp(url), watcher)
        await wire.open(lines.put_nowait, lambda reason: None)
        host, port, beside = watcher.told[0]
        assert beside is not alone
        mount = ServedMount("pier", "", host, str(port), "alone" if alone else "beside")
        mount.stop_commands = [
            request_bytes(url, TelescopeHttp(url).request(order)) for order in (b"put abortslew", b"put park")
        ]
        mount.prepare_stop()
        assert len(mount.next_connections) == (0 if alone else 1)
        for _ in range(2):
            wire.write(b"get altitude\n")
            assert await lines.get() == b"true\n"
        for command in mount.stop_commands:
            await asyncio.to_thread(mount.send, command)
        while sorted(asked[-2:]) != ["abortslew", "park"]:  # each on a connection, and in a thread, of its own
            await asyncio.sleep(0.01)
        wire.write(b"get azimuth\n")
        assert await lines.get() == b"true\n"
        mount.close()
        await wire.close()

    with kind(("127.0.0.1", 0), OneAtATime) as serving:
        serving.asked = asked = []  # type: ignore[attr-defined]
        thread = threading.Thread(target=serving.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        asyncio.run(asyncio.wait_for(program(f"http://127.0.0.1:{serving.server_port}", asked), PATIENCE))
        serving.shutdown()
        thread.join(PATIENCE)


async def test_unreachable_alpaca_server_is_reported_with_the_reason() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        url = f"http://127.0.0.1:{taken.getsockname()[1]}"
    wire = HttpWire(url, TelescopeHttp(url))
    with pytest.raises(OSError, match="no program listens there"):
        await wire.open(lambda data: None, lambda reason: None)
    with pytest.raises(OSError, match="closed"):
        wire.write(b"get altitude\n")


@pytest.mark.parametrize(
    ("status", "body", "line"),
    [
        (404, b"no  such\nmember", b'{"ErrorNumber":1024,"ErrorMessage":"HTTP 404: no such member"}\n'),
        (422, b"Axis", b'{"ErrorNumber":1024,"ErrorMessage":"HTTP 422: Axis"}\n'),
        (500, b"", b'{"ErrorNumber":1280,"ErrorMessage":"HTTP 500: "}\n'),
        (200, b"<html>", b'{"ErrorNumber":1280,"ErrorMessage":"The reply is not a JSON object of Alpaca."}\n'),
        (200, b"[1]", b'{"ErrorNumber":1280,"ErrorMessage":"The reply is not a JSON object of Alpaca."}\n'),
        (200, b'{"ErrorNumber": 1032,"ErrorMessage":"Parked"}', b'{"ErrorNumber":1032,"ErrorMessage":"Parked"}\n'),
        (200, b'{"ErrorNumber": -2147220472}', b'{"ErrorNumber":1032,"ErrorMessage":""}\n'),
        (200, b'{"Value": [0, 1]}', b"[0,1]\n"),
        (200, b'{"ErrorNumber": null}', b"null\n"),
    ],
)
def test_line_breaks_in_an_http_answer_do_not_split_the_line(status: int, body: bytes, line: bytes) -> None:
    assert TelescopeHttp("http://127.0.0.1:1").reply(status, body) == line


def test_gateway_refuses_itself_as_an_alpaca_server() -> None:
    told = json.dumps({"Value": {"ServerName": "mount-gateway", "Gateways": [chain.own_token(os.getpid())]}})
    telescope = TelescopeHttp("http://127.0.0.1:1/7")
    telescope.check_first_answer(telescope.first_requests[0], 404, b"")
    with pytest.raises(OSError, match="this very gateway"):
        telescope.check_first_answer(telescope.first_requests[0], 200, told.encode())


def test_alpaca_server_without_the_configured_telescope_is_not_opened() -> None:
    telescope = TelescopeHttp("http://127.0.0.1:1/7")
    for status, body in ((404, b"no"), (200, b"<html>")):
        with pytest.raises(OSError, match=r"no telescope 7 \(HTTP status"):
            telescope.check_first_answer(telescope.first_requests[1], status, body)
    telescope.check_first_answer(telescope.first_requests[1], 200, b'{"Value": true}')


async def test_http_read_survives_closed_connections_and_an_order_is_sent_once() -> None:
    closing = 0

    async def answer(request: bytes, writer: asyncio.StreamWriter) -> None:
        nonlocal closing
        closing -= 1
        if closing >= 0:
            writer.transport.abort()
        else:
            await value(writer, "1")

    async with server(answer) as (wire, lines, lost, asked):
        closing = 3
        wire.write(b"get altitude\n")
        assert await lines.get() == b"1\n" and len(asked) == 4 and not lost
        closing = 1
        wire.write(b"put pulseguide Direction=0 Duration=100\n")
        while not lost:
            await asyncio.sleep(0.01)
        assert len(asked) == 5


async def test_watchdog_gets_the_address_at_which_the_server_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    watcher = Watcher()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                await reader.readuntil(b"\r\n\r\n")
                await value(writer, "true")
        writer.close()

    async def both(*_: Any, **__: Any) -> list[Any]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (host, port)) for host in ("127.0.0.2", "127.0.0.1")]

    listening = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = listening.sockets[0].getsockname()[1]
    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", both)
    url = f"http://localhost:{port}"
    wire = HttpWire(url, TelescopeHttp(url), watcher)
    await wire.open(lambda data: None, lambda reason: None)
    await wire.close()
    listening.close()
    assert watcher.told == [("127.0.0.1", port, True)]
