"""A drive rate of one's own outlives arrows, pulses and gotos: measured as drift of the tube against the stars."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

#: 58.0 Hz of 60.164 is 14.5 arcseconds a second; the Moon goes at 14.685.
RATES = {b":ST58.0#": 15.041 * (1 - 58.0 / 60.164), b":TL#": 15.041 - 14.685, b":TQ#": 0.0}


async def drift(bridge: Any, seconds: float = 10.0) -> float:
    """Arcseconds a second in right ascension."""
    before, began = bridge.sim.truth()[0], bridge.clock()
    await asyncio.sleep(seconds)
    return float((bridge.sim.truth()[0] - before) * 3600.0 / (bridge.clock() - began))


@pytest.mark.parametrize(("mount", "version"), [("cge", "4.21"), ("cge", "4.10"), ("avx", None), ("cgx", "5.31")])
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("motion", [b":RG#:Me#", b":Mge0500#", b":RS#:Me#", b":RC#:Mn#:Mw#"])
def test_a_drive_rate_runs_on_after_motion(mount: str, version: str | None, rate: bytes, motion: bytes) -> None:
    async def program() -> None:
        async with Bridge(mount, version) as bridge:
            client = bridge.client()
            await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b"0")
            await asyncio.sleep(40.0)
            client.tell(rate)
            await asyncio.sleep(3.0)
            assert await drift(bridge) == pytest.approx(RATES[rate], abs=0.05)
            client.tell(motion)
            await asyncio.sleep(1.0)
            client.tell(b":Qe#:Qn#:Qw#")
            await asyncio.sleep(6.0)
            assert await drift(bridge) == pytest.approx(RATES[rate], abs=0.05)

    run(program())
