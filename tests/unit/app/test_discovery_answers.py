"""Announcing: SkySafari's question, all of it on 127.0.0.1."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from ipaddress import ip_address
from typing import Any

import pytest

from gateway.app.config import Config, MountConfig, SurfaceConfig
from gateway.app.discovery.answering import DiscoveryAnswers, skyfi_answer
from gateway.app.discovery.offer import Offer, network_offers, phone_instruction, reachable_addresses
from gateway.cli.serve import serving
from tests.support.each import each
from tests.support.process import Running

LOCAL = ("127.0.0.1", 50000)
EVERYWHERE = Offer("lx200", "tcp", "0.0.0.0", 4030)
OTHER_PORT = Offer("nexstar", "tcp", "10.1.2.3", 4040)


@each(
    ("question", "says"),
    [
        (b"skyfi?", b"skyfi@127.0.0.1"),
        (b"skyfi:NAME?", b"skyfi:NAME@127.0.0.1"),
        (b"skyfi:My Scope?\r\n", b"skyfi:My Scope@127.0.0.1"),
        (b"SkyFi:?", b"SkyFi:@127.0.0.1"),
        (b"skyfi", b""),
        (b"skyfi??", b""),
        (b"skyfi@127.0.0.1", b""),  # another one's answer
        (b"skyfi:" + b"x" * 65 + b"?", b""),
        (b"xskyfi?", b""),
        (b"", b""),
    ],
)
def test_skysafari_discovery_request_gets_its_reply(question: bytes, says: bytes) -> None:
    assert skyfi_answer(question, [EVERYWHERE], LOCAL) == says


def test_discovery_reply_has_the_address_of_the_surface() -> None:
    six = Offer("lx200", "tcp", "fe80::1", 4030)
    assert skyfi_answer(b"skyfi?", [OTHER_PORT], LOCAL) == b"skyfi@10.1.2.3"
    assert skyfi_answer(b"skyfi?", [OTHER_PORT, EVERYWHERE], LOCAL) == b"skyfi@127.0.0.1"  # where SkySafari connects
    assert skyfi_answer(b"skyfi?", [six, OTHER_PORT], LOCAL) == b"skyfi@10.1.2.3"
    assert skyfi_answer(b"skyfi?", [six], LOCAL) == b""


def test_discovery_offers_only_surfaces_reachable_by_network() -> None:
    names = [
        "lx200:autostar@tcp://0.0.0.0:4030 pier",
        "nexstar:cge@rfc2217://[::1]:4031",
        "lx200:lx200@pty:/tmp/x",
        "lx200:lx200@/dev/ttyS1",
        "lx200:autostar@tcp://127.0.0.1:4040",
        "lx200:autostar@tcp://[fe80::1%eth0]:1",
    ]
    found = network_offers(names)
    assert [(offer.scheme, offer.host, offer.port, offer.is_reachable_by_others) for offer in found] == [
        ("tcp", "0.0.0.0", 4030, True),
        ("rfc2217", "::1", 4031, False),
        ("tcp", "127.0.0.1", 4040, False),
        ("tcp", "fe80::1%eth0", 1, True),
    ]
    assert [offer.protocol for offer in found] == ["lx200", "nexstar", "lx200", "lx200"]


@pytest.mark.real_time
async def test_skysafari_discovery_is_answered_until_the_gateway_ends() -> None:
    told: list[str] = []
    answers, second = DiscoveryAnswers(told.append), DiscoveryAnswers(told.append)
    await answers.answer_skyfi([EVERYWHERE], "127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as phone:
        phone.setblocking(False)
        phone.connect(("127.0.0.1", answers.skyfi_port))
        phone.send(b"nonsense")
        phone.send(b"skyfi:Newton?")
        async with asyncio.timeout(60):
            assert await asyncio.get_running_loop().sock_recv(phone, 100) == b"skyfi:Newton@127.0.0.1"
        assert told == []
        await second.answer_skyfi([EVERYWHERE], "127.0.0.1", answers.skyfi_port)  # another gateway
        assert second.skyfi_port == 0 and len(told) == 1 and f"UDP port {answers.skyfi_port} is in use" in told[0]
        answers.close()
        await asyncio.sleep(0)
        phone.send(b"skyfi?")
        with pytest.raises(ConnectionRefusedError):
            async with asyncio.timeout(60):
                await asyncio.get_running_loop().sock_recv(phone, 100)
    await second.answer_skyfi([], "127.0.0.1", 0)
    assert second.skyfi_port == 0


@pytest.mark.parametrize(("surfaces", "discovery", "found"), [
    (["lx200@tcp://127.0.0.1:0", "lx200@tcp://0.0.0.0:0"], True, ["0.0.0.0"]),
    (["lx200@tcp://127.0.0.1:0", "lx200@tcp://0.0.0.0:0"], False, []),
    (["lx200@tcp://127.0.0.1:0"], True, []),
])  # fmt: skip
def test_run_announces_the_presented_protocol_and_model(
    monkeypatch: pytest.MonkeyPatch, surfaces: list[str], discovery: bool, found: list[str]
) -> None:
    done, said = asyncio.Event(), []

    class Listener(DiscoveryAnswers):
        async def answer_skyfi(self, offers: Sequence[Offer], *_: Any) -> None:
            said.append([offer.host for offer in offers])
            done.set()

        def close(self) -> None:
            said.append("closed")

    monkeypatch.setattr("gateway.app.discovery.answering.DiscoveryAnswers", Listener)
    monkeypatch.setattr(serving, "end_signal_event", lambda: done)
    config = Config([MountConfig("nexstar@sim")], [SurfaceConfig(at) for at in surfaces], discovery=discovery)
    assert serving.run_on_loop(True, lambda: serving.serve_mounts(config)) == 0
    assert said == [found, "closed"]


# --- what a person types ---------------------------------------------------------------------------------------------


def held(*addresses: str) -> list[tuple[str, Any]]:
    """``INTERFACE=ADDRESS`` as this computer's."""
    return [(name, ip_address(text)) for name, _, text in (one.partition("=") for one in addresses)]


HOME = held(
    "lo=127.0.0.1",
    "eth0=169.254.3.4",
    "docker0=172.17.0.1",
    "tun0=10.8.0.2",
    "wlan0=192.168.1.23",
    "wlan0=fe80::5",
    "wlan0=2001:db8::7",
)


@each(
    ("host", "own", "says"),
    [
        ("0.0.0.0", HOME, "on your phone: 192.168.1.23 or 10.8.0.2, port 4030"),
        ("::", HOME, "on your phone: 192.168.1.23 or 10.8.0.2, port 4030"),
        ("::", held("wlan0=2001:db8::7"), "on your phone: 2001:db8::7, port 4030"),
        ("10.8.0.2", HOME, "on your phone: 10.8.0.2, port 4030"),
        (
            "0.0.0.0",
            held("lo=127.0.0.1"),
            "no other computer reaches port 4030: this one is not in a network yet (in the field: docs/programs/"
            "skysafari.md)",
        ),
    ],
)
def test_run_prints_what_to_type_into_a_phone(host: str, own: list[tuple[str, Any]], says: str) -> None:
    offer = Offer("lx200", "tcp", host, 4030)
    assert phone_instruction(offer, reachable_addresses(offer, lambda: own, lambda far: "192.168.1.23")) == says


def test_port_for_serial_programs_is_offered_to_other_computers() -> None:
    offer = Offer("lx200", "rfc2217", "0.0.0.0", 4030)
    assert "rfc2217://192.168.1.23:4030" in phone_instruction(offer, ["192.168.1.23"])


def test_phone_instructions_are_printed_before_the_ready_lines(started: list[Running]) -> None:
    gateway = Running("run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://0.0.0.0:0", "--surface",
                      "lx200@tcp://127.0.0.1:0", "--no-discovery")  # fmt: skip
    started.append(gateway)
    assert gateway.process.stdout is not None
    told: list[str] = []
    while not told or not told[-1].startswith("ready "):
        told.append(gateway.process.stdout.readline())
    local = gateway.ready()
    [line] = [line for line in told if line.startswith(("on your phone: ", "no other computer reaches port "))]
    assert local not in line
    assert gateway.end() == 0
    assert gateway.process.stdout.closed
