"""A motion by hand of which the position shows nothing is ended, before a limit is passed that nobody sees."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.mount.motion.ends import AxisSample
from gateway.mount.safety.watch import StallWatch
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge


def freeze(bridge: Any) -> None:
    """From now on the mount tells where it is now, wherever it goes."""
    wire, told = bridge.controller.line.wire, {}
    feed = wire.feed

    def hear(data: bytes) -> bytes:
        answer = bytes(feed(data))
        if data in (b"e", b"E", b"z", b"Z", b":GR#", b":GD#", b":GZ#", b":GA#"):
            return bytes(told.setdefault(data, answer))
        return answer

    wire.feed = hear


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200"), ("autostar", "lx200")]
)
@pytest.mark.parametrize("motion", [b":RM#:Ms#", b":RS#:Me#", b":RC#:Ms#"])
async def test_arrow_without_visible_motion_is_ended(mount: str, driven: str, motion: bytes) -> None:
    async with Bridge(mount, driven=driven, config={"lowest": 20.0}) as bridge:
        client = bridge.client()
        await client.ask(b":GR#")
        freeze(bridge)
        client.send(motion)
        for _ in range(24):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        slow = motion.startswith(b":RC#")
        assert not truth_of(bridge.sim).moving or slow
        said = [entry.note for entry in bridge.entries if "its position does not change" in entry.note]
        assert len(said) == (0 if slow else 1)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("mount", "driven"),
    [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200", "lx200"), ("lx200gps", "lx200"), ("autostar", "lx200")],
)
@pytest.mark.parametrize("motion", [b":RM#:Mn#:Me#", b":RS#:Ms#", b":RS#:Mw#", b":RC#:Me#"])
@pytest.mark.parametrize("latency", [0.05, 0.5])
async def test_arrow_with_visible_motion_is_not_ended(mount: str, driven: str, motion: bytes, latency: float) -> None:
    config = {"lowest": -90.0, "sun": 0.0}
    async with Bridge(mount, driven=driven, latency=latency, config=config) as bridge:
        client = bridge.client()
        client.send(motion)
        for _ in range(24):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        assert bridge.controller.wanted.axes_moved_by_hand
        assert not [entry.note for entry in bridge.entries if "shows nothing" in entry.note]


def test_motion_over_the_pole_is_not_reported_as_stalled() -> None:
    watch = StallWatch()
    for tick in range(40):
        dec = 85.0 + tick
        assert (
            watch.find_stalled(AxisSample(tick * 0.5, (0.0, dec if dec <= 90.0 else 180.0 - dec)), {2: 2.0}, 0.1)
            is None
        )
