"""The caution about a port without a password names the network of the address that was printed for phones."""

from __future__ import annotations

from ipaddress import IPv4Network

from gateway.app.bindings import exposure_warning
from gateway.app.config import SurfaceConfig
from tests.support.each import each

HERE = [IPv4Network("10.42.0.0/24")]
WHERE = "tcp://0.0.0.0:4030"


@each(
    ("allow", "read_only", "where", "says"),
    [
        (None, False, WHERE, "--allow 10.42.0.0/24,127.0.0.1"),
        (None, False, "tcp://127.0.0.1:4030", ""),
        (None, True, WHERE, ""),
        (["10.42.0.0/24"], False, WHERE, ""),
        (["10.42.0.7"], False, WHERE, ""),
        (["192.168.1.0/24", "127.0.0.1"], False, WHERE, "10.42.0.0/24"),
        (["192.168.1.0/24", "::1"], True, WHERE, "10.42.0.0/24"),
    ],
)
def test_open_port_warning_names_the_network_of_the_printed_address(
    allow: list[str] | None, read_only: bool, where: str, says: str
) -> None:
    surface = SurfaceConfig(at=f"lx200@{where}", allow=allow, read_only=read_only)
    words = exposure_warning(where, surface, lambda _: HERE)
    assert says in words and bool(words) is bool(says)


def test_open_port_warning_without_a_network_names_only_this_computer() -> None:
    assert "--allow 127.0.0.1" in exposure_warning(WHERE, SurfaceConfig(at=f"lx200@{WHERE}"), lambda _: [])
