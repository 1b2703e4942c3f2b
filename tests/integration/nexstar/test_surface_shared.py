"""Several programs at one mount, through the NexStar surface; a lost line; and a Meade behind it."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.nexstar_flows import ARCSECOND, off, on_a_bridge, place, polled, precise, settled, up
from tests.support.two_gateways import TwoGateways


def near(told: bytes, direct: bytes, ticks: bool) -> bool:
    """Whether two answers are the same; coarse ones may differ by a tick, for ours is rounded from the precise one."""
    if not ticks or len(told) != len(direct):
        return told == direct
    pairs = zip(told.rstrip(b"#").split(b","), direct.rstrip(b"#").split(b","), strict=True)
    return all(abs(int(one, 16) - int(other, 16)) <= 1 for one, other in pairs)


# --- several programs, one mount --------------------------------------------------------------------------------------


@on_a_bridge()
async def test_two_nexstar_programs_each_get_their_replies_whole_and_in_order(bridge: Bridge) -> None:
    """Each gets its own replies, whole and in order, while the other cuts its commands to pieces."""
    one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")

    async def poll(client: RehearsalClient, mark: bytes) -> None:
        for _ in range(40):
            assert await client.ask(b"K" + mark) == mark + b"#"
            assert len(place(await client.ask(b"e", ending=b"#"))) == 2
            client.received = b""
            for byte in b"P\1\x10\xfe\0\0\0\2":
                client.send(bytes((byte,)))
                await asyncio.sleep(0.02)
            assert client.received == b"\x06\x0b#"
            assert await client.ask(b"L") in (b"0#", b"1#")

    async def slew() -> None:
        third = bridge.client("10.0.0.3")
        for east in (20.0, -20.0, 40.0):
            assert await third.ask(precise(b"r", *up(bridge, east))) == b"#"
            await asyncio.sleep(3)

    await asyncio.gather(poll(one, b"#"), poll(other, b"L"), slew())


@on_a_bridge()
async def test_newer_goto_of_two_programs_replaces_the_older(bridge: Bridge) -> None:
    one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
    await asyncio.gather(polled(one), polled(other))
    ra, dec = up(bridge, 50.0)
    await one.ask(precise(b"r", ra, dec))
    await asyncio.sleep(1)
    assert await other.ask(b"L") == b"1#"
    ra, dec = up(bridge, -30.0)
    await other.ask(precise(b"r", ra, dec))
    await asyncio.sleep(3)
    await settled(one)
    assert off(bridge, ra, dec) < ARCSECOND


def test_nexstar_goto_stays_in_progress_when_another_goto_follows() -> None:
    @on_a_bridge()
    async def twice(bridge: Bridge) -> None:
        client = bridge.client()
        await polled(client)
        await client.ask(precise(b"r", *up(bridge, 50.0)))
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"1#"
        ra, dec = up(bridge, -30.0)
        await client.ask(precise(b"r", ra, dec))
        await settled(client)
        assert off(bridge, ra, dec) < ARCSECOND

    twice()


@pytest.mark.parametrize("mount", ["6-8se", "cge", "cgem", "cpc"])
@pytest.mark.parametrize("site", [(45.0, 10.0), (-34.0, 18.5)])
def test_shared_nexstar_port_repeats_the_mounts_replies_bit_for_bit(mount: str, site: tuple[float, float]) -> None:
    """While nothing moves, what the surface says is what the hand control itself would say."""

    @on_a_bridge(mount=mount, surface=mount, site=site)
    async def shared(bridge: Bridge) -> None:
        client, direct = bridge.client(), bridge.sim.connection()
        await polled(client)
        for east in (-15.0, 40.0):
            await client.ask(precise(b"r", *up(bridge, east)))
            await settled(client)
            await asyncio.sleep(3)
            for command in (b"e", b"E", b"p"):  # tracking holds these still
                if mount in ("cge", "cgem") or command != b"p":
                    assert near(await client.ask(command), direct(command), ticks=command == b"E")
            await client.ask(b"T\0")
            await asyncio.sleep(2)
            for command in (b"z", b"Z", b"P\1\x10\1\0\0\0\3", b"P\1\x11\1\0\0\0\3"):
                assert await client.ask(command) == direct(command)
            for command in (b"J", b"t", b"L", b"m", b"v", b"w"):
                assert await client.ask(command) == direct(command)
            await client.ask(b"T\1" if mount in ("6-8se", "cpc") else b"T\2" if site[0] > 0 else b"T\3")

    shared()


# --- the line goes down -----------------------------------------------------------------------------------------------


@on_a_bridge()
async def test_nexstar_position_is_repeated_for_ten_seconds_after_a_lost_line(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    last = await client.ask(b"e")
    bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
    began, told = asyncio.get_running_loop().time(), []
    while (since := asyncio.get_running_loop().time() - began) < 60:
        told.append((since, await client.ask(b"e", 5.0)))
        await asyncio.sleep(0.5)
    assert {reply for _, reply in told} == {last, b""}
    assert max(since for since, reply in told if reply) < 16, "a lost line is noticed after a few seconds"
    assert await client.ask(b"Kz", 20.0, ending=b"z#") == b"z#"


# --- a Meade behind it, which is another gateway's surface -----------------------------------------------------------


async def test_meade_presented_as_a_german_mount_answers_the_pier_side() -> None:
    """Asked at every poll: a silence would cost the program seconds each time."""
    async with TwoGateways(Bridge("cge"), "lx200", "nexstar", "cge") as chain:
        client = chain.client()
        assert await client.ask(b"p", 2.0) == b"E#"
        assert len(await client.ask(b"z", 2.0)) == 18
