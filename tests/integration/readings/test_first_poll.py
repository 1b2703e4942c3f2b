"""Whoever begins to poll a mount that already moves is told where it is, and not one place for half a second.

It moves by the order of a program that polls nothing, or at the mount's own keys, which the gateway was not told of.
"""

from __future__ import annotations

import asyncio
import itertools

import pytest

from gateway.astro.spherical import separation
from tests.support.in_process_gateway import Bridge
from tests.support.reported_positions import MOUNTS, bridge_to, reported_position, start_moving

#: Degrees a second at the mount's own keys.
KEYS = 3.0
#: Seconds for which one place may be told, and that the places may be old.
LONGEST, OLD = 0.25, 0.35


async def told(bridge: Bridge, presented: str, seconds: float) -> list[tuple[float, tuple[float, float], float]]:
    """Poll twenty times a second from now on; return the time of each answer, the place, and how far it is away."""
    client, loop, answers = bridge.client(), asyncio.get_running_loop(), []
    end = loop.time() + seconds
    while loop.time() < end:
        place = await reported_position(client, presented)
        answers.append((loop.time(), place, separation(*place, *bridge.sim.true_position())))
        await asyncio.sleep(0.05)
    return answers


def longest(answers: list[tuple[float, tuple[float, float], float]]) -> float:
    """Return for how many seconds one place was told at most."""
    since, most = answers[0][0], 0.0
    for (_, before, _), (at, place, _) in itertools.pairwise(answers):
        most = max(most, at - since)
        since = at if place != before else since
    return most


@pytest.mark.parametrize("latency", [0.02, 0.15])
@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
@pytest.mark.parametrize("mount", MOUNTS)
async def test_first_poll_shows_motion_begun_by_another_program(mount: str, presented: str, latency: float) -> None:
    async with bridge_to(mount, presented, latency=latency) as bridge:
        await start_moving(bridge.client(), presented, True)
        await asyncio.sleep(4.3)
        answers = await told(bridge, presented, 2.5)
        assert longest(answers) < LONGEST


@pytest.mark.parametrize("waits", [2.5, 4.3, 12.0])
@pytest.mark.parametrize("latency", [0.02, 0.15])
@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
@pytest.mark.parametrize("mount", MOUNTS)
async def test_first_poll_shows_motion_at_the_mounts_keys(
    mount: str, presented: str, latency: float, waits: float
) -> None:
    async with bridge_to(mount, presented, latency=latency) as bridge:
        await asyncio.sleep(20.0)
        bridge.sim.advance_to_now()
        pole = abs(bridge.sim.true_position()[1]) > 80.0  # there the first axis does not change the position
        bridge.sim.mechanics.set_rate(bridge.sim.now, 2 if pole else 1, KEYS)
        await asyncio.sleep(waits)
        answers = await told(bridge, presented, 2.5)
        began = answers[0][0]
        first = LONGEST + 4.0 * latency  # until there are two positions, of two exchanges each on a Meade
        assert longest(answers) < first
        assert max(far for at, _, far in answers if at > began + first) < KEYS * OLD
