"""Alpaca over HTTP, with a mount that is made up: who may ask, what is answered, and how requests are told apart."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import pytest

from gateway.app.pages import make_app
from gateway.core.wire_log import WireLog
from gateway.protocols.alpaca.http import programs
from gateway.protocols.alpaca.http.discovery import AlpacaWeb
from gateway.transport.handler import ConnectionRefused, NewConnection, Write
from gateway.transport.web_server import WebDevice, WebServer
from tests.support.each import each

pytestmark = pytest.mark.real_time
PATIENCE = 60.0
API = "/api/v1/telescope/0/"


class Guest:
    """One program as the mount's side has it: what it said, and how it is answered."""

    def __init__(self, mount: Mount, name: str, write: Write) -> None:
        self.mount, self.name, self.write, self.closed = mount, name, write, False
        self.ended, self.all_answered = False, True

    def feed(self, data: bytes) -> None:
        self.mount.said.append((self.name, data))
        answer = self.mount.answers.get(data, b"null\n")
        if answer is not None:
            self.write(answer)

    def close(self) -> None:
        self.closed = True

    gone = close


class Mount:
    """Answers by lines; None: never."""

    def __init__(self) -> None:
        self.said: list[tuple[str, bytes]] = []
        self.answers: dict[bytes, bytes | None] = {b"get slewing\n": b"false\n"}
        self.guests: list[Guest] = []
        self.refuses = False
        self.log = WireLog(lambda: 0.0)

    def accept(self, connected: NewConnection) -> Guest:
        if self.refuses:
            raise ConnectionRefused
        self.guests.append(Guest(self, connected.name, connected.write))
        return self.guests[-1]


class Served:
    """A port in front of it, and somebody who asks."""

    def __init__(self, mount: Mount, url: str, http: aiohttp.ClientSession) -> None:
        self.mount, self.url, self.http = mount, url, http

    async def ask(self, method: str, path: str, **more: Any) -> tuple[int, Any]:
        async with self.http.request(method, self.url + path, **more) as response:
            text = await response.text()
            return response.status, await response.json() if response.content_type == "application/json" else text


@contextlib.asynccontextmanager
async def served(names: tuple[str, ...] = ()) -> AsyncIterator[Served]:
    mount = Mount()
    device = WebDevice(mount.accept, "a mount", mount.log)

    async def load() -> Any:
        alpaca, app = AlpacaWeb(), make_app(names, [mount.log])
        alpaca.add_routes(app, [device])
        return app

    server = WebServer(load)
    port = await server.listen("tcp://127.0.0.1:0")
    try:
        async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=PATIENCE)) as http:
            yield Served(mount, port.address.replace("tcp", "http"), http)
    finally:
        await server.close()
    assert all(guest.closed for guest in mount.guests)


async def test_alpaca_reply_holds_the_value_and_the_transaction_numbers() -> None:
    async with served() as own:
        own.mount.answers[b"get altitude\n"] = b"45.5\n"
        first = await own.ask("GET", API + "altitude?ClientID=7&ClientTransactionID=31")
        second = await own.ask("GET", API + "altitude")
        assert first[0] == second[0] == 200
        numbers = [answer.pop("ServerTransactionID") for _, answer in (first, second)]
        assert numbers[1] == numbers[0] + 1
        assert first[1] == {"Value": 45.5, "ClientTransactionID": 31, "ErrorNumber": 0, "ErrorMessage": ""}
        assert second[1]["ClientTransactionID"] == 0
        assert [name for name, _ in own.mount.said] == ["127.0.0.1:id-7", "127.0.0.1:id-0"]


async def test_alpaca_put_reads_its_parameters_from_the_body() -> None:
    async with served() as own:
        place = {"RightAscension": "5.5", "Declination": "-3", "ClientID": "7", "ClientTransactionID": "2"}
        status, answer = await own.ask("PUT", API + "slewtocoordinatesasync", data=place)
        assert status == 200 and "Value" not in answer and answer["ErrorNumber"] == 0
        assert answer["ClientTransactionID"] == 2
        assert own.mount.said[-1][1] == b"put slewtocoordinatesasync RightAscension=5.5 Declination=-3\n"
        status, _ = await own.ask("PUT", API + "slewtocoordinatesasync?RightAscension=5.5&Declination=-3")
        assert status == 400


async def test_alpaca_refusal_holds_its_error_number() -> None:
    async with served() as own:
        own.mount.answers[b"put park\n"] = b'{"ErrorNumber": 1024, "ErrorMessage": "no"}\n'
        status, answer = await own.ask("PUT", API + "park")
        assert status == 200 and (answer["ErrorNumber"], answer["ErrorMessage"]) == (1024, "no")
        assert "Value" not in answer


@each(
    ("method", "path", "status"),
    [
        ("GET", "/api/v1/telescope/1/altitude", 400),
        ("GET", "/api/v1/telescope/-1/altitude", 400),
        ("GET", "/api/v1/telescope/x/altitude", 400),
        ("GET", "/api/v1/telescope/٠/altitude", 400),
        ("GET", "/api/v1/camera/0/altitude", 400),
        ("GET", "/api/v1/Telescope/0/altitude", 400),
        ("GET", "/api/v1/telescope/0/Altitude", 400),
        ("GET", "/api/v1/telescope/0/nothing", 400),
        ("GET", "/api/v2/telescope/0/altitude", 400),
        ("GET", "/api/v1/telescope/0/altitude?ClientID=x", 400),
        ("GET", "/management/v1/nothing", 400),
        ("GET", "/management/apiversions?ClientTransactionID=-1", 400),
        ("PUT", "/api/v1/telescope/0/altitude", 405),
        ("POST", "/api/v1/telescope/0/altitude", 405),
        ("DELETE", "/api/v1/telescope/0/tracking", 405),
        ("GET", "/elsewhere", 404),
    ],
)
async def test_malformed_alpaca_request_reaches_no_mount(method: str, path: str, status: int) -> None:
    async with served() as own:
        assert (await own.ask(method, path))[0] == status
        assert own.mount.said == []


async def test_alpaca_body_sent_in_pieces_is_read_whole() -> None:
    """Half a number would be another number, and the mount would go elsewhere."""
    async with served() as own:

        async def pieces() -> AsyncIterator[bytes]:
            for piece in (b"TargetDec", b"lination=2", b"2.0145"):
                yield piece
                await asyncio.sleep(0.05)

        form = {"Content-Type": "application/x-www-form-urlencoded"}
        for more in ({}, {"Content-Length": "25"}):
            status, _ = await own.ask("PUT", API + "targetdeclination", data=pieces(), headers=form | more)
            assert status == 200
            assert own.mount.said[-1][1] == b"put targetdeclination TargetDeclination=22.0145\n"


async def test_alpaca_body_that_never_arrives_does_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.transport.web_server.REQUEST_TIMEOUT", 0.2)
    async with served() as own:

        async def pieces() -> AsyncIterator[bytes]:
            yield b"Axis=0&Rate=1"
            await asyncio.sleep(0.5)
            yield b".5"

        form = {"Content-Type": "application/x-www-form-urlencoded"}
        with pytest.raises(aiohttp.ClientError):
            await own.ask("PUT", API + "moveaxis", data=pieces(), headers=form)
        assert own.mount.said == []


#: What `curl -F` and the pages of Swagger send.
MULTIPART = (
    b'--xY7\r\nContent-Disposition: form-data; name="RightAscension"\r\n\r\n5.5\r\n'
    b'--xY7\r\nContent-Disposition: form-data; name="Declination"\r\nContent-Type: text/plain\r\n\r\n-3\r\n--xY7--\r\n'
)


@each("body", [
    MULTIPART, MULTIPART.replace(b"\r\n", b"\n"), b"RightAscension=5.5&Declination=-3",
    b"RightAscension=5.5&Declination=%2d3", b"RightAscension=+5.5&Declination=-3\r\n",
])  # fmt: skip
@each(
    "kind", ["multipart/form-data; boundary=xY7", "application/x-www-form-urlencoded", "application/json", "text/plain"]
)
async def test_alpaca_body_is_read_by_its_content_and_not_its_type(body: bytes, kind: str) -> None:
    async with served() as own:
        asked = await own.ask("PUT", API + "slewtocoordinatesasync", data=body, headers={"Content-Type": kind})
        assert asked[0] == 200
        assert own.mount.said[-1][1] == b"put slewtocoordinatesasync RightAscension=5.5 Declination=-3\n"


@each(
    ("body", "status"),
    [
        (b"\xff\xfe", 400),
        (b"Connected=%ff", 400),
        (b"&".join([b"a=1"] * 200), 400),
        (b'{"Connected": true}', 400),
        (MULTIPART[:-60], 400),
        (MULTIPART.removesuffix(b"\r\n--xY7--\r\n"), 400),  # the number may have been longer
        (MULTIPART.replace(b"-3", b"\xff"), 400),
        (b"--", 400),
        (b"x" * 9000, 413),
    ],
)
async def test_unreadable_alpaca_body_is_rejected(body: bytes, status: int) -> None:
    async with served() as own:
        form = {"Content-Type": "application/x-www-form-urlencoded"}
        for member in ("connected", "slewtocoordinatesasync"):
            assert (await own.ask("PUT", API + member, data=body, headers=form))[0] == status
        assert own.mount.said == []


@each(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "localhost:11111"}, 200),
        ({"Host": socket.gethostname()}, 200),
        ({"Host": "pier.example.org"}, 200),
        ({"Host": "203.0.113.7:8080"}, 200),
        ({"Host": "rebound.example.com"}, 403),
        ({"Host": "192.0.2.99"}, 403),
        ({"Host": ""}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "http://127.0.0.1"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-origin"}, 403),
        ({"Sec-Fetch-Site": "none"}, 200),
    ],
)
async def test_alpaca_server_refuses_foreign_origins_and_host_names(headers: dict[str, str], status: int) -> None:
    async with served(names=("pier.example.org", "203.0.113.7")) as own:
        for method, path in (("PUT", API + "abortslew"), ("GET", API + "name"), ("GET", "/management/apiversions"),
                             ("GET", "/setup")):  # fmt: skip
            async with own.http.request(method, own.url + path, headers=headers) as response:
                assert response.status == status, path
                assert not [name for name in response.headers if name.lower().startswith("access-control")]
        assert len(own.mount.said) == (2 if status == 200 else 0)
        by_name = status == 403 and "Host" in headers
        assert len(own.mount.log.recent_notices) == by_name and all(
            "not in names" in one.text for one in own.mount.log.recent_notices
        )


@each(("first", "status"), [("GET / HTTP/1.0", 404), ("GET /setup HTTP/1.0", 200), ("GET /setup HTTP/1.1", 400),
                            ("GET /setup HTTP/1.0\r\nHost: rebound.example.com", 403),
                            ("GET /setup HTTP/1.0\r\nOrigin: http://evil.example", 403)])  # fmt: skip
async def test_alpaca_request_without_a_host_is_answered_as_http_1_0(first: str, status: int) -> None:
    async with served() as own:
        reader, writer = await asyncio.open_connection(*own.url.removeprefix("http://").split(":"))
        writer.write(f"{first}\r\n\r\n".encode())
        async with asyncio.timeout(PATIENCE):
            assert str(status).encode() in await reader.readline()
        writer.close()


async def test_alpaca_cors_preflight_is_refused() -> None:
    async with served() as own:
        asks = {"Origin": "http://evil.example", "Access-Control-Request-Method": "PUT"}
        async with own.http.options(own.url + API + "park", headers=asks) as response:
            assert response.status == 403 and "Access-Control-Allow-Origin" not in response.headers
        assert own.mount.said == []


async def test_slow_alpaca_client_delays_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "REQUEST_TIMEOUT", 0.3)
    async with served() as own:
        own.mount.answers[b"get azimuth\n"] = None
        own.mount.answers[b"get altitude\n"] = b"45.5\n"
        slow = asyncio.create_task(own.ask("GET", API + "azimuth?ClientID=1"))
        while not own.mount.said:
            await asyncio.sleep(0.01)
        _, quick = await own.ask("GET", API + "altitude?ClientID=2")
        assert quick["Value"] == 45.5 and not slow.done()
        _, late = await slow
        assert late["ErrorNumber"] == 0x500 and "has not answered" in late["ErrorMessage"]
        assert own.mount.guests[0].closed, "an answer that still came would be taken for another's"
        _, again = await own.ask("GET", API + "altitude?ClientID=1")
        assert again["Value"] == 45.5


async def test_awaited_alpaca_goto_blocks_only_its_request() -> None:
    async with served() as own:
        own.mount.answers |= {b"get slewing\n": b"true\n", b"get altitude\n": b"45.5\n"}
        place = {"RightAscension": "5.5", "Declination": "-3", "ClientID": "1"}
        waited = asyncio.create_task(own.ask("PUT", API + "slewtocoordinates", data=place))
        while (len(own.mount.said)) < 3:
            await asyncio.sleep(0.01)
        _, other = await own.ask("GET", API + "altitude?ClientID=1")
        assert other["Value"] == 45.5 and not waited.done()
        own.mount.answers[b"get slewing\n"] = b"false\n"
        status, answer = await waited
        assert status == 200 and answer["ErrorNumber"] == 0


async def test_synchronous_alpaca_goto_that_ends_short_of_its_target_is_an_error() -> None:
    async with served() as own:
        own.mount.answers[programs.ENDED_SHORT_LINE] = b'"the goto ended 26.0 degrees from its goal"\n'
        own.mount.answers[b"get slewing\n"] = b"false\n"
        place = {"RightAscension": "5.5", "Declination": "-3", "ClientID": "1"}
        _, answer = await own.ask("PUT", API + "slewtocoordinates", data=place)
        assert answer["ErrorNumber"] == 0x40B and "26.0 degrees" in answer["ErrorMessage"]
        _, answer = await own.ask("PUT", API + "slewtocoordinatesasync", data=place)
        assert answer["ErrorNumber"] == 0


async def test_alpaca_goto_wait_does_not_feed_the_dead_man_switch() -> None:
    """The dead man's switch would let a motion by hand of a vanished program go on for ever."""
    async with served() as own:
        own.mount.answers[b"get slewing\n"] = b"true\n"
        place = {"RightAscension": "5.5", "Declination": "-3", "ClientID": "1"}
        waited = asyncio.create_task(own.ask("PUT", API + "slewtocoordinates", data=place))
        while len(own.mount.said) < 4:
            await asyncio.sleep(0.01)
        assert [line for name, line in own.mount.said if name == "127.0.0.1:id-1"] == [
            b"put slewtocoordinates RightAscension=5.5 Declination=-3\n"
        ]
        own.mount.answers[b"get slewing\n"] = b"false\n"
        assert (await waited)[1]["ErrorNumber"] == 0
        assert [guest.closed for guest in own.mount.guests] == [False, True]


async def test_alpaca_stop_is_sent_however_many_requests_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "MAX_WAITING_REQUESTS", 2)
    monkeypatch.setattr(programs, "MAX_PROGRAMS", 2)
    monkeypatch.setattr(programs, "REQUEST_TIMEOUT", 1.0)
    async with served() as own:
        own.mount.answers |= {b"get azimuth\n": None, b"put abortslew\n": None}
        asked = [asyncio.create_task(own.ask("GET", API + f"azimuth?ClientID={one % 2}")) for one in range(4)]
        while len(own.mount.said) < 4:
            await asyncio.sleep(0.01)
        _, full = await own.ask("GET", API + "altitude?ClientID=1")
        assert full["ErrorNumber"] == 0x500 and "Too many" in full["ErrorMessage"]
        assert (await own.ask("GET", API + "altitude?ClientID=2"))[0] == 403
        stops = [asyncio.create_task(own.ask("PUT", API + "abortslew", data={"ClientID": one})) for one in (1, 2)]
        await asyncio.gather(*asked, *stops)
        assert [line for _, line in own.mount.said].count(b"put abortslew\n") == 2


async def test_alpaca_server_refuses_clients_outside_allow() -> None:
    async with served() as own:
        own.mount.refuses = True
        assert (await own.ask("GET", API + "altitude"))[0] == 403


async def test_alpaca_server_remembers_a_bounded_number_of_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "MAX_PROGRAMS", 3)
    async with served() as own:
        for client in range(6):
            assert (await own.ask("GET", API + f"connected?ClientID={client}"))[0] == 200
        assert [guest.closed for guest in own.mount.guests] == [True] * 3 + [False] * 3


async def test_alpaca_clients_that_only_read_do_not_displace_a_connected_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A web page may send GETs without end, each with another ClientID."""
    monkeypatch.setattr(programs, "MAX_PROGRAMS", 3)
    async with served() as own:
        await own.ask("PUT", API + "connected", data={"Connected": "true", "ClientID": "7"})
        for client in range(10, 16):
            assert (await own.ask("GET", API + f"altitude?ClientID={client}"))[0] == 200
        assert [guest.closed for guest in own.mount.guests] == [False, True, True, True, True, False, False]


@pytest.mark.parametrize(
    "sent", [b"GET / HTTP/1.1\r\n\r\n", b"GET / HTTP/1.1\r\nA: " + b"a" * 9000, b":Mn#\x01##\r\n\r\n"]
)
async def test_bytes_that_are_no_http_get_status_400_without_a_traceback(
    sent: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    async with served() as own:
        host, port = own.url.removeprefix("http://").split(":")
        await own.ask("GET", API + "name")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(sent)
        async with asyncio.timeout(PATIENCE):
            assert b"400 Bad Request" in await reader.read()
        writer.close()
    assert caplog.records == []


async def test_alpaca_management_describes_server_and_devices() -> None:
    async with served() as own:
        _, versions = await own.ask("GET", "/management/apiversions?ClientTransactionID=9")
        assert versions["Value"] == [1] and versions["ClientTransactionID"] == 9
        _, about = await own.ask("GET", "/management/v1/description")
        assert set(about["Value"]) == {"ServerName", "Manufacturer", "ManufacturerVersion", "Location", "Gateways"}
        _, devices = await own.ask("GET", "/management/v1/configureddevices")
        [device] = devices["Value"]
        assert (device["DeviceName"], device["DeviceType"], device["DeviceNumber"]) == ("a mount", "Telescope", 0)
        assert (
            device["UniqueID"] == (await own.ask("GET", "/management/v1/configureddevices"))[1]["Value"][0]["UniqueID"]
        )
        for path in ("/setup", "/setup/v1/telescope/0/setup"):
            status, page = await own.ask("GET", path)
            assert status == 200 and "mount-gateway" in page and "a mount" in page
        assert (await own.ask("GET", "/setup/v1/telescope/1/setup"))[0] == 400


async def test_alpaca_request_sent_before_the_server_is_loaded_is_answered() -> None:
    """The request comes in two pieces, before aiohttp is loaded; another connection breaks off."""
    async with served() as own:
        host, port = own.url.removeprefix("http://").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        _, gone = await asyncio.open_connection(host, int(port))
        gone.close()
        request = f"GET {API}name HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n".encode()
        writer.write(request[:20])
        await asyncio.sleep(0)
        writer.write(request[20:])
        async with asyncio.timeout(PATIENCE):
            assert b"200 OK" in await reader.read()
        writer.close()
