"""The console's address: what is said of it, and what is told on the network."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.discovery.served import PhoneInstructions
from gateway.cli.serve.console_and_broker import console_offers
from gateway.transport.listening import url_host


@pytest.mark.parametrize(
    ("host", "wide"), [("127.0.0.1", False), ("::1", False), ("0.0.0.0", True), ("192.0.2.7", True)]
)
def test_run_warns_only_of_a_console_that_other_computers_reach(host: str, wide: bool) -> None:
    page: Any = SimpleNamespace(address=f"tcp://{url_host(host)}:4080")
    assert bool(console_offers(page)) is wide and bool(PhoneInstructions().new_lines(console_offers(page))) is wide


def test_run_prints_the_console_address() -> None:
    page: Any = SimpleNamespace(address="tcp://192.0.2.7:4080")
    assert (
        b"".join(PhoneInstructions().new_lines(console_offers(page))[0].encode().split()[-1:])
        == b"http://192.0.2.7:4080/"
    )
