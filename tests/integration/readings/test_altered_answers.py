"""One answer that was altered on the way and kept its form is not believed, whichever question it was for.

The bytes are typed from the manuals: the answer as the mount gives it, and as it arrives once.
"""

from __future__ import annotations

from typing import Any

import pytest

from gateway.core import operations as op
from gateway.protocols.lx200.nmea import parse_fix
from tests.support.in_process_gateway import Bridge


def alter(bridge: Any, question: bytes, to: bytes) -> list[bytes]:
    """The next answer to this question arrives as another one of the same form -> the answers that were replaced."""
    wire, replaced = bridge.controller.line.wire, []
    feed = wire.feed

    def hear(data: bytes) -> bytes:
        answer = bytes(feed(data))
        if data == question and not replaced:
            assert len(answer) == len(to)
            assert answer != to
            replaced.append(answer)
            return to
        return answer

    wire.feed = hear
    return replaced


#: mount, its protocol, operation; the question, and what its answer becomes once.
ALTERED = [
    ("cge", "nexstar", op.PierSide(), b"p", b"W#"),
    ("autostar", "lx200", op.GetStatus(), b":GW#", b"PT1"),
    ("autostar", "lx200", op.GetStatus(), b":GW#", b"AN1"),
    ("lx200gps", "lx200", op.HomeState(), b":h?#", b"1"),
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 55, 0, 0, 0, 1)), b"\x00#"),  # not linked
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 1, 0, 0, 0, 3)), b"\x40\x00\x00#"),  # latitude 90
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 2, 0, 0, 0, 3)), b"\x40\x00\x00#"),  # longitude 90
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 3, 0, 0, 0, 2)), b"\x01\x10#"),  # January 16
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 4, 0, 0, 0, 2)), b"\x07\xeb#"),  # 2027
    ("cpc", "nexstar", op.GetGps(), bytes((80, 1, 176, 51, 0, 0, 0, 3)), b"\x15\x00\x05#"),  # 21:00:05
    ("cge", "nexstar", op.GuideRate(1), bytes((80, 1, 16, 71, 0, 0, 0, 1)), b"\xe6#"),  # 0.9
]  # fmt: skip


@pytest.mark.sampled(every=1)  # one row of the tables that is not looked at again would be believed
@pytest.mark.parametrize(("mount", "driven", "operation", "question", "to"), ALTERED)
async def test_answer_garbled_on_the_line_is_read_again(
    mount: str, driven: str, operation: op.Read, question: bytes, to: bytes
) -> None:
    async with Bridge(mount, driven=driven) as bridge:
        truth = await bridge.controller.perform(operation)
    async with Bridge(mount, driven=driven) as bridge:
        if not isinstance(operation, op.GetGps):
            assert await bridge.controller.read_now(operation) == truth  # else what was heard first is what was altered
        replaced = alter(bridge, question, to)
        told = await (bridge.controller.perform if isinstance(operation, op.GetGps) else bridge.controller.read_now)(
            operation
        )
        assert replaced
        if isinstance(truth, op.Gps):
            assert told.linked
            assert told.place == truth.place
            assert abs(told.unix - truth.unix) < 30.0
        else:
            assert told == truth


def test_gps_sentence_with_a_bad_checksum_is_rejected() -> None:
    """``:gps#`` tells another moment each time, so no two can agree: the sum at its end is what makes it believed."""
    sentence = "$GPRMC,220000.00,A,4500.000,N,01000.000,E,0.0,0.0,150126,,*39"
    body, _, _ = sentence[1:].partition("*")
    total = 0
    for letter in body.encode():
        total ^= letter
    right = f"${body}*{total:02X}"
    seen = parse_fix(right)
    assert seen is not None
    assert seen.linked
    assert parse_fix(right.replace("4500", "4600")) is None
    assert parse_fix(right.replace("01000.000", "01100.000")) is None
    assert parse_fix(right.partition("*")[0]) is None
