"""The Sun that comes by itself: to a tube that rests, and one that rises beside a tube that tracks. By the true sky.

On 2026-03-20 at 45 N 10 E it rises at 05:28 UTC and sets at 17:28.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.mount_state import mount_state
from gateway.astro.spherical import SIDEREAL_RATE
from gateway.console.shown.view import state as page_state
from gateway.core import operations as op
from gateway.protocols.mechanics.truth import truth_of
from tests.integration.safety.test_sun_frames import DAY, LIMIT
from tests.support.in_process_gateway import Bridge
from tests.support.looks import goes, notes, to

#: 2026-03-20 05:00 UTC, 28 minutes before sunrise.
DAWN = 1773982800.0
MOUNTS = [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")]


def told(bridge: Any) -> str:
    """What ``status`` and the page say of the Sun; it must be the same."""
    state = mount_state(bridge.controller).to_state()
    bridge.gateway.names = list  # it has no ports
    shown = page_state(bridge.gateway, 0)
    words = [word for word in state.wanted if "Sun" in word]
    assert words == [word for word in shown["wanted"] if "Sun" in word]
    return "".join(words)


def warnings(bridge: Any) -> list[str]:
    return [note for note in notes(bridge) if note.startswith("WARNING: the Sun")]


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_resting_tube_in_the_suns_path_is_reported_15_minutes_ahead_and_not_moved(
    mount: str, driven: str
) -> None:
    async with Bridge(mount, driven=driven, start=DAY - 3600.0) as bridge:
        assert (await to(bridge, 275.0, 15.0))[0] is None
        await bridge.controller.perform(op.SetTracking(on=False))
        await asyncio.sleep(30.0)
        assert truth_of(bridge.sim).sun_distance > LIMIT + 10.0
        assert told(bridge) == ""
        axes, minutes = truth_of(bridge.sim), 0
        while not warnings(bridge):
            await asyncio.sleep(60.0)
            minutes += 1
            assert minutes < 180
        assert "within 20 degrees of the resting tube" in told(bridge)
        left = 0
        while truth_of(bridge.sim).sun_distance > LIMIT:
            await asyncio.sleep(60.0)
            left += 1
        assert 13 <= left <= 16
        await asyncio.sleep(600.0)
        assert f"the Sun is {truth_of(bridge.sim).sun_distance:.0f} degrees from the resting tube" in told(bridge)
        after = truth_of(bridge.sim)
        assert (after.axis1, after.axis2) == pytest.approx((axes.axis1, axes.axis2), abs=0.01)
        assert len(warnings(bridge)) == 1
        assert (await to(bridge, 330.0, 40.0))[0] is None, "it may be moved away"
        await asyncio.sleep(60.0)
        assert told(bridge) == ""


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_sun_rising_beside_a_tracking_tube_is_reported_and_tracking_continues(mount: str, driven: str) -> None:
    """Turning its tracking off would let the Sun walk over it."""
    async with Bridge(mount, driven=driven, start=DAWN) as bridge:
        sun = op.Equatorial(*bridge.controller.astrometry.sky.sun(bridge.clock()))
        assert (await goes(bridge, op.Goto(sun.ra - 15.0, sun.dec + 5.0)))[0] is None
        await asyncio.sleep(60.0)
        assert told(bridge) == ""
        near = truth_of(bridge.sim).sun_distance
        for _ in range(80):
            await asyncio.sleep(60.0)
            assert truth_of(bridge.sim).sun_distance > near - 0.3
        assert len(warnings(bridge)) == 1
        assert "rises 16 degrees from" in warnings(bridge)[0]
        assert "is 16 degrees from the tracking tube" in told(bridge)
        assert bridge.sim.tracking


async def test_tracking_that_approaches_the_sun_ends_at_the_limit() -> None:
    """At a rate of its own, such as that of a comet: two degrees an hour."""
    async with Bridge("lx200gps", driven="lx200", start=DAWN) as bridge:
        sun = op.Equatorial(*bridge.controller.astrometry.sky.sun(bridge.clock()))
        assert (await goes(bridge, op.Goto(sun.ra - 22.5, sun.dec)))[0] is None
        bridge.sim.feed(b":AP#")
        await asyncio.sleep(30.0)
        bridge.sim.mechanics.set_drive_rate(bridge.clock(), SIDEREAL_RATE * (1.0 - 2.0 / 15.0))
        for _ in range(90):
            await asyncio.sleep(60.0)
            if not bridge.sim.tracking:
                break
        assert not bridge.sim.tracking
        assert LIMIT - 0.2 < truth_of(bridge.sim).sun_distance < LIMIT + 0.5
        assert "tracking was switched off at the Sun" in "\n".join(notes(bridge))
