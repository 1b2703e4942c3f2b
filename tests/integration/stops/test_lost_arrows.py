"""An arrow or a pulse that the mount may have heard, though no acknowledgement came: nobody could let go of it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tests.support.in_process_gateway import Bridge

ARROW = bytes((80, 2, 16, 37, 9, 0, 0, 0))  # east, the fastest


def disturb(bridge: Any, how: str, arrow: bytes = ARROW) -> list[bytes]:
    """The first arrow is not heard, its answer does not come, or comes twice, or comes bent -> what was sent."""
    wire, met = bridge.controller.line.wire, []
    feed = wire.feed

    def hear(data: bytes) -> bytes:
        if data != arrow or met:
            return bytes(feed(data))
        met.append(data)
        answer = b"" if how == "not heard" else bytes(feed(data))
        return {"lost": b"", "doubled": answer * 2, "bent": b"\xa3"}.get(how, answer)

    wire.feed = hear
    return met


@pytest.mark.parametrize("mount", ["cpc", "cge", "6-8se"])
@pytest.mark.parametrize("how", ["not heard", "lost", "doubled", "bent"])
@pytest.mark.parametrize("leaves", [True, False])
async def test_unacknowledged_arrow_is_ended(mount: str, how: str, leaves: bool) -> None:
    async with Bridge(mount, config={"lowest": -90.0, "sun": 0.0}) as bridge:
        client, met = bridge.client(), disturb(bridge, how)
        client.send(b":RS#:Me#")
        await asyncio.sleep(0.5)
        if leaves:
            client.close()
        await asyncio.sleep(10.0)
        assert met
        before = bridge.sim.mechanics.axes(bridge.clock())[0]
        await asyncio.sleep(1.0)
        assert abs(bridge.sim.mechanics.axes(bridge.clock())[0] - before) < 0.1
        assert bridge.sim.tracking


@pytest.mark.parametrize("how", ["lost", "doubled", "bent"])
async def test_unacknowledged_pulse_is_ended(how: str) -> None:
    """These motors know no pulses: it is a motion at the guide rate, and somebody must end it."""
    async with Bridge("cge", config={"lowest": -90.0, "sun": 0.0}) as bridge:
        client, met = bridge.client(), disturb(bridge, how, bytes((80, 2, 16, 37, 1, 0, 0, 0)))
        client.send(b":Mge1000#")
        await asyncio.sleep(10.0)
        assert met
        before = bridge.sim.true_position()[0]
        await asyncio.sleep(5.0)
        assert abs(bridge.sim.true_position()[0] - before) * 3600.0 < 1.0
        assert bridge.sim.tracking
