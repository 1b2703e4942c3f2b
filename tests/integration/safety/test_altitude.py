"""Altitude limits: on every kind of goto, during every motion, and against tracking that carries the tube beyond."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.looks import altitude, at_rest, extremes, notes

ARCSECOND = 1.0 / 3600.0
LIMITS = {"lowest": 20.0, "highest": 80.0}


@pytest.mark.parametrize("latency", [0.02, 0.2])
@pytest.mark.parametrize(("arrow", "rate"), [(b":Ms#", b":RS#"), (b":Mn#", b":RS#"), (b":Ms#", b":RM#")])
@pytest.mark.safety_line(3)
async def test_lx200_motion_by_hand_never_crosses_a_limit(latency: float, arrow: bytes, rate: bytes) -> None:
    async with Bridge("6-8se", config=LIMITS, latency=latency) as bridge:
        client = bridge.client()
        client.send(rate + arrow)
        for _ in range(60):  # a program shows life while it holds an arrow
            client.send(b":GR#")
            low, high = await extremes(bridge, 0.5)
            assert 20.0 - ARCSECOND <= low <= high <= 80.0
        assert not bridge.controller.moving
        near = low - 20.0 if arrow == b":Ms#" else 80.0 - high
        assert near < (6.0 if rate == b":RS#" else 2.0), near


@pytest.mark.parametrize(("lowest", "latency"), [(41.6, 0.05), (36.0, 0.2), (44.4, 0.2), (37.4, 0.35)])
async def test_mount_stops_at_a_limit_reached_before_its_rate_is_measured(lowest: float, latency: float) -> None:
    async with Bridge("6-8se", config={"lowest": lowest}, latency=latency) as bridge:
        bridge.client().send(b":RS#:Ms#")  # five degrees a second, from 45
        low, _ = await extremes(bridge, 8)
        assert lowest <= low


async def test_coasting_past_an_altitude_limit_triggers_no_stop() -> None:
    async with Bridge("6-8se", config={"lowest": 44.0}) as bridge:
        guard = bridge.controller.watch
        here = await bridge.controller.answer(op.Position())
        await asyncio.sleep(4)  # nobody polls any more: the looks are this test's own
        guard.check_position(here)
        await asyncio.sleep(0.3)
        guard.on_motion_end()
        guard.check_position(op.Equatorial(here.ra, here.dec - 1.5))
        await asyncio.sleep(0.5)
        assert notes(bridge) == []
        await asyncio.sleep(1.0)
        guard.check_position(op.Equatorial(here.ra, here.dec - 2.5))
        await asyncio.sleep(0.5)
        assert ["altitude limit (42.5" in note for note in notes(bridge)] == [True]


@pytest.mark.parametrize(("latency", "opcode"), [(0.02, 37), (0.2, 37), (0.2, 36)])
async def test_nexstar_motion_by_hand_never_crosses_a_limit(latency: float, opcode: int) -> None:
    async with Bridge(
        "autostar", driven="lx200", presented="nexstar", surface="6-8se", config=LIMITS, latency=latency
    ) as bridge:
        client = bridge.client()
        assert await client.ask(bytes((80, 2, 17, opcode, 9, 0, 0, 0))) == b"#"
        low, high = await extremes(bridge, 25)
        assert 20.0 <= low <= high <= 80.0
        assert not bridge.controller.moving


def test_moving_mount_is_read_twice_a_second_on_a_slow_busy_line() -> None:
    async def program(mount: str, driven: str) -> None:
        async with Bridge(mount, driven=driven, latency=0.2 if driven == "nexstar" else 0.15) as bridge:
            client = bridge.client()
            looks: list[float] = []
            bridge.controller.reader.position_read.connect(lambda _: looks.append(bridge.controller.now()))
            client.send(b":RC#:Mw#")
            for _ in range(80):
                client.send(b":GR#:GD#:GZ#:GA#:D#:GW#")
                await asyncio.sleep(0.25)
            gaps = [after - before for before, after in pairwise(looks[3:])]
            assert len(gaps) >= 36
            assert sorted(gaps)[len(gaps) * 9 // 10] <= 0.5 + 0.1
            assert sum(gaps) / len(gaps) <= 0.5

    run(program("6-8se", "nexstar"))
    run(program("autostar", "lx200"))


async def test_altitude_limit_set_by_a_client_applies_only_to_its_own_motion() -> None:
    async with Bridge("6-8se", config={"lowest": 10.0}) as bridge:
        careful, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        assert await careful.ask(b":So30#") == b"1"
        careful.send(b":RM#:Ms#")
        low, _ = await extremes(bridge, 25)
        assert 30.0 <= low < 33.0
        other.send(b":RM#:Ms#")
        low, _ = await extremes(bridge, 25)
        assert 10.0 <= low < 13.0


async def test_arrow_up_from_below_the_altitude_limit_is_allowed() -> None:
    async with Bridge("6-8se", config={"lowest": 50.0}) as bridge:  # it stands at 45
        client = bridge.client()
        assert await client.ask(b":GA#")
        client.send(b":RM#:Ms#")
        await asyncio.sleep(3)
        assert altitude(bridge) > 44.9
        assert "Arrow: Object Below Lower Limit." in notes(bridge)
        client.send(b":Mn#")
        await asyncio.sleep(5)
        client.send(b":Qn#")
        await asyncio.sleep(1)
        assert altitude(bridge) > 47.0


def test_tracking_below_the_limit_is_switched_off() -> None:
    async def program(mount: str, driven: str) -> Bridge:
        async with Bridge(mount, driven=driven, config={"lowest": 40.0}) as bridge:
            client = bridge.client()
            # two hours west of the meridian at 40.4 degrees: it sinks ten degrees an hour
            assert await client.ask(b":Sa40*30#:Sz220*00#:MA#", ending=b"110") == b"110"
            while await client.ask(b":D#") not in (b"#", b"       #"):
                await asyncio.sleep(1)
            await asyncio.sleep(400)
            return bridge

    celestron = run(program("6-8se", "nexstar"))
    assert b"T\x00" in celestron.sent_requests()
    assert any("off at the altitude limit" in note for note in notes(celestron))
    assert celestron.sim.feed(b"t") == b"\x00#"
    meade = run(program("autostar", "lx200"))
    assert b":AL#" in meade.sent_requests()
    assert not meade.sim.tracking


async def test_mount_whose_tracking_cannot_be_switched_off_is_reported_once() -> None:
    async with Bridge("lx200", driven="lx200", config={"lowest": 40.0}) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(270.0, 40.3))
        for _ in range(1600):
            await asyncio.sleep(0.25)
            client.send(b":GR#")
        assert altitude(bridge) < 39.9
        said = [note for note in notes(bridge) if "cannot be switched off" in note]
        assert len(said) == 1
        assert bridge.sent_requests().count(b":Q#") == 1
        assert b":AL#" not in bridge.sent_requests()


@pytest.mark.safety_line(3)
def test_park_home_and_axis_gotos_are_checked_against_the_limits() -> None:
    async def program(config: dict[str, Any]) -> tuple[list[str], list[bytes]]:
        async with Bridge("6-8se", config={"lowest": 10.0, **config}) as bridge:
            client = bridge.client()
            client.send(b":hS#")
            await asyncio.sleep(1)
            client.send(b":hP#")
            low, _ = await at_rest(bridge)
            with pytest.raises(BelowHorizon):
                await bridge.controller.perform(op.GotoAxes(100.0, 5.0))
            assert low == pytest.approx(4.0 if config else 10.5, abs=0.1)
            client.send(b":hF#")
            await asyncio.sleep(30)
            assert 44.0 < altitude(bridge) < 46.0
            return notes(bridge), [sent for sent in bridge.sent_requests() if sent[:1] == b"b"]

    said, sent = run(program({}))  # not north at the horizon, which this operator does not want, but just above
    assert said == []
    assert len(sent) == 2
    said, sent = run(program({"park": (90.0, 4.0)}))  # his own decision
    assert [note.startswith("WARNING: its park position") for note in said] == [True]
    assert len(sent) == 2


async def test_axis_gotos_of_a_german_mount_are_checked_by_where_they_point() -> None:
    async with Bridge("cge", presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        assert await client.ask(b"b00000000,E0000000") == b"#"  # south, declination -45: the horizon, allowed
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"1#"
        await client.ask(b"M")
        assert await client.ask(b"b00000000,D0000000") == b"#"  # declination -67.5
        await asyncio.sleep(3)
        assert await client.ask(b"L") == b"0#"
        assert "Goto: Object Below Horizon." in notes(bridge)


async def test_goto_whose_path_leads_below_the_horizon_is_stopped() -> None:
    async with Bridge("6-8se") as bridge:
        client = bridge.client()
        assert await client.ask(b":Sa50*00#:Sz090*00#:MA#", ending=b"110") == b"110"
        now = bridge.clock()
        bridge.sim.mechanics.goto_axes(now, 90.0, -60.0)
        low, _ = await extremes(bridge, 40)
        assert -6.0 < low < 0.0
        assert not bridge.controller.moving
        assert any(note.startswith("stopped at the altitude limit") for note in notes(bridge))


@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "6-8se"), ("lx200", "autostar")])
async def test_arrow_released_above_the_limit_triggers_no_safety_stop(driven: str, mount: str) -> None:
    async with Bridge(mount, driven=driven, config={"lowest": 38.0}, latency=0.1) as bridge:
        client = bridge.client()
        for _ in range(6):
            client.send(b":GR#:RM#:Ms#")
            await asyncio.sleep(0.7)
            client.send(b":Qs#")
            await asyncio.sleep(2.5)
            client.send(b":GR#:RM#:Mn#")
            await asyncio.sleep(0.7)
            client.send(b":Qn#")
            await asyncio.sleep(2.5)
        assert [note for note in notes(bridge) if "park" not in note] == []
        assert bridge.sim.tracking
