"""A goto that comes while a telescope calculates: it waits a while, the newest one only, and a stop ends it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

DATE = b":SG+00#:SL22:10:00#:SC01/15/26#"
GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
OTHER = b":Sr04:00:00#:Sd+10*00:00#:MS#"
CLASSICS = ["lx200", "lx200-16"]


def bridge_to(mount: str) -> Bridge:
    return Bridge(mount, driven="lx200", surface="lx200", config={"lowest": -90.0, "sun": 0.0})


async def calculates(bridge: Any, gap: float) -> None:
    await bridge.client("10.0.0.2").ask(DATE)
    await asyncio.sleep(gap)


def arrived(bridge: Any) -> bool:
    """By the telescope's own account: the clock that it was told is not that of the sky."""
    return not truth_of(bridge.sim).moving and separation(*bridge.sim.position(), 120.0, 30.0) < 0.02


def motions(bridge: Any) -> list[bytes]:
    return [one for one in bridge.sent_requests() if one[:2] in (b":M", b":m")]


@pytest.mark.parametrize("mount", CLASSICS)
@pytest.mark.parametrize("gap", [2.8, 3.0, 4.0, 5.0])
async def test_goto_waits_for_a_classic_to_calculate_its_planets(mount: str, gap: float) -> None:
    async with bridge_to(mount) as bridge:
        await calculates(bridge, gap)
        client = bridge.client()
        assert await client.ask(GOTO, 20.0, ending=b"0") == b"110"
        assert await bridge.client().ask(b":D#", ending=b"#") != b"#"
        await asyncio.sleep(90.0)
        assert arrived(bridge)


@pytest.mark.parametrize("mount", CLASSICS)
@pytest.mark.parametrize("gap", [0.0, 0.05, 0.3, 1.0, 2.0])
async def test_waiting_goto_is_refused_before_its_program_times_out(mount: str, gap: float) -> None:
    """Programs wait for three to five seconds; what is begun after that would be begun without their knowing."""
    async with bridge_to(mount) as bridge:
        await calculates(bridge, gap)
        client = bridge.client()
        told = b"112The mount is taking a new clock. Try again in 10 seconds.#"
        assert await client.ask(GOTO, 3.5, ending=b".#") == told
        await asyncio.sleep(60.0)
        assert motions(bridge) == []
        assert client.received == told


async def test_newer_of_two_waiting_gotos_is_carried_out() -> None:
    async with bridge_to("lx200") as bridge:
        await calculates(bridge, 2.6)
        older, newer = bridge.client(), bridge.client("10.0.0.3")
        older.send(OTHER)
        await asyncio.sleep(0.5)
        assert await newer.ask(GOTO, 20.0, ending=b"0") == b"110"
        assert older.received == b"111Stopped.#"
        assert motions(bridge) == [b":MS#"]
        await asyncio.sleep(90.0)
        assert arrived(bridge)


async def test_goto_is_refused_when_the_telescope_stays_busy() -> None:
    async with bridge_to("lx200gps") as bridge:
        bridge.client("10.0.0.2").send(b":gT#")
        await asyncio.sleep(2.0)
        client, began = bridge.client(), bridge.clock()
        assert await client.ask(GOTO, 30.0, ending=b".#") == b"112The mount is busy.#"
        assert 2.9 < bridge.clock() - began < 3.5
        await asyncio.sleep(90.0)
        assert motions(bridge) == []


@pytest.mark.parametrize("how", [b":Q#", b":Qe#", b"", None])
async def test_stop_or_disconnection_cancels_a_waiting_goto(how: bytes | None) -> None:
    async with bridge_to("lx200") as bridge:
        await calculates(bridge, 1.5)
        client = bridge.client()
        client.send(GOTO)
        await asyncio.sleep(0.5)
        if how:
            bridge.client("10.0.0.4").send(how)
            await asyncio.sleep(0.5)
            assert client.received == b"111Stopped.#"
        elif how is None:
            client.connection.peer_closed()
        else:
            client.close()
        await asyncio.sleep(60.0)
        assert motions(bridge) == []
        assert not truth_of(bridge.sim).moving


async def test_arrow_pressed_while_the_telescope_is_busy_is_not_carried_out_later() -> None:
    async with bridge_to("lx200") as bridge:
        await calculates(bridge, 1.5)
        bridge.client().send(b":RM#:Me#")
        await asyncio.sleep(60.0)
        assert motions(bridge) == []


@pytest.mark.parametrize("gap", [0.1, 1.5, 3.0])
async def test_drive_rate_set_while_the_telescope_is_busy_applies_afterwards(gap: float) -> None:
    async with bridge_to("lx200") as bridge:
        await calculates(bridge, gap)
        client = bridge.client()
        client.send(b":TL#")
        await asyncio.sleep(20.0)
        assert bridge.sim.stored_values["hertz"] == 57.9
        assert await client.ask(b":GT#") == b"57.9#"
