"""What the attacks, other servers and the judge of faces have found on Alpaca telescopes."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving
from tests.support.typed_programs import Refusal, face


@pytest.mark.parametrize("lacks", [frozenset(), frozenset({"tracking_put"})], ids=["all", "without SetTracking"])
@pytest.mark.parametrize("order", ["goto", "arrow"])
@pytest.mark.sampled(2)
async def test_wake_command_unparks_an_alpaca_mount_after_a_refused_motion(order: str, lacks: frozenset[str]) -> None:
    made: dict[str, Any] = {"parked": True, "lacks": lacks}
    async with Bridge("german", driven="alpaca", surface="lx200gps", simulated=made) as bridge:
        one = face("lx200", bridge)
        if order == "goto":
            with pytest.raises(Refusal, match="parked"):
                await one.leave(60.0, 40.0)
        else:
            await one.arrow("n", 0.5)
        await asyncio.sleep(2.0)
        assert bridge.sim.at == "park"
        bridge.client().send(b":hW#")
        await asyncio.sleep(3.0)
        assert bridge.sim.at == "" and bridge.sim.tracking is not bool(lacks)


async def test_stop_ends_a_long_guide_pulse_on_an_alpaca_mount() -> None:
    """AbortSlew ends no pulse, so a long one is sent in pieces; without a stop it is as long as it should be."""
    async with Bridge("german", driven="alpaca", surface="lx200gps", config={"lowest": -90.0}) as bridge:
        one, ends = face("lx200", bridge), []
        for stop in (True, False):
            before = bridge.sim.true_position()[1]
            await one.pulse("n", 3000)
            await asyncio.sleep(0.5)
            if stop:
                bridge.client().send(b":Q#")
                await asyncio.sleep(0.7)
                assert not moving(bridge.sim)
            await asyncio.sleep(6.0)
            ends.append(abs(bridge.sim.true_position()[1] - before) * 3600.0)
        assert ends[0] < 10.0 and ends[1] == pytest.approx(3.0 * 7.52, rel=0.02)


@pytest.mark.parametrize("reversed_too", [False, True])
@pytest.mark.parametrize("south", [False, True], ids=["north", "south"])
async def test_arrows_go_the_right_way_on_a_german_mount_that_reports_no_pier_side(
    reversed_too: bool, south: bool
) -> None:
    """The side follows from the hour angle of the last goto; a reversed motor shows with the first arrow, once."""
    made: dict[str, Any] = {"lacks": frozenset({"sideofpier", "destinationsideofpier"})}
    made["senses"] = (1, -1) if reversed_too else (1, 1)
    site = (-45.0, 10.0) if south else (45.0, 10.0)
    config = {"lowest": 0.0, "sun": 0.0}
    async with Bridge(
        "german", driven="alpaca", surface="lx200gps", config=config, simulated=made, site=site
    ) as bridge:
        one = face("lx200", bridge)
        for number, east in enumerate((25.0, -25.0, 25.0)):
            await one.goto((bridge.sim.sky.lst(bridge.clock()) + east) % 360.0, -30.0 if south else 30.0)
            await asyncio.sleep(3.0)
            went = []
            for _ in range(3):
                before = bridge.sim.true_position()[1]
                await one.arrow("n", 1.0)
                await asyncio.sleep(3.0)
                went.append(bridge.sim.true_position()[1] > before)
            assert went == [bool(number) or not reversed_too, True, True]
        turned = any("moved the tube to the south" in entry.note for entry in bridge.entries)
        assert turned is reversed_too


def test_alpaca_server_keeps_its_site_and_clock_when_a_program_sets_others() -> None:
    """The server has its own, which other programs use too; ``site-time`` passes them on."""

    async def site(**more: str) -> tuple[float, float, float]:
        config = {"lowest": -90.0, **more}
        async with Bridge("altaz", driven="alpaca", surface="lx200gps", config=config) as bridge:
            said = b":St+10*00#:Sg120*00#:SG+08#:SL10:00:00#:SC01/15/26#"
            await bridge.client().ask(said, 5.0, ending=b"#")
            await asyncio.sleep(10.0)
            return tuple(bridge.sim.sky)  # type: ignore[return-value]

    assert run(site()) == (45.0, 10.0, 0.0)
    assert run(site(site_time="always"))[:2] == (10.0, -120.0)
