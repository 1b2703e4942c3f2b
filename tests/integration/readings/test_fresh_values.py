"""Whoever asks a moving mount ten times a second reads another value each time, from the first second on."""

from __future__ import annotations

import asyncio
import itertools

import pytest

from gateway.core import operations as op
from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize(
    ("driven", "model", "question"),
    [
        ("nexstar", "6-8se", b":GZ#"),
        ("nexstar", "6-8se", b":GR#"),
        ("nexstar", "cge", b":GR#"),  # near the pole, where no value is calculated from the last ones
        ("lx200", "lx200gps", b":GZ#"),
        ("alpaca", "altaz", b":GZ#"),
    ],
)
async def test_polls_of_a_moving_mount_never_repeat_a_position(driven: str, model: str, question: bytes) -> None:
    async with Bridge(model, driven=driven, surface="lx200gps", config={"lowest": -90.0, "sun": 0.0}) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.Move(op.Direction.WEST, op.Rate(name="max")))
        await asyncio.sleep(2.0)
        sent, seen = len(bridge.sent_requests()), list[bytes]()
        for _ in range(40):
            seen.append(await client.ask(question, ending=b"#"))
            await asyncio.sleep(0.1)
        assert all(one != other for one, other in itertools.pairwise(seen)), seen
        assert len(bridge.sent_requests()) - sent < 120
