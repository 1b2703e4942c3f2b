"""A mount that stands beyond a limit already: what leads farther is refused in words, what leads out is done.

Somebody at the keypad, or tracking until it was switched off, brought it there. Judged by the physical truth.
"""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.looks import notes

SINKING, RISING = 240.0, 120.0


def axes(first: float, second: float) -> bytes:
    """``b`` with both readings."""
    return b"b%08X,%08X" % tuple(int(degrees % 360.0 / 360.0 * 2**32) for degrees in (first, second))


@asynccontextmanager
async def standing(mount: str, first: float, second: float, version: str | None = None, **given: Any) -> Any:
    """A mount that was brought there before the gateway began, its tracking off; a program reads along."""
    bridge = Bridge(mount, version, **given)
    bridge.sim.feed(axes(first, second))
    await asyncio.sleep(60.0)
    bridge.sim.feed(b"T\x00")
    async with bridge:
        client = bridge.client()
        for _ in range(5):
            await client.ask({"lx200": b":GR#:GW#", "nexstar": b"et"}[given.get("presented", "lx200")])
            await asyncio.sleep(1.0)
        yield bridge


@pytest.mark.parametrize(("azimuth", "tracks"), [(SINKING, False), (RISING, True)])
async def test_tracking_below_the_altitude_limit_is_allowed_only_upwards(azimuth: float, tracks: bool) -> None:
    async with standing("cpc", azimuth, 30.0, config={"lowest": 35.0}) as bridge:
        bridge.client().send(b":AA#")
        await asyncio.sleep(5.0)
        assert truth_of(bridge.sim).tracking is tracks
        assert any("off at the altitude limit" in note for note in notes(bridge)) is not tracks


async def test_nexstar_program_reads_refused_tracking_as_off() -> None:
    """``T`` has no way to say no; ``t`` tells."""
    async with standing("cpc", SINKING, 30.0, config={"lowest": 35.0}, presented="nexstar", surface="cpc") as bridge:
        client = bridge.client()
        assert await client.ask(b"T\x01") == b"#"
        await asyncio.sleep(3.0)
        assert await client.ask(b"t") == b"\x00#"
        assert not truth_of(bridge.sim).tracking


async def test_mount_unparked_below_the_limit_does_not_sink_further() -> None:
    """Unparking puts tracking on; there it is switched off again."""
    async with Bridge("cpc", config={"lowest": 35.0, "park": (SINKING, 30.0)}) as bridge:
        await bridge.controller.perform(op.Park())
        await asyncio.sleep(40.0)
        assert not truth_of(bridge.sim).tracking
        await bridge.controller.perform(op.Unpark())
        for _ in range(60):
            await bridge.controller.read(op.Position())
            await asyncio.sleep(1.0)
        assert not truth_of(bridge.sim).tracking
        assert any("off at the altitude limit" in note for note in notes(bridge))


async def test_mount_woken_below_the_limit_does_not_sink_further() -> None:
    """A hand control that wakes tracks."""
    async with standing("cpc", SINKING, 30.0, "4.21", config={"lowest": 35.0}) as bridge:
        await bridge.controller.perform(op.Hibernate())
        await asyncio.sleep(5.0)
        await bridge.controller.perform(op.Wake())
        for _ in range(60):
            await bridge.controller.read(op.Position())
            await asyncio.sleep(1.0)
        assert not truth_of(bridge.sim).tracking


@pytest.mark.parametrize("pulse", [op.Pulse(op.Direction.SOUTH, 2500), op.PulseAxis(2, -1, 2500, 0.5)])
async def test_guide_pulse_below_the_limit_leads_up_or_is_refused(pulse: op.Pulse | op.PulseAxis) -> None:
    """Tracking had been switched off at the limit, and pulses led on past it, a quarter of a degree a minute."""
    async with standing("evolution", SINKING, 30.0, "5.31", config={"lowest": 35.0}) as bridge:
        before = truth_of(bridge.sim).altitude
        with pytest.raises(BelowHorizon):
            await bridge.controller.perform(pulse)
        await asyncio.sleep(5.0)
        assert truth_of(bridge.sim).altitude == pytest.approx(before, abs=1e-6)
        up = op.Pulse(op.Direction.NORTH, 2500) if isinstance(pulse, op.Pulse) else op.PulseAxis(2, 1, 2500, 0.5)
        await bridge.controller.perform(up)
        await asyncio.sleep(5.0)
        assert truth_of(bridge.sim).altitude > before + 0.001


async def test_refused_lx200_guide_pulse_is_logged() -> None:
    async with standing("evolution", SINKING, 30.0, "5.31", config={"lowest": 35.0}) as bridge:
        before = truth_of(bridge.sim).altitude
        bridge.client().send(b":Mgs2500#")
        await asyncio.sleep(5.0)
        assert truth_of(bridge.sim).altitude == pytest.approx(before, abs=1e-6)
        assert "Pulse: Object Below Lower Limit." in notes(bridge)


@pytest.mark.parametrize("mount", ["cge", "cgx"])
async def test_arrow_past_the_hour_angle_limit_leads_back_or_is_refused(mount: str) -> None:
    """10 degrees past the meridian with a limit of 7.5; pressed again and again an arrow led on, step by step."""
    async with standing(mount, 190.0, 140.0, config={"hour_angle_limit": 0.5}) as bridge:
        client = bridge.client()
        past = truth_of(bridge.sim).past_meridian
        assert past is not None
        assert past == pytest.approx(10.0, abs=0.2)
        for arrow in b"ew":
            for _ in range(3):
                client.send(b":RC#:M%c#" % arrow)
                await asyncio.sleep(0.7)
                client.send(b":Q%c#" % arrow)
                await client.ask(b":GR#")
                await asyncio.sleep(2.0)
                now = truth_of(bridge.sim).past_meridian
                assert now is not None and now < past + 0.05
        assert truth_of(bridge.sim).past_meridian < past - 0.05  # type: ignore[operator]
        assert any("Beyond the hour angle limit" in note for note in notes(bridge))


async def test_tracking_past_the_hour_angle_limit_stays_off() -> None:
    async with standing("cge", 190.0, 140.0, config={"hour_angle_limit": 0.5}) as bridge:
        past = truth_of(bridge.sim).past_meridian
        assert past is not None and past > 9.0
        bridge.client().send(b":AP#")
        for _ in range(30):
            await bridge.controller.read(op.Position())
            await asyncio.sleep(1.0)
        now = truth_of(bridge.sim)
        if now.tracking:
            assert now.past_meridian is not None and now.past_meridian < past
