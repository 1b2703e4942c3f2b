"""What status, log and replies say fits what the mount does and who has done it."""

from __future__ import annotations

import asyncio

import pytest

from gateway.app.mount_state import mount_state
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.explain import explain
from tests.support.in_process_gateway import Bridge

OPEN = {"lowest": -90.0, "sun": 0.0}


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "cge"), ("lx200", "lx200gps"), ("alpaca", "german")])
@pytest.mark.parametrize("stop", ["another program", "mount-gateway stop", "M", "an arrow"])
async def test_log_names_who_ended_a_goto(driven: str, model: str, stop: str) -> None:
    presented, surface = ("nexstar", "cge") if stop == "M" else ("lx200", "autostar")
    async with Bridge(model, driven=driven, presented=presented, surface=surface, config=OPEN) as bridge:
        ra, dec = bridge.sim.true_position()
        await bridge.controller.perform(op.Goto(ra - 60.0, min(dec, 40.0)))
        await asyncio.sleep(2.0)
        who = "10.0.0.7"
        if stop == "another program":
            bridge.client(who).send(b":Q#")
        elif stop == "an arrow":
            who = stop
            bridge.client().send(b":RC#:Mn#")
            await asyncio.sleep(4.0)
            bridge.client().send(b":Qn#")
        elif stop == "M":
            await bridge.client(who).ask(b"M")
        else:
            who = stop
            await bridge.controller.stop(who)
        await asyncio.sleep(3.0)
        told = [entry.note for entry in bridge.entries if "goto was stopped" in entry.note]
        assert len(told) == 1 and who in told[0]
        assert any(told[0] in line for line in mount_state(bridge.controller).to_state().lately)


@pytest.mark.parametrize(("driven", "model"), [("lx200", "onstep"), ("lx200", "teenastro"), ("nexstar", "cge")])
async def test_parked_mount_answers_the_home_query_as_at_home(driven: str, model: str) -> None:
    async with Bridge(model, driven=driven, config=OPEN, speed=10.0) as bridge:
        await bridge.controller.perform(op.Goto(bridge.sim.true_position()[0] - 30.0, 40.0))
        await asyncio.sleep(30.0)
        await bridge.controller.perform(op.Park())
        assert await bridge.controller.answer(op.HomeState()) == 2
        await asyncio.sleep(60.0)
        assert await bridge.controller.answer(op.HomeState()) == 1


@pytest.mark.parametrize(("model", "version"), [("gt", "101.0"), ("nexstar-gps", "1.2")])
async def test_gps_sentence_without_a_site_has_no_position(model: str, version: str) -> None:
    bridge = Bridge(model, version, surface="lx200gps", config=OPEN)
    bridge.sim.facts = {**bridge.sim.facts, "has": []}
    async with bridge:
        told = await bridge.client().ask(b":gps#", ending=b"#")
        assert told.startswith(b"$GPRMC,") and b",V,,,,," in told


async def test_site_keeps_its_seconds_on_a_mount_that_stores_minutes() -> None:
    bridge = Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge", config=OPEN)
    async with bridge:
        client, place = bridge.client(), bytes((33, 51, 35, 1, 151, 12, 40, 0))
        assert await client.ask(b"W" + place) == b"#"
        for _ in range(20):  # it is read again after some minutes
            await asyncio.sleep(20.0)
            assert await client.ask(b"w") == place + b"#"


@pytest.mark.parametrize(("driven", "model"), [("lx200", "lx200gps"), ("alpaca", "polar")])
async def test_repeated_unavailable_axis_rate_is_logged_once(driven: str, model: str) -> None:
    """A satellite tracker sends another rate five times a second."""
    bridge = Bridge(model, driven=driven, presented="nexstar", surface="cge", config=OPEN)
    async with bridge:
        client = bridge.client()
        for number in range(350):
            rate = 3000 + 17 * number
            client.send(b"P\3\x11\6" + bytes((rate >> 8, rate & 255, 0, 0)))
            await asyncio.sleep(0.2)
        client.send(b"P\2\x11\x24\0\0\0\0")
        said = [entry.note for entry in bridge.entries if "no nearer speed" in entry.note]
        assert len(said) == 1


def test_explain_names_the_mount_and_omits_steps_that_it_does_not_need() -> None:
    assert "on an onstep mount" in explain("lx200", "lx200:onstep", ":GR#").text
    told = explain("lx200", "alpaca:german", ":MA#").text
    assert "tracking is turned off before" not in told


async def test_refusals_that_differ_only_in_numbers_are_logged_once() -> None:
    async with Bridge(surface="lx200gps", config=OPEN) as bridge:
        client = bridge.client()
        for rate in range(30, 60):
            client.send(f":RA{rate}.5#".encode())
            await asyncio.sleep(0.1)
        client.send(b":RE99.9#")
        await asyncio.sleep(1.0)
        assert [entry.note[:5] for entry in bridge.entries if "refused" in entry.note] == ["`:RA3", "`:RE9"]
        assert "59.5" in mount_state(bridge.controller).to_state().lately[-2]
