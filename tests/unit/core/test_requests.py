"""Requests as lines, which the control endpoint gets and recordings hold."""

from __future__ import annotations

import json

import pytest

from gateway.core import requests
from gateway.core.operations import Direction
from gateway.core.requests import decode, encode

LINES = {
    '{"type":"goto","number":"a1","who":"","where":{"type":"spot","ra":83.6,"dec":22.0,"j2000":true}}':
        requests.GotoRequest(requests.Spot(83.6, 22.0, j2000=True), number="a1"),
    '{"type":"sync","number":"a1","who":"mqtt","where":{"type":"body","name":"Moon"}}':
        requests.SyncRequest(requests.Body("Moon"), number="a1", who="mqtt"),
    '{"type":"press","number":"a1","who":"me","direction":"n","key":7}':
        requests.PressKeyRequest(Direction.NORTH, 7, number="a1", who="me"),
    '{"type":"let go","number":"a1","who":"me","lost":true}':
        requests.ReleaseKeyRequest(lost=True, number="a1", who="me"),
    '{"type":"see","fresh":false}': requests.StateRequest(fresh=False),
}  # fmt: skip


def test_control_request_is_one_line_of_json() -> None:
    for line, request in LINES.items():
        assert decode(line) == request
        assert json.loads(encode(request)) == json.loads(line) and encode(request).isascii()


def test_every_control_request_has_a_unique_number() -> None:
    first, second = requests.ParkRequest(), requests.ParkRequest()
    assert first.number != second.number and len(first.number) == 16


@pytest.mark.parametrize("line", ["", "[]", '{"type":"fly"}', '{"type":"goto"}', '{"type":"park"}\n', "\xff"])
def test_malformed_control_line_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match=r"plain text|Input|Object|Invalid|Expected"):
        decode(line)
