"""A goto asked for while a guide pulse runs: the pulse ends before it, and nothing of it is said during the goto."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize(("driven", "model", "version"), [
    ("nexstar", "cge", "3.02"), ("nexstar", "cge", "4.21"), ("lx200", "lx200", None), ("lx200", "lx200gps", None),
])  # fmt: skip
async def test_goto_ends_a_running_guide_pulse(driven: str, model: str, version: str | None) -> None:
    async with Bridge(model, version, driven=driven) as bridge:
        ra, dec = bridge.sim.true_position()
        pulse = asyncio.ensure_future(bridge.controller.perform(op.Pulse(op.Direction.WEST, 3000)))
        await asyncio.sleep(0.5)
        await bridge.controller.perform(op.Goto((ra + 12.0) % 360.0, min(dec + 8.0, 80.0)))
        before = len(bridge.sent_requests())
        await asyncio.sleep(4.0)
        await pulse
        said = [sent for sent in bridge.sent_requests()[before:] if sent[:2] in (b":Q", b":M", b"P\2", b"P\3")]
        assert said == []
        while await bridge.controller.read(op.Slewing()):
            await asyncio.sleep(0.5)
        there = bridge.sim.true_position()
        assert abs((there[0] - ra - 12.0 + 180.0) % 360.0 - 180.0) < 0.1
