"""On an alt-az Celestron a limit is kept after wrong syncs and with a wrong clock, by where the tube truly points."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Contradicted, Fault
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.truth import sampled


async def synced(bridge: Any, times: int, degrees: float) -> None:
    """Syncs that each take what the mount believes so many degrees north; it looks south."""
    for _ in range(times):
        here = await bridge.controller.answer(op.Position())
        await bridge.controller.perform(op.Sync(here.ra, here.dec + degrees))
        await asyncio.sleep(2.0)


async def lowest_of(bridge: Any, seconds: float) -> float:
    """How low the tube truly comes."""
    lows: list[float] = []
    async with sampled(bridge.sim, lambda truth: lows.append(truth.altitude)):
        await asyncio.sleep(seconds)
    return min(lows)


@pytest.mark.parametrize(("model", "version"), [("cpc", "4.21"), ("6-8se", None), ("cpc", "4.03")])
async def test_arrow_stops_at_the_limit_after_any_syncs(model: str, version: str | None) -> None:
    """Four syncs of 14 degrees lift the sky by 56: what is reckoned would let the tube sink far below the ground."""
    async with Bridge(model, version, config={"lowest": 20.0, "sync_limit": 180.0}, latency=0.05) as bridge:
        await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
        await asyncio.sleep(30.0)
        await synced(bridge, 4, 14.0)
        bridge.client().send(b":RS#:Ms#")
        low = await lowest_of(bridge, 30.0)
        assert 20.0 <= low < 30.0
        assert not bridge.controller.moving


async def test_goto_ends_at_the_limit_by_the_axis_reading() -> None:
    """The sky is believed 28 degrees higher than it is: what is reckoned at 30 is a tube at 2."""
    async with Bridge("cpc", config={"lowest": 10.0, "sync_limit": 180.0}) as bridge:
        await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
        await asyncio.sleep(30.0)
        await synced(bridge, 2, 14.0)
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        with contextlib.suppress(Fault):
            await bridge.controller.perform(op.Goto(sidereal % 360.0, -15.0))
        await asyncio.sleep(30.0)
        assert truth_of(bridge.sim).altitude > 9.5
        await bridge.controller.perform(op.Goto(sidereal % 360.0, 0.0))
        await asyncio.sleep(30.0)
        assert truth_of(bridge.sim).altitude == pytest.approx(17.0, abs=0.5)


async def test_wrong_clock_in_the_hand_control_does_not_void_the_altitude_limit() -> None:
    """Three hours slow, set at its keys: the sky it tells jumps by 45 degrees, and the tube stands where it stood."""
    async with Bridge("cpc", config={"lowest": 20.0}) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
        await asyncio.sleep(30.0)
        bridge.sim.feed(b"H" + bytes((19, 0, 0, 1, 15, 26, 0, 0)))
        for _ in range(60):
            await client.ask(b":GR#")
            await asyncio.sleep(1.0)
        assert bridge.sim.tracking
        client.send(b":RS#:Ms#")
        low = await lowest_of(bridge, 20.0)
        assert low >= 20.0


@pytest.mark.parametrize("written", [True, False])
def test_clock_disagreement_blocks_a_goto_only_with_a_configured_limit(written: bool) -> None:
    """An hour fast: 14 degrees by the mount, less by this computer's clock. Which of them is right nobody knows."""

    async def program() -> None:
        config = {"lowest": 10.0} if written else {}
        async with Bridge("cpc", config=config, host_ahead=3600.0) as bridge:
            seen = bridge.controller.astrometry.equatorial_of(op.GotoHorizontal(240.0, 14.0))
            if written:
                with pytest.raises(Contradicted, match="differ by 60 minutes"):
                    await bridge.controller.perform(op.Goto(seen.ra, seen.dec))
                return
            await bridge.controller.perform(op.Goto(seen.ra, seen.dec))
            await asyncio.sleep(40.0)
            assert truth_of(bridge.sim).altitude == pytest.approx(14.0, abs=0.5)

    run(program())
