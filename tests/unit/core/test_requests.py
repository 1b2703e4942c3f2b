"""Requests as lines, which recordings and gateways of other versions hold, and the answers to them."""

from __future__ import annotations

import json

import pytest

from gateway.core import requests
from gateway.core.operations import Direction
from gateway.core.requests import Answer, decode, encode, read_answer
from tests.support.each import each

#: As a gateway of November 2026 has recorded them.
RECORDED = {
    '{"type":"goto","number":"a1","who":"","where":{"type":"spot","ra":83.6,"dec":22.0,"j2000":true}}':
        requests.Goto(requests.Spot(83.6, 22.0, j2000=True), number="a1"),
    '{"type":"sync","number":"a1","who":"mqtt","where":{"type":"body","name":"Moon"}}':
        requests.Sync(requests.Body("Moon"), number="a1", who="mqtt"),
    '{"type":"press","number":"a1","who":"me","direction":"n","key":7}':
        requests.Press(Direction.NORTH, 7, number="a1", who="me"),
    '{"type":"let go","number":"a1","who":"me","lost":true}': requests.LetGo(lost=True, number="a1", who="me"),
    '{"type":"follow","number":"a1","who":""}': requests.Follow("a1"),
    '{"type":"see","fresh":false}': requests.See(fresh=False),
}  # fmt: skip


def test_a_line_of_an_earlier_version_is_read_and_a_new_one_has_the_same_fields() -> None:
    for line, request in RECORDED.items():
        assert decode(line) == request
        assert decode(encode(request)) == request
        written = json.loads(encode(request))
        assert written.items() <= json.loads(line).items() and encode(request).isascii()


def test_every_request_has_a_number_of_its_own() -> None:
    first, second = requests.Park(), requests.Park()
    assert first.number != second.number and len(first.number) == 16


@each(
    ("text", "answer"),
    [
        ("done it is parked", Answer("done", "it is parked")),
        ("under way 05:34:32 +22°00'52\"", Answer("under way", "05:34:32 +22°00'52\"")),
        ("under way ", Answer("under way", "")),
        ("failed The mount is busy.", Answer("failed", "The mount is busy.")),
        ("stopped", Answer("done", "stopped")),
        ('{"look":{}}', Answer("done", '{"look":{}}')),
        ('["failed","The mount is busy.","Busy"]', Answer("failed", "The mount is busy.", "Busy")),
    ],
)
def test_an_answer_is_read_in_both_forms(text: str, answer: Answer) -> None:
    assert read_answer(text) == answer


@pytest.mark.parametrize("line", ["", "[]", '{"type":"fly"}', '{"type":"goto"}', '{"type":"park"}\n', "\xff"])
def test_what_is_no_request_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match=r"plain text|Input|Object|Invalid|Expected"):
        decode(line)
