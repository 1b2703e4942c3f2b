"""Where programs connect now: what ``status`` names, and what is said when this computer gets another address."""

from __future__ import annotations

import asyncio
from ipaddress import ip_address
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.discovery import served as module
from gateway.app.discovery.offer import Offer, reachable_addresses
from gateway.app.discovery.served import PhoneInstructions, served_surfaces
from gateway.app.status import ServedSurface
from gateway.cli.serve import serving

NAMES = [
    "lx200:autostar@tcp://0.0.0.0:4030 pier",
    "nexstar:6-8se@tcp://127.0.0.1:4031",
    "lx200:lx200@pty:/tmp/lx200",
    "lx200@rfc2217://0.0.0.0:4032",
]


@pytest.fixture
def addresses(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses of this computer, besides that of the loopback interface; a test may change them."""
    own: list[str] = []

    def every() -> list[tuple[str, Any]]:
        return [("lo", ip_address("127.0.0.1")), *(("wlan0", ip_address(text)) for text in own)]

    monkeypatch.setattr(module, "reachable_addresses", lambda offer: reachable_addresses(offer, every, lambda far: ""))
    return own


def gateway(console: str = "tcp://0.0.0.0:4080") -> Any:
    return SimpleNamespace(names=lambda: NAMES, web=SimpleNamespace(address=console))


def test_status_names_every_surface_with_reachable_addresses(addresses: list[str]) -> None:
    addresses[:] = ["192.168.1.77"]
    phone, local, line, other, console = (str(one) for one in served_surfaces(gateway()))
    assert phone.startswith("lx200:autostar tcp://0.0.0.0:4030") and phone.endswith("192.168.1.77, port 4030")
    assert local.startswith("nexstar:6-8se tcp://127.0.0.1:4031") and line == "lx200:lx200 pty:/tmp/lx200"
    assert other.endswith(" rfc2217://192.168.1.77:4032") and console.endswith(" http://192.168.1.77:4080/")
    assert next(served_surfaces(gateway())).addresses == ("192.168.1.77",)
    assert list(served_surfaces(gateway("tcp://127.0.0.1:4081")))[-1] == ServedSurface(
        "console", "http://127.0.0.1:4081/", (), "this computer only"
    )
    assert len(list(served_surfaces(gateway("")))) == len(NAMES)


def test_status_shows_current_network_addresses(addresses: list[str]) -> None:
    here = gateway()
    words = "no other computer reaches {}: this one is not in a network yet (in the field: docs/programs/skysafari.md)"
    assert next(served_surfaces(here)).words == words.format("port 4030")
    assert list(served_surfaces(here))[-1].words == words.format("the console's port 4080")
    addresses[:] = ["10.0.0.5"]
    assert next(served_surfaces(here)).words == "on your phone: 10.0.0.5, port 4030"


def test_phone_address_is_printed_once_and_again_when_it_changes(addresses: list[str]) -> None:
    phone, offers = (
        PhoneInstructions(),
        [Offer("lx200", "tcp", "0.0.0.0", 4030), Offer("lx200", "tcp", "127.0.0.1", 1)],
    )
    assert len(phone.new_lines(offers)) == 1
    assert phone.new_lines(offers) == []
    addresses[:] = ["10.0.0.5"]
    assert phone.new_lines(offers) == ["on your phone: 10.0.0.5, port 4030"]
    assert phone.new_lines(offers) == []


async def test_gateway_prints_a_new_network_address_by_itself(addresses: list[str]) -> None:
    """As after a start before the Wi-Fi, and with a new lease."""
    said, phone = list[str](), PhoneInstructions()
    offers = [Offer("lx200", "tcp", "0.0.0.0", 4030)]
    assert phone.new_lines(offers)[0].startswith("no other computer")
    task = asyncio.ensure_future(serving._say_new_addresses(phone, lambda: offers, said.append))
    await asyncio.sleep(60.0)
    assert said == []
    for own in ("192.168.1.23", "192.168.1.99"):
        addresses[:] = [own]
        await asyncio.sleep(serving.ADDRESS_CHECK_PERIOD + 0.1)
        assert said[-1] == f"on your phone: {own}, port 4030"
    await asyncio.sleep(60.0)
    assert len(said) == 2
    task.cancel()
