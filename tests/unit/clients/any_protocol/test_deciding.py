"""By which bytes a protocol is told: whole, one byte after the other, and with more behind."""

from __future__ import annotations

import re

from gateway.clients.any_protocol.deciding import (
    HTTP_PROTOCOL,
    find_protocol,
    greeting_protocol,
    protocol_may_change,
    shared_prefix_length,
)
from gateway.core.tables import read_table
from gateway.protocols.registry import PROTOCOLS, surfaces
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each

#: First commands as programs send them, by hand.
FIRST = [
    (b":GR#", "lx200"),
    (b":Q#", "lx200"),
    (b"\x06", "lx200"),
    (b"$Q#", "lx200"),
    (b":Sr05:34:32#", "lx200"),
    (b":GVP#", "lx200"),
    (b"E", "nexstar"),
    (b"e", "nexstar"),
    (b"V", "nexstar"),
    (b"M", "nexstar"),
    (b"T\x02", "nexstar"),
    (b"R34AB,12CE", "nexstar"),
    (b"r34AB0500,12CE0500", "nexstar"),
    (b"s34AB0500,12CE0500", "nexstar"),
    (b"P\x02\x10\x24\x05\0\0\0", "nexstar"),
    (b"H\x16\x1e\0\x0b\x16\x1a\0\0", "nexstar"),
    (b"W\x2d\0\0\0\x0a\0\0\0", "nexstar"),
    (b"\x14\0\0\0" + bytes(16), "stellarium"),
    (b"GET / HTTP/1.1\r\n", HTTP_PROTOCOL),
    (b"HEAD / HTTP/1.1\r\n", HTTP_PROTOCOL),
    (b"POST /x HTTP/1.1\r\n", HTTP_PROTOCOL),
    (b"PUT /api/v1/telescope/0/park HTTP/1.1\r\n", HTTP_PROTOCOL),
    (b"OPTIONS * HTTP/1.1\r\n", HTTP_PROTOCOL),
    (b"DELETE /x HTTP/1.1\r\n", HTTP_PROTOCOL),
]


@each("more", [b"", b":GR#", b"e", b"\r\n", b"\xff"])
@each(("sent", "protocol"), FIRST)
def test_protocol_is_recognised_though_more_bytes_follow_the_command(sent: bytes, protocol: str, more: bytes) -> None:
    found = find_protocol(sent + more)
    assert found is not None and found == (protocol, "")


@each(("sent", "protocol"), FIRST)
def test_protocol_is_decided_the_same_byte_by_byte(sent: bytes, protocol: str) -> None:
    told = [find_protocol(sent[:count]) for count in range(1, len(sent) + 1)]
    assert {found.protocol for found in told if found is not None} == {protocol}
    first = next(number for number, found in enumerate(told) if found is not None)
    assert all(found is not None for found in told[first:]), "once told, it stays so"
    assert first < 8, "it is told soon"


def test_every_plain_command_is_recognised_as_its_protocol_at_once() -> None:
    for name in surfaces():
        for command in load(name).commands.values():
            if command.requested and command.request.length is None and not command.request.fields:
                sent = command.request.prefix
                found = find_protocol(sent)
                assert found is not None and found == (name, ""), sent


def test_http_method_that_begins_with_a_nexstar_command_counts_as_nexstar() -> None:
    """One byte is a whole command of it: ``L`` is answered, and what follows shows a stranger."""
    whole = [
        method
        for methods in read_table("strangers.toml")["methods"].values()
        for method in methods
        if re.fullmatch(PROTOCOLS["nexstar"].opening_pattern, method[:1].encode())
    ]
    assert not {"GET", "HEAD", "POST", "PUT", "OPTIONS", "DELETE", "PATCH"} & set(whole)
    for method in whole:
        assert find_protocol(method[:1].encode()) == ("nexstar", "")


@each("sent", [b"P", b"H", b"R", b"S", b"G", b"PO", b"HEA", b"T", b"K", b"\x14"])
def test_ambiguous_first_bytes_decide_no_protocol(sent: bytes) -> None:
    found = find_protocol(sent)
    assert found is None or sent in (b"K", b"\x14"), "one letter of two protocols"


@each("sent", [b"XYZ", b"\xff\xfb\x01", b"!", b"\x01", b"9"])
def test_bytes_of_no_protocol_are_taken_for_lx200_with_a_logged_reason(sent: bytes) -> None:
    assert find_protocol(sent) == ("lx200", "because no protocol has a command that begins like this")


def test_unknown_lx200_command_is_recognised_as_lx200() -> None:
    assert find_protocol(b":ZZ") == ("lx200", "")


def test_nexstar_echo_decides_no_protocol() -> None:
    assert shared_prefix_length("nexstar", b"Ka") == 2 and shared_prefix_length("nexstar", b"KaKb:GR#") == 4
    assert shared_prefix_length("nexstar", b"EKa") == 0 and shared_prefix_length("lx200", b"Ka") == 0
    assert protocol_may_change("nexstar", b"#Ka") and not protocol_may_change("nexstar", b"KaE")
    assert protocol_may_change("stellarium", b"") and not protocol_may_change("lx200", b":GR#")


def test_any_port_greets_a_silent_client_as_stellarium() -> None:
    assert greeting_protocol() == "stellarium"
