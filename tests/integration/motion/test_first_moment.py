"""A goto in the moment in which a mount is found: limits go by its own site and clock, not by a program's."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.axes import Observer
from gateway.astro.spherical import horizon_to_hour_angle, wrap360
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

#: A place at 3 degrees altitude in the west, and 22:00 UTC told as 19:00, when that place stood at 34 degrees.
LOW = (285.0, 3.0)
THREE_HOURS_SLOW = b"H\x13\x00\x00\x01\x0f\x1a\x00\x00"


def eight_digits(degrees: float) -> bytes:
    return b"%08X" % (round(degrees / 360.0 * (1 << 32)) & 0xFFFFFF00)


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize("latency", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("moment", [0.0, 4.0, 8.0])
async def test_first_goto_waits_for_the_site_and_clock_of_the_mount(mount: str, latency: float, moment: float) -> None:
    """``moment``: round trips since the port was opened."""
    bridge: Any = Bridge(mount, presented="nexstar", surface="cge", config={"lowest": 10.0}, latency=latency)
    bridge.controller.start()
    await asyncio.sleep(moment * latency)
    hour_angle, dec = horizon_to_hour_angle(*LOW, 45.0)
    ra = wrap360(Observer(45.0, 10.0).lst(bridge.clock()) - hour_angle)
    bridge.client().send(THREE_HOURS_SLOW + b"r" + eight_digits(ra) + b"," + eight_digits(dec))
    for _ in range(200):
        await asyncio.sleep(0.1)
        assert truth_of(bridge.sim).altitude > 9.7
    await bridge.controller.close()
