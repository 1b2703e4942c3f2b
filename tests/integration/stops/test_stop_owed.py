"""A stop that nobody acknowledges on a line that stays up is sent again, a bounded number of times."""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.cable import lose_commands
from tests.support.in_process_gateway import Bridge

ENDS = (b"M", b"P\x02\x10\x24\0", b"P\x02\x11\x24\0")


def to_a(mount: str) -> Bridge:
    return Bridge(mount, config={"lowest": -90.0, "sun": 0.0})


@pytest.mark.parametrize("mount", ["cge", "cpc"])
@pytest.mark.parametrize("rate", [b":RC#", b":RM#"])
@pytest.mark.parametrize("times", [3, 6, 12])
async def test_unacknowledged_stop_is_sent_three_times(mount: str, rate: bytes, times: int) -> None:
    """Whether the motion is fast enough to be seen or not."""
    async with to_a(mount) as bridge:
        client = bridge.client()
        client.send(rate + b":Mn#")
        await asyncio.sleep(3.0)
        assert abs(truth_of(bridge.sim).rate2) > 0.01
        lose_commands(bridge, ENDS, times)
        client.send(b":Q#")
        await asyncio.sleep(12.0 * times / 3 + 5.0)
        assert not bridge.controller.wanted.stop_owed
        assert abs(truth_of(bridge.sim).rate2) < 0.01


async def test_stop_is_given_up_and_reported_after_seven_times() -> None:
    async with to_a("cge") as bridge:
        client = bridge.client()
        client.send(b":RC#:Mn#")
        await asyncio.sleep(3.0)
        missed = lose_commands(bridge, ENDS, 1000)
        client.send(b":Q#")
        await asyncio.sleep(240.0)
        sent = len(missed)
        assert 15 < sent < 120
        assert [entry.note for entry in bridge.entries if "sent again and again" in entry.note]
        await asyncio.sleep(120.0)
        assert len(missed) == sent
        assert bridge.controller.wanted.stop_owed, "and goes out with the next one, or when the line is back"
