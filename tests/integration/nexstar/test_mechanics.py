"""Home switches, guide rates and the focuser of a Celestron mount."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.protocols.nexstar.simulator.mount import FocuserMotor
from tests.support.in_process_gateway import Bridge

INDEX = 90.0


async def _away(bridge: Bridge) -> None:
    await bridge.controller.perform(op.Goto(bridge.sim.mechanics.sky.lst(bridge.clock()) + 40.0, 20.0))
    await asyncio.sleep(60.0)


async def test_home_switches_are_sought_only_if_configured() -> None:
    async with Bridge("cgx", config={"aux_home": True}) as bridge:
        await _away(bridge)
        assert bridge.sim.tracking
        client = bridge.client()
        client.send(b":hF#")
        await asyncio.sleep(2.0)
        assert await client.ask(b":h?#") == b"2"
        assert (await client.ask(b":D#")) != b"#"
        await asyncio.sleep(60.0)
        assert await client.ask(b":h?#") == b"1"
        first, second = bridge.sim.mechanics.axes(bridge.sim.now)
        assert second == pytest.approx(INDEX, abs=0.1)
        assert first == pytest.approx(INDEX, abs=0.6)  # it tracks again since
        assert bridge.sim.tracking
        assert not [request for request in bridge.sent_requests() if request[:1] == b"P" and request[3] == 0x19]
    async with Bridge("cgx") as bridge:
        with pytest.raises(Unsupported):
            await bridge.controller.perform(op.Home())
        assert not [request for request in bridge.sent_requests() if request[:1] == b"P" and request[3] == 0x0B]


@pytest.mark.parametrize("ends", [b":Q#", b":MS#"])
async def test_stop_or_goto_ends_the_search_for_home_switches(ends: bytes) -> None:
    async with Bridge("cgx", config={"aux_home": True}) as bridge:
        await _away(bridge)
        client = bridge.client()
        here = bridge.sim.mechanics.axes(bridge.sim.clock())
        client.send(b":hF#")
        await asyncio.sleep(2.0)
        hours = int(bridge.sim.mechanics.sky.lst(bridge.sim.clock()) / 15.0 + 3) % 24
        await client.ask(f":Sr{hours:02d}:00:00#".encode())
        await client.ask(b":Sd+30*00:00#")
        client.send(ends)
        await asyncio.sleep(60.0)
        assert await client.ask(b":h?#") == b"0"
        assert bridge.sim.tracking
        assert bridge.sim.mechanics.axes(bridge.sim.clock())[1] != pytest.approx(INDEX, abs=1.0)
        assert bridge.sim.mechanics.axes(bridge.sim.clock()) != here


@pytest.mark.parametrize(("config", "percent"), [({}, 50), ({"guide_rate": 0.8}, 80)])
async def test_guide_pulse_runs_at_the_configured_guide_rate(config: dict[str, float], percent: int) -> None:
    """Until a program sets one."""
    async with Bridge("avx", config=config) as bridge:
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":Mgn1000#:Mgw0500#")
        await asyncio.sleep(0.5)
        pulses = [request for request in bridge.sent_requests()[before:] if request[3:4] == b"\x26"]
        assert pulses == [bytes((80, 3, 17, 0x26, percent, 100, 0, 0)), bytes((80, 3, 16, 0x26, percent, 50, 0, 0))]


async def test_guide_pulse_runs_at_the_guide_rate_set_by_a_program() -> None:
    async with Bridge("avx") as bridge:
        client = bridge.client()
        client.send(b":Rg03.8#")
        await asyncio.sleep(1.0)
        before = len(bridge.sent_requests())
        client.send(b":Mgn1000#")
        await asyncio.sleep(0.5)
        pulses = [request for request in bridge.sent_requests()[before:] if request[3:4] == b"\x26"]
        assert [request[4] for request in pulses] == [25]


async def test_focuser_in_moves_towards_the_objective() -> None:
    bridge = Bridge("6-8se")
    bridge.sim.focuser = FocuserMotor()
    async with bridge:
        client = bridge.client()
        before = bridge.sim.focuser.position(bridge.clock())
        client.send(b":FF#:F+#")
        await asyncio.sleep(2.0)
        client.send(b":FQ#")
        await asyncio.sleep(1.0)
        inward = bridge.sim.focuser.position(bridge.clock())
        assert inward < before - 500
        await asyncio.sleep(2.0)
        assert bridge.sim.focuser.position(bridge.clock()) == inward
