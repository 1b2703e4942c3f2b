"""What moves by hand a mount that is busy with itself, or not heard, is dropped: nothing is begun seconds later."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge, RehearsalClient


def meade(model: str) -> Bridge:
    return Bridge(model, driven="lx200", surface=model)


async def calculating(bridge: Bridge) -> None:
    """A classic that was told the date calculates its planets; an LX200GPS looks for satellites for a minute."""
    if bridge.sim.classic:
        bridge.controller.spawn(bridge.controller.perform(op.SetClock(bridge.clock() + 86400.0, 0.0)))
    else:
        bridge.client("10.0.0.7").send(b":gT#")
    await asyncio.sleep(1.5)


@pytest.mark.parametrize("model", ["lx200", "lx200gps"])
@pytest.mark.parametrize("by_hand", [b":Mn#", b":RS#:Me#", b":Mgn1000#"])
async def test_arrow_or_guide_pulse_to_a_busy_mount_is_dropped(model: str, by_hand: bytes) -> None:
    async with meade(model) as bridge:
        client = bridge.client()
        await calculating(bridge)
        client.send(by_hand)
        for _ in range(300):
            await asyncio.sleep(0.25)
            assert not truth_of(bridge.sim).moving
        client.send(by_hand)
        await asyncio.sleep(0.5)
        assert truth_of(bridge.sim).moving


def silence(bridge: Any, seconds: float) -> None:
    """The mount's answers are lost for so long; what is sent arrives."""
    wire = bridge.controller.line.wire
    good, until = wire.feed, bridge.controller.now() + seconds

    def feed(data: bytes) -> bytes:
        answer = bytes(good(data))
        return b"" if bridge.controller.now() < until else answer

    wire.feed = feed


async def look(bridge: Bridge) -> None:
    """Keep the line with a question that is not answered."""
    with contextlib.suppress(NoAnswer):
        await bridge.controller.read_now(op.Position())


@pytest.mark.parametrize(("mount", "driven"), [("cge", "nexstar"), ("cgx", "nexstar"), ("autostar", "lx200")])
@pytest.mark.parametrize("by_hand", [b":RS#:Me#", b":Mgw3000#"])
@pytest.mark.parametrize("asks", [True, False])
async def test_arrow_or_guide_pulse_on_a_silent_line_is_dropped(
    mount: str, driven: str, by_hand: bytes, asks: bool
) -> None:
    """``asks``: it waits behind a question of its own program."""
    async with Bridge(mount, driven=driven) as bridge:
        client: RehearsalClient = bridge.client()
        silence(bridge, 2.0)
        bridge.controller.spawn(look(bridge))
        (client if asks else bridge.client("10.0.0.8")).send(b":GR#")
        await asyncio.sleep(0.1)
        client.send(by_hand)
        for _ in range(60):
            await asyncio.sleep(0.25)
            assert not truth_of(bridge.sim).moving
        assert bridge.sim.tracking
        client.send(by_hand)
        await asyncio.sleep(0.5)
        assert truth_of(bridge.sim).moving
