"""Requests as HTTP has them become lines; what cannot be understood is told from what can."""

from __future__ import annotations

import pytest

from gateway.protocols.alpaca.http.requests import BadRequest, parse_request
from tests.support.each import each


def test_alpaca_get_accepts_parameter_names_in_any_case() -> None:
    asked = parse_request("GET", "canmoveaxis", [("AXIS", "1"), ("cLiEnTiD", "17"), ("clienttransactionid", "4")])
    assert asked.line == b"get canmoveaxis Axis=1\n"
    assert (asked.client_id, asked.transaction_id, asked.command.name) == (17, 4, "canmoveaxis")


def test_alpaca_put_requires_the_exact_case_of_parameter_names() -> None:
    place = [("Declination", "22.01"), ("RightAscension", "5.5"), ("clientid", "17")]
    asked = parse_request("PUT", "slewtocoordinatesasync", place)
    assert asked.line == b"put slewtocoordinatesasync RightAscension=5.5 Declination=22.01\n"
    assert (asked.client_id, asked.transaction_id) == (0, 0), "a name in another case is another name"
    with pytest.raises(BadRequest, match="Connected is missing"):
        parse_request("PUT", "connected", [("connected", "true")])


@each(
    ("method", "member", "pairs", "words"),
    [
        ("GET", "nothing", [], "no member 'nothing'"),
        ("GET", "RightAscension", [], "no member"),
        ("GET", "canmoveaxis", [], "Axis is missing"),
        ("GET", "canmoveaxis", [("Axis", "first")], "not a whole number"),
        ("GET", "canmoveaxis", [("Axis", "")], "not a whole number"),
        ("GET", "canmoveaxis", [("Axis", "1.0")], "not a whole number"),
        ("PUT", "tracking", [("Tracking", "yes")], "neither true nor false"),
        ("PUT", "slewtoaltazasync", [("Azimuth", "nan"), ("Altitude", "1")], "not a number"),
        ("PUT", "slewtoaltazasync", [("Azimuth", "1_0"), ("Altitude", "1")], "not a number"),
        ("PUT", "utcdate", [("UTCDate", "yesterday")], "utcdate"),
        ("PUT", "abortslew", [("ClientID", "-1")], "ClientID is '-1'"),
        ("PUT", "abortslew", [("ClientID", "")], "ClientID is ''"),
        ("PUT", "abortslew", [("ClientTransactionID", "4294967296")], "ClientTransactionID"),
        ("PUT", "abortslew", [("ClientTransactionID", "٣")], "ClientTransactionID"),
    ],
)
def test_malformed_alpaca_request_is_rejected(
    method: str, member: str, pairs: list[tuple[str, str]], words: str
) -> None:
    with pytest.raises(BadRequest, match=words) as refused:
        parse_request(method, member, pairs)
    assert not refused.value.allowed_methods


@each(("method", "member", "allow"), [("PUT", "slewing", "GET"), ("GET", "park", "PUT"),
                                                        ("POST", "tracking", "GET, PUT")])  # fmt: skip
def test_alpaca_request_with_the_wrong_method_is_rejected(method: str, member: str, allow: str) -> None:
    with pytest.raises(BadRequest) as refused:
        parse_request(method, member, [])
    assert refused.value.allowed_methods == allow


def test_line_break_in_an_alpaca_parameter_starts_no_new_command() -> None:
    asked = parse_request("PUT", "action", [("Action", "a b\nput park\n"), ("Parameters", "%#ä")])
    assert asked.line.count(b"\n") == 1 and asked.line.count(b" ") == 3
    assert asked.command.request.decode(asked.line) == {"action": "a b\nput park\n", "parameters": "%#ä"}
