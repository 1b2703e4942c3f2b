"""``detect`` finds the telescopes of Alpaca servers, each once, and names a gateway as one."""

from __future__ import annotations

import asyncio
import json
import os
import socket
from collections.abc import Awaitable, Callable
from ipaddress import IPv4Address, IPv4Network
from typing import Any

import pytest
from aiohttp import web

from gateway.app.pages import make_app
from gateway.app.simulated import serve_simulator
from gateway.cli import main
from gateway.core.wire_log import WireLog
from gateway.diagnostics.detect.report import as_toml, describe_port, start_command
from gateway.diagnostics.detect.scan_port import ask_servers
from gateway.protocols.alpaca.http import chain, finding
from gateway.protocols.alpaca.http.discovery import answer_discovery
from gateway.protocols.alpaca.http.server import AlpacaServer
from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca
from gateway.protocols.base.spec import OfferedMount
from gateway.transport.web_server import WebDevice, WebServer
from tests.support.in_process_gateway import EVENING


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])


def served(look: Callable[[list[str]], Awaitable[Any]], *simulators: SimulatedAlpaca) -> Any:
    """Serve each simulator on two ports, and return what ``look`` returns for the addresses."""

    async def program() -> Any:
        ports = []
        for sim in simulators:
            ports += await serve_simulator(sim, ["tcp://127.0.0.1:0", "tcp://127.0.0.1:0"], 0.0)
        where = [port.address.replace("tcp:", "http:") for port in ports]
        try:
            async with asyncio.timeout(60.0):
                return await look(where)
        finally:
            for port in ports:
                await port.close()

    return asyncio.run(program())


def test_detect_lists_each_telescope_of_an_alpaca_server_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two addresses of a server are one telescope; a server that is none offers nothing."""
    loopback = IPv4Address("127.0.0.1"), IPv4Network("127.0.0.0/8")
    monkeypatch.setattr(finding, "ipv4_networks", lambda: [loopback])
    monkeypatch.setattr(finding, "DISCOVERY_WAIT", 0.6)
    udp = free_udp_port()

    async def look(where: list[str]) -> list[OfferedMount]:
        places = [("127.0.0.1", int(one.rpartition(":")[2])) for one in where]
        silent = socket.create_server(("127.0.0.1", 0))  # takes connections and never answers
        monkeypatch.setattr(finding, "SERVER_TIMEOUT", 2.0)
        end = await answer_discovery([*places, silent.getsockname()], udp)
        try:
            return await finding.find(None, udp)
        finally:
            end()
            silent.close()

    german, polar = (SimulatedAlpaca(kind, clock=lambda: EVENING) for kind in ("german", "polar"))
    found = served(look, german, polar)
    assert sorted(one.product for one in found) == ["Simulated german", "Simulated polar"]
    assert {one.unique_id for one in found} == {german.unique_id, polar.unique_id}
    assert not any(one.is_gateway for one in found)


def test_detect_prints_the_run_command_for_an_alpaca_telescope() -> None:
    sim = SimulatedAlpaca("polar", clock=lambda: EVENING)
    [finding_there] = served(ask_servers, sim)
    where = finding_there.port.url
    assert where.startswith("http://127.0.0.1:") and where.endswith("/0")
    assert f"mount-gateway run --mount alpaca@{where} --surface lx200@tcp://127.0.0.1:4030" in describe_port(
        finding_there
    )
    assert "Simulated polar" in describe_port(finding_there) and f"alpaca@{where}" in start_command(finding_there)
    assert f'at = "alpaca@{where}"' in as_toml(finding_there)


def test_alpaca_server_is_found_by_its_host_name() -> None:
    sim = SimulatedAlpaca(clock=lambda: EVENING)

    async def look(where: list[str]) -> list[OfferedMount]:
        return await finding.find(
            [where[0].replace("127.0.0.1", "localhost"), "http://[::1]:9", "http://nowhere.invalid"]
        )

    [found] = served(look, sim)
    assert found.url.startswith("http://localhost:") and found.product == "Simulated german"


@pytest.mark.parametrize(
    "told", [None, [], {"Value": "nothing"}, {"Value": [{"DeviceType": "Camera", "DeviceNumber": 0}, 7]}]
)
def test_detect_reports_an_alpaca_server_without_a_telescope(told: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    sim = SimulatedAlpaca(clock=lambda: EVENING)
    monkeypatch.setattr(SimulatedAlpaca, "request", lambda *_: (200, json.dumps(told)))
    assert served(finding.find, sim) == []


def test_detect_reports_that_no_alpaca_server_answered(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        assert main(["detect", f"http://127.0.0.1:{closed.getsockname()[1]}"]) == 1
    assert "no mount was found" in capsys.readouterr().out


def test_detect_says_that_an_alpaca_server_is_itself_a_gateway() -> None:
    async def program() -> str:
        async def load() -> web.Application:
            app = make_app()
            device = WebDevice(lambda connected: None, "nexstar@sim", WireLog(lambda: 0.0))  # type: ignore[arg-type,return-value]
            AlpacaServer([device]).add_to(app)
            return app

        server = WebServer(load)
        port = await server.listen("tcp://127.0.0.1:0")
        try:
            [found] = await ask_servers([port.address.replace("tcp", "http")])
        finally:
            await server.close()
        assert found.mount is None
        return describe_port(found)

    text = asyncio.run(program())
    assert "mount-gateway" in text and "it needs no second gateway: nexstar@sim" in text


def test_gateway_refuses_a_chain_of_gateways_that_contains_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tokens of gateways in a row are all there; one's own is refused."""
    monkeypatch.setattr(chain, "_tokens", {})
    (
        chain.check_for_loop("http://a", {"ServerName": "another"}),
        chain.check_for_loop("http://b", {"Gateways": ["first", "second", 3]}),
    )
    own = chain.own_token(os.getpid())
    assert chain.tokens() == [own, "first", "second"] and own != chain.own_token(os.getpid() + 1)
    with pytest.raises(OSError, match="this very gateway"):
        chain.check_for_loop("http://c", {"Gateways": ["first", own]})
    chain.check_for_loop("http://b", {"Gateways": "nonsense"})
    assert chain.tokens() == [own]
