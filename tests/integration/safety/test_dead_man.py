"""The dead man's switch: fast motion ends when whoever began it falls silent, and nothing else does."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge, RehearsalClient

HOST = "10.0.0.1"


async def moves_for(bridge: Any, seconds: float) -> float:
    """For how long the motion by hand goes on, seconds; at most so many."""
    began = bridge.controller.now()
    await asyncio.sleep(1)
    assert bridge.controller.wanted.axes_moved_by_hand
    while bridge.controller.wanted.axes_moved_by_hand and bridge.controller.now() - began < seconds:
        await asyncio.sleep(0.1)
    return float(bridge.controller.now() - began)


@pytest.mark.parametrize(("config", "after"), [({}, 30.0), ({"dead_man": 12.0}, 12.0)])
@pytest.mark.safety_line(6)
async def test_silence_on_an_open_connection_ends_the_arrow(config: dict[str, Any], after: float) -> None:
    async with Bridge("6-8se", config=config) as bridge:
        bridge.client(HOST).send(b":RC#:Mw#")
        assert after - 1 <= await moves_for(bridge, 60) <= after + 2
        assert b"P\x02\x10\x24\x00\x00\x00\x00" in bridge.sent_requests()
        said = [entry.note for entry in bridge.entries if entry.arrow == "!"]
        assert said == [f"{HOST} has sent nothing for {after:g} s: its motion is stopped"]
        await asyncio.sleep(3)
        assert bridge.sim.tracking


async def test_arrow_of_a_silent_nexstar_program_ends_on_a_meade() -> None:
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se") as bridge:
        bridge.client(HOST).send(b"P\x02\x10\x24\x04\x00\x00\x00")
        assert 29 <= await moves_for(bridge, 60) <= 32
        assert b":Qw#" in bridge.sent_requests()


@pytest.mark.parametrize(("config", "after"), [({}, 5.0), ({"dead_man_closed": 2.0}, 2.0)])
async def test_arrow_ends_a_few_seconds_after_its_connection_closed(config: dict[str, Any], after: float) -> None:
    async with Bridge("6-8se", config=config) as bridge:
        client = bridge.client(HOST)
        client.send(b":RC#:Mw#")
        client.close()
        assert after - 0.5 <= await moves_for(bridge, 60) <= after + 2
        assert any(entry.note.startswith(f"{HOST} has disconnected") for entry in bridge.entries)


async def test_program_with_one_connection_per_command_keeps_its_motion() -> None:
    async with Bridge("6-8se") as bridge:
        for turn in range(20):
            client = bridge.client(HOST)
            client.send(b":RC#:Mw#" if not turn else b":GR#")
            await asyncio.sleep(0.3)
            client.close()
            await asyncio.sleep(3.5)
            assert bridge.controller.wanted.axes_moved_by_hand == {1}, turn
        assert 1.0 <= await moves_for(bridge, 60) <= 4.0


@pytest.mark.parametrize("who", ["the same connection", "another of its host", "another host"])
async def test_arrow_is_kept_alive_only_by_the_connection_that_began_it(who: str) -> None:
    """A joystick and a planetarium that polls run on one laptop: one of them does not hold the other's arrow."""
    async with Bridge("6-8se") as bridge:
        first = bridge.client(HOST)
        second = bridge.client("10.0.0.2" if who == "another host" else HOST)
        first.send(b":RC#:Mw#")
        for _ in range(240):  # what is answered from what is remembered is life all the same
            (first if who == "the same connection" else second).send(b":GR#")
            await asyncio.sleep(0.25)
        assert bool(bridge.controller.wanted.axes_moved_by_hand) is (who == "the same connection")


async def test_older_connection_does_not_keep_alive_the_arrow_of_a_crashed_program() -> None:
    """The program that moves the mount crashes; another one on the same computer goes on polling."""
    async with Bridge("6-8se") as bridge:
        other, mover = bridge.client(HOST), bridge.client(HOST)
        mover.send(b":RS#:Me#")
        await asyncio.sleep(1.0)
        mover.close()
        for _ in range(14):
            other.send(b":GR#")
            await asyncio.sleep(0.5)
        assert not bridge.controller.wanted.axes_moved_by_hand
        assert any(entry.note.startswith(f"{HOST} has disconnected") for entry in bridge.entries)


def test_slow_rates_continue_when_their_program_falls_silent() -> None:
    async def program(asked: bytes) -> set[int]:
        async with Bridge("cge", presented="nexstar", surface="cge") as bridge:
            bridge.client(HOST).send(asked)
            await asyncio.sleep(90)
            return set(bridge.controller.wanted.axes_moved_by_hand)

    assert run(program(b"P\x03\x10\x06\x00\xf0\x00\x00")) == {1}  # 60" a second
    assert run(program(b"P\x03\x10\x06\x01\x00\x00\x00")) == set()  # 64" a second


@pytest.mark.safety_line(6)
async def test_gotos_and_guide_pulses_continue_when_their_program_falls_silent() -> None:
    async with Bridge("6-8se", speed=0.1) as bridge:
        client = bridge.client(HOST)
        assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", ending=b"110") == b"110"
        client.close()
        await asyncio.sleep(40)
        assert bridge.sim.slewing


async def test_focuser_stops_when_its_program_falls_silent() -> None:
    async with Bridge("autostar", driven="lx200") as bridge:
        client: RehearsalClient = bridge.client(HOST)
        client.send(b":F+#")
        await asyncio.sleep(1)
        assert b":FQ#" not in bridge.sent_requests()
        client.close()
        await asyncio.sleep(7)
        assert bridge.sent_requests().count(b":FQ#") == 2  # it acknowledges nothing


async def test_arrow_stopped_by_its_program_is_not_stopped_again() -> None:
    async with Bridge("6-8se") as bridge:
        client = bridge.client(HOST)
        client.send(b":RC#:Mw#:Mn#")
        await asyncio.sleep(2)
        client.send(b":Qw#")
        await asyncio.sleep(1)
        client.send(b":Q#")
        await asyncio.sleep(40)
        assert not [entry for entry in bridge.entries if "silent" in entry.note]
