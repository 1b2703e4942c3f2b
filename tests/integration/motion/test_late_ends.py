"""A gateway that was not run in time ends a guide pulse late: the log tells it, and the next pulse is as long as asked.

A program that guides measures the star after each pulse, and so corrects the excess itself.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.directions import NORTH, on_the_axes
from tests.support.in_process_gateway import Bridge

ARCSECONDS = 7.5205


def stand_still(seconds: float) -> None:
    """Let time pass without the gateway: no timer and no byte is seen meanwhile."""
    loop: Any = asyncio.get_running_loop()
    loop.elapsed += seconds


async def pulse(bridge: Bridge, letter: str, ms: int, before: float = 0.0, at_end: float = 0.0) -> float:
    """Return by how many seconds' worth a pulse has turned its axis, beyond tracking."""
    start, client = truth_of(bridge.sim), bridge.client()
    client.send(f":Mg{letter}{ms:04d}#".encode())
    if before:
        await asyncio.sleep(0.12)
        stand_still(before)
    if at_end:
        await asyncio.sleep(ms / 1000.0 - 0.05)
        stand_still(at_end)
    await asyncio.sleep(4.0)
    first, second = on_the_axes(start, truth_of(bridge.sim), NORTH, True)
    return (second if letter in "ns" else first) * 3600.0 / ARCSECONDS * (-1 if letter in "es" else 1)


@pytest.mark.parametrize("letter", ["n", "e", "w", "s"])
async def test_guide_pulse_is_not_shortened_after_one_that_ended_late(letter: str) -> None:
    async with Bridge("cpc", "4.21", latency=0.02, config={"sun": 0.0}) as bridge:
        await bridge.client().ask(b":Sz130*00#:Sa+40*00#:MA#", ending=b"0")
        await asyncio.sleep(60.0)
        assert await pulse(bridge, letter, 1000) == pytest.approx(1.0, abs=0.05)
        assert 1.3 < await pulse(bridge, letter, 1000, at_end=0.6) < 1.8
        told = [entry.note for entry in bridge.entries if "guide pulse" in entry.note]
        assert len(told) == 1 and "this computer did not run the gateway" in told[0]
        assert await pulse(bridge, letter, 1000) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("letter", ["n", "e", "w", "s"])
@pytest.mark.parametrize("missed", [0.1, 0.2])
async def test_guide_pulse_ends_in_time_though_the_gateway_was_delayed_at_its_start(letter: str, missed: float) -> None:
    """The acknowledgements are seen late; the motors have begun when they were told."""
    async with Bridge("cpc", "4.21", latency=0.02, config={"sun": 0.0}) as bridge:
        await bridge.client().ask(b":Sz130*00#:Sa+40*00#:MA#", ending=b"0")
        await asyncio.sleep(60.0)
        assert await pulse(bridge, letter, 1000, before=missed) == pytest.approx(1.0, abs=0.1)
