"""Driving the four Meade families: what goes out for what a NexStar program says, bytes typed by hand."""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import wrap360
from gateway.core.errors import Busy
from gateway.core.operations import Position
from tests.support.in_process_gateway import Bridge

MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]


def meade(model: str, **settings: object) -> Bridge:
    return Bridge(model, driven="lx200", presented="nexstar", surface="6-8se", latency=0.02, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", MODELS)
async def test_driver_finds_the_meade_family_and_switches_to_high_precision_once(model: str) -> None:
    async with meade(model) as bridge:
        assert bridge.driver.model == model
        assert bridge.sent_requests()[0] == b"\x06"  # ACK before anything that begins with a colon
        assert bridge.sent_requests().count(b":U#") == (0 if model == "lx200gps" else 1)
        assert bridge.sim.high_precision
        assert len(bridge.sim.feed(b":GR#")) == 9
        assert bridge.driver.has_status == (model in ("autostar", "lx200gps"))


@pytest.mark.parametrize(
    ("said", "heard"),
    [
        (b"P\x02\x10\x24\x09\0\0\0", [b":RS#", b":RA05.0#", b":Mw#"]),
        (b"P\x02\x10\x25\x07\0\0\0", [b":RS#", b":RA01.0#", b":Me#"]),
        (b"P\x02\x11\x24\x04\0\0\0", [b":RC#", b":Mn#"]),
        (b"P\x02\x11\x25\x01\0\0\0", [b":Rg07.5#", b":RG#", b":Ms#"]),
        (b"P\x03\x10\x06\xff\xfe\0\0", [b":TS#"]),
        (b"P\x03\x10\x06\xff\xfd\0\0", [b":TL#"]),
        (b"P\x03\x10\x06\xff\xff\0\0", [b":TQ#"]),
        (b"P\x03\x11\x06\x40\x00\0\0", [b":RS#", b":RE01.1#", b":Mn#"]),  # 4096 arcseconds a second
        (b"P\x03\x10\x07\x00\x28\0\0", [b":Rg10.0#", b":RG#", b":Me#"]),
        (b"P\x03\x10\x26\x32\x1e\0\0", [b":Rg07.5#", b":Mgw0300#"]),
        (b"P\x03\x11\x26\xce\x1e\0\0", [b":Rg07.5#", b":Mgs0300#"]),
        (b"M", [b":Q#"]),  # no goto is known, and no arrow: one may have been begun at its keypad
    ],
)
async def test_lx200gps_driver_sends_the_right_bytes_for_motion(said: bytes, heard: list[bytes]) -> None:
    async with meade("lx200gps") as bridge:
        before = len(bridge.sent_requests())
        assert await bridge.client().ask(said) == b"#"
        await asyncio.sleep(0.8)
        moved = [sent for sent in bridge.sent_requests()[before:] if sent[1:2] in b"RMTQ"]
        assert moved == heard


async def test_meade_driver_releases_the_arrow_that_it_pressed() -> None:
    async with meade("autostar") as bridge:
        client = bridge.client()
        await client.ask(b"P\x02\x11\x25\x07\0\0\0")
        await asyncio.sleep(0.5)
        await client.ask(b"P\x02\x11\x24\x00\0\0\0")
        await asyncio.sleep(0.5)
        assert bridge.sent_requests().count(b":Qs#") == 2  # it acknowledges nothing
        assert b":Qn#" not in bridge.sent_requests()
        assert bridge.sim.tracking


@pytest.mark.parametrize("model", MODELS)
async def test_meade_tracking_is_not_switched_where_that_loses_the_alignment(model: str) -> None:
    async with meade(model) as bridge:
        client = bridge.client()
        assert await client.ask(b"T\x00") == b"#"
        await asyncio.sleep(0.5)
        if model in ("autostar", "lx200gps"):
            assert bridge.sent_requests().count(b":AL#") == 1
            assert await client.ask(b"t") == b"\x00#"
            assert await client.ask(b"T\x01") == b"#"
            await asyncio.sleep(0.5)
            assert bridge.sent_requests().count(b":AA#") == 1
            assert await client.ask(b"t") == b"\x01#"
        else:
            assert not [sent for sent in bridge.sent_requests() if sent[:2] == b":A"]
            assert any("keeps tracking" in entry.note for entry in bridge.entries)
        assert bridge.sim.tracking
        assert bridge.sim.aligned


@pytest.mark.parametrize("model", MODELS)
async def test_nexstar_program_sees_no_motion_after_a_refused_goto(model: str) -> None:
    async with meade(model, config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        ra = wrap360(sidereal_time(bridge.clock(), 10.0) + 180.0)
        request = b"r%06X00,%06X00" % (round(ra / 360 * 2**24), round(-40 / 360 * 2**24) % 2**24)
        assert await client.ask(request) == b"#"
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"0#"
        assert any("elow" in entry.note for entry in bridge.entries)


async def test_request_to_a_busy_meade_is_repeated_and_then_given_up() -> None:
    async with meade("lx200gps") as bridge:
        await asyncio.sleep(6)
        bridge.sim.busy_until = bridge.clock() + 1.0
        assert (await bridge.controller.answer(Position())).dec == pytest.approx(0.0, abs=0.1)
        await asyncio.sleep(6)
        bridge.sim.busy_until = bridge.clock() + 60.0
        assert (await bridge.controller.answer(Position())).dec == pytest.approx(0.0, abs=0.1)  # as it was told last
        await asyncio.sleep(6)
        with pytest.raises(Busy):
            await bridge.controller.answer(Position())


async def test_position_costs_one_pair_of_requests_however_many_programs_ask() -> None:
    async with meade("lx200gps") as bridge:
        counts = []
        for clients in (1, 20):
            visitors = [bridge.client(f"10.0.0.{n}") for n in range(clients)]
            await asyncio.sleep(5)
            before = bridge.sent_requests().count(b":GR#"), bridge.sent_requests().count(b":GD#")
            for _ in range(120):
                for visitor in visitors:
                    visitor.send(b"e")
                await asyncio.sleep(0.25)
            after = bridge.sent_requests().count(b":GR#"), bridge.sent_requests().count(b":GD#")
            counts.append((after[0] - before[0], after[1] - before[1]))
        assert counts[0][0] == pytest.approx(counts[0][1], abs=1)
        assert counts[0][0] == pytest.approx(counts[1][0], rel=0.1)
