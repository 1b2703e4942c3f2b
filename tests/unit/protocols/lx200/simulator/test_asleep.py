"""A Meade that sleeps turns no motor, and what :GW# tells in land mode does not change how the telescope stands."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.simulated_meade import meade, overhead

#: What would turn a motor, and what an LX200GPS answers to it while its motors have no power.
TURNS = [
    (b":MS#", b"0"),
    (b":MA#", b"0"),
    (b":RS#:Mn#", b""),
    (b":RG#:Mw#", b""),
    (b":Mge0500#", b""),
    (b":hP#", b""),
    (b":hS#", b""),
    (b":hF#", b""),
    (b":Aa#", b"0"),
    (b":AA#", b""),
    (b":TQ#", b""),
]


@each(("order", "answer"), TURNS)
def test_sleeping_simulated_meade_turns_no_motor_until_woken(order: bytes, answer: bytes) -> None:
    sim, clock = meade("lx200gps")
    assert sim.feed(overhead(sim) + b":Sa+60*00#:Sz120*00#:hN#") == b"1111"
    before = sim.mechanics.axes(clock.now)
    assert sim.feed(order) == answer
    clock.now += 5.0
    assert sim.mechanics.axes(clock.now) == before and not sim.slewing and not sim.tracking
    assert sim.feed(b":h?#") == b"0"  # it does not look for its home
    sim.feed(b":hW#")
    assert sim.tracking
    sim.feed(overhead(sim) + b":MS#")
    clock.now += 5.0
    assert sim.mechanics.axes(clock.now) != before


@each(("tells_altaz", "said"), [(False, b"PN1"), (True, b"AN1")])
def test_simulated_meade_reports_its_alignment_mode_by_gw(tells_altaz: bool, said: bytes) -> None:
    sim, _ = meade("autostar", land_tells_altaz=tells_altaz)
    assert sim.feed(b":GW#:AP#:GW#\x06:AL#:GW#\x06:AP#:GW#") == b"AT1PT1P" + said + b"LPT1"


@pytest.mark.parametrize("tells_altaz", [False, True])
@pytest.mark.parametrize("model", ["autostar", "lx200gps"])
async def test_tracking_off_and_on_keeps_a_meade_in_polar_alignment(model: str, tells_altaz: bool) -> None:
    """Asked for its mode in between, as INDIGO does: :AA# would end the polar alignment."""
    bridge = Bridge(model, driven="lx200", presented="nexstar", surface="6-8se", latency=0.02)
    bridge.sim.land_tells_altaz = tells_altaz
    bridge.sim.feed(b":AP#")
    async with bridge:
        client = bridge.client()
        assert await client.ask(b"t") == b"\x02#"
        assert await client.ask(b"T\0") == b"#"
        await asyncio.sleep(8.0)
        assert await client.ask(b"t") == b"\0#"
        assert await client.ask(b"J") == b"\1#"
        await asyncio.sleep(8.0)
        assert await client.ask(b"t") == b"\0#"
        assert bridge.driver.equatorial
        assert await client.ask(b"T\2") == b"#"
        await asyncio.sleep(2.0)
        assert bridge.sim.mode_letter == "P" and b":AA#" not in bridge.sent_requests()
        assert await client.ask(b"t") == b"\x02#"


@pytest.mark.parametrize("tells_altaz", [False, True])
async def test_gateway_notices_a_meade_switched_to_alt_az_at_its_keypad(tells_altaz: bool) -> None:
    """At its keys, tracking off before and afterwards: the alignment mode tells that the A is meant."""
    bridge = Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se", latency=0.02)
    bridge.sim.land_tells_altaz = tells_altaz
    bridge.sim.feed(b":AP#")
    async with bridge:
        client = bridge.client()
        assert await client.ask(b"T\0") == b"#"
        bridge.sim.feed(b":AA#")
        bridge.sim.track(False)
        await asyncio.sleep(8.0)
        assert await client.ask(b"t") == b"\0#"
        assert not bridge.driver.equatorial


async def test_goto_on_a_sleeping_meade_is_refused_with_a_text() -> None:
    """It would say yes to the goto and stay where it is."""
    async with Bridge("lx200gps", driven="lx200", presented="lx200", surface=None, latency=0.02) as bridge:
        client = bridge.client()
        assert await client.ask(overhead(bridge.sim), ending=b"11") == b"11"
        client.send(b":hN#")
        await asyncio.sleep(2.0)
        assert await client.ask(b":MS#") == b"1The mount is asleep: wake it first.#"
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2.0)
        assert not bridge.controller.moving and not {b":MS#", b":Mn#"} & set(bridge.sent_requests())
        client.send(b":hW#")
        await asyncio.sleep(1.0)
        assert await client.ask(b":MS#") == b"0"
        await asyncio.sleep(1.0)
        assert bridge.sim.slewing


async def test_meade_woken_at_its_keys_moves_again() -> None:
    async with Bridge("lx200gps", driven="lx200", presented="lx200", surface=None, latency=0.02) as bridge:
        client = bridge.client()
        assert await client.ask(overhead(bridge.sim), ending=b"11") == b"11"
        client.send(b":hN#")
        await asyncio.sleep(2.0)
        bridge.sim.feed(b":hW#")
        await asyncio.sleep(8.0)
        assert await client.ask(b":GW#") == b"AT1"
        assert await client.ask(b":MS#") == b"0"
