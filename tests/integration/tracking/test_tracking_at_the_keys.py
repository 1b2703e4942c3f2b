"""Tracking that somebody has switched at the mount's own keys is switched by the next order of a program, not before.

After an arrow the gateway resumes tracking and checks that the hand control has done so: what it ignored is sent once
more, what a person has turned off meanwhile is not.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner

MOUNTS = [("cpc", None), ("cge", None), ("cgem", "5.31"), ("6-8se", "4.21")]


@pytest.mark.parametrize("mount", ["autostar", "lx200gps"])
@pytest.mark.parametrize("on", [True, False])
async def test_tracking_command_reaches_a_meade_switched_at_its_hand_control(mount: str, on: bool) -> None:
    async with Bridge(mount, driven="lx200") as bridge:
        client, keys = bridge.client(), bridge.sim.connection()
        if not on:
            client.send(b":AL#")
            await asyncio.sleep(2.0)
        keys(b":AL#" if on else b":AA#")
        assert bridge.sim.tracking is not on
        client.send(b":AA#" if on else b":AL#")
        await asyncio.sleep(2.0)
        assert bridge.sim.tracking is on


@pytest.mark.parametrize("site", [(45.0, 10.0), (-33.0, 150.0)])
@pytest.mark.parametrize(("mount", "version"), MOUNTS)
@pytest.mark.parametrize("after", [0.4, 0.7, 1.05])
async def test_tracking_switched_off_after_an_arrow_stays_off(
    mount: str, version: str | None, site: tuple[float, float], after: float
) -> None:
    async with Bridge(mount, version, site=site) as bridge:
        owner, client = Owner(bridge, "nexstar"), bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        client.send(b":Qe#")
        await asyncio.sleep(after)
        owner.keys("tracking off")
        for _ in range(40):
            await asyncio.sleep(0.2)
            assert not bridge.sim.tracking
        assert not owner.begun()


@pytest.mark.parametrize(("ignored", "tracks"), [(1, True), (2, False)])
@pytest.mark.parametrize(("mount", "version"), MOUNTS)
def test_tracking_ignored_by_the_hand_control_is_sent_once_more(
    mount: str, version: str | None, ignored: int, tracks: bool
) -> None:
    async def program() -> None:
        async with Bridge(mount, version) as bridge:
            client, left = bridge.client(), ignored
            client.send(b":RM#:Me#")
            await asyncio.sleep(2.0)
            track = bridge.sim.track  # type: ignore[attr-defined]

            def deaf(mode: int) -> None:
                nonlocal left
                left -= 1
                if left < 0:
                    track(mode)

            set_deaf: Any = bridge.sim
            set_deaf.track = deaf
            client.send(b":Qe#")
            await asyncio.sleep(4.0)
            assert truth_of(bridge.sim).tracking is tracks
            assert len([sent for sent in bridge.sent_requests() if sent[:1] == b"T" and sent != b"T\0"]) == 2

    run(program())
