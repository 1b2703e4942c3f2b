"""A hand control that hibernates answers `y`, `K` and `V` alone: it is left alone, and heard when it wakes."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support.cable import swallow
from tests.support.in_process_gateway import Bridge, RehearsalClient

#: What ``t`` answers.
ALTAZ = 1
#: How long a silent question holds the line: the reply's time and the proof that the line is in step.
SILENCE = 4.0


async def asleep(bridge: Bridge, client: RehearsalClient, presented: str = "nexstar") -> None:
    """Sent to sleep by the client, and old enough for the last position not to be told any more."""
    client.send(b":hN#" if presented == "lx200" else b"x")
    await asyncio.sleep(11.0)
    assert bridge.sim.asleep


@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
async def test_sleeping_mount_is_sent_only_requests_that_it_answers(presented: str) -> None:
    async with Bridge("cpc", presented=presented, surface=None) as bridge:
        client = bridge.client()
        await asleep(bridge, client, presented)
        before = len(bridge.sent_requests())
        for question in (b":GR#", b":GA#", b":D#", b":GW#") if presented == "lx200" else (b"e", b"z", b"L", b"t"):
            assert await client.ask(question, 30.0) == b""
        asked = [frame for frame in bridge.sent_requests()[before:] if frame[:1] != b"K"]
        assert set(asked) == {b"e"} and len(asked) <= 25  # somebody may have woken it by hand


async def test_goto_to_a_sleeping_mount_is_refused_at_once_with_a_reason() -> None:
    async with Bridge("cpc") as bridge:
        client = bridge.client()
        assert await client.ask(b":Sr08:00:00#") + await client.ask(b":Sd+40*00:00#") == b"11"
        await asleep(bridge, client, "lx200")
        await asyncio.sleep(25.0)
        assert b"asleep" in await client.ask(b":MS#", 60.0)
        assert await client.ask(b":MS#", 1.0) == b"1The mount is asleep.#"


@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
@pytest.mark.parametrize("late", [0.0, 1.0, 2.0, 3.0, 4.0])
async def test_program_that_wakes_the_mount_may_read_it_at_once(presented: str, late: float) -> None:
    """Even while it is being asked whether somebody has woken it."""
    async with Bridge("cpc", presented=presented, surface=None) as bridge:
        client = bridge.client()
        await asleep(bridge, client, presented)
        await asyncio.sleep(late)
        client.send(b":hW#" if presented == "lx200" else b"y")
        assert len(await client.ask(b":GR#" if presented == "lx200" else b"e", SILENCE)) > 1


@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
async def test_mount_wakes_whatever_requests_came_during_its_sleep(presented: str) -> None:
    """A stop that a sleeper does not hear is owed by nobody, and takes no later command with it."""
    async with Bridge("cpc", presented=presented, surface=None) as bridge:
        client = bridge.client()
        await asleep(bridge, client, presented)
        if presented == "lx200":
            for command in (b":Mn#", b":Q#", b":Qn#", b":hW#"):
                client.send(command)
        else:
            for command in (b"r34560000,34560000", b"P\x02\x10\x24\x05\0\0\0", b"M", b"P\x02\x10\x24\0\0\0\0", b"y"):
                client.send(command)
        await asyncio.sleep(6 * SILENCE)
        assert not bridge.sim.asleep and not bridge.controller.wanted.stop_owed
        assert await client.ask(b":GR#" if presented == "lx200" else b"e", 2.0)
        assert bridge.sim.mode == ALTAZ and (await bridge.controller.read(op.GetStatus())).tracking is op.Tracking.ALTAZ


async def test_arrow_to_a_sleeping_mount_does_not_block_a_later_wake() -> None:
    async with Bridge("cpc", presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        await asleep(bridge, client)
        client.send(b"P\x02\x11\x24\x05\0\0\0y")
        await asyncio.sleep(4 * SILENCE)
        assert not bridge.sim.asleep


def test_mount_woken_by_hand_is_recognised_as_awake() -> None:
    async def program() -> None:
        async with Bridge("cpc", presented="nexstar", surface=None) as bridge:
            client = bridge.client()
            await asleep(bridge, client)
            bridge.sim.asleep = False
            for _ in range(40):
                if await client.ask(b"e", 1.0):
                    return
            pytest.fail("not heard")

    run(program())


async def test_sleep_command_ends_every_motion() -> None:
    async with Bridge("cpc", presented="lx200") as bridge:
        client = bridge.client()
        client.send(b":RC#:Me#")
        await asyncio.sleep(3.0)
        assert bridge.controller.moving
        await asleep(bridge, client, "lx200")
        assert not bridge.controller.moving and not bridge.driver.moving
        sent = bridge.sent_requests()
        assert b"P\x02\x10\x24\0\0\0\0" in sent[: sent.index(b"x")]


async def test_gateway_started_beside_a_sleeping_mount_can_wake_it() -> None:
    bridge = Bridge("cpc", presented="lx200")
    bridge.sim.asleep = True
    bridge.controller.start()
    try:
        client = bridge.client()
        await asyncio.sleep(5.0)
        assert await client.ask(b":GR#", 5.0) == b""
        client.send(b":hW#")
        await asyncio.sleep(4 * SILENCE)
        assert not bridge.sim.asleep
        assert await client.ask(b":GR#", 2.0)
    finally:
        await bridge.controller.close()


async def test_setting_is_not_starved_by_reads_of_a_sleeping_mount() -> None:
    """Sent to sleep at its keys, where nobody tells the gateway: every question costs seconds."""
    async with Bridge("cpc", presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.Goto(100.0, 40.0))
        bridge.sim.asleep = True
        for _ in range(60):
            client.send(b"L")
            await asyncio.sleep(1.0)
        setting = asyncio.create_task(bridge.controller.perform(op.Backlash(1, 10)))
        await asyncio.sleep(60.0)
        assert setting.done() and setting.exception() is not None


async def test_sleep_command_stops_the_mount_though_its_stop_is_lost() -> None:
    async with Bridge("cpc") as bridge:
        client = bridge.client()
        client.send(b":RM#:Mn#")
        await asyncio.sleep(3.0)
        lost = swallow(bridge, lambda data: data == b"P\x02\x11\x24\0\0\0\0")
        client.send(b":hN#")
        await asyncio.sleep(15.0)
        assert lost and bridge.sim.asleep and not bridge.controller.moving
        before = bridge.sim.mechanics.axes(bridge.clock())
        await asyncio.sleep(1.0)
        assert bridge.sim.mechanics.axes(bridge.clock()) == before


async def test_mount_woken_at_its_keypad_still_stops_at_the_altitude_limit() -> None:
    async with Bridge("cpc", config={"lowest": 0.0}) as bridge:
        await asleep(bridge, bridge.client(), "lx200")
        bridge.sim.asleep = False
        bridge.sim.feed(b"P\x02\x11\x25\x08\0\0\0")  # 2 degrees a second down
        for _ in range(40):
            await asyncio.sleep(1.0)
            assert bridge.sim.mechanics.axes(bridge.clock())[1] > -2.0


async def test_mount_woken_at_its_keys_can_be_sent_to_sleep_again() -> None:
    async with Bridge("cpc") as bridge:
        client = bridge.client()
        await asleep(bridge, client, "lx200")
        bridge.sim.asleep = False
        client.send(b":hN#")
        await asyncio.sleep(2 * SILENCE)
        assert bridge.sim.asleep
        client.send(b":hN#")  # once more, though it sleeps and does not answer
        await asyncio.sleep(2 * SILENCE)
        assert not [entry.note for entry in bridge.entries if entry.note.startswith("Hibernate")]


async def test_halts_and_stops_do_not_block_the_wake_of_a_sleeping_mount() -> None:
    async with Bridge("cpc") as bridge:
        client, other = bridge.client(), bridge.client("127.0.0.2")
        await asleep(bridge, client, "lx200")
        for turn in range(60):
            other.send(b":Qn#" if turn % 2 else b":Qe#")
            if turn == 10:
                client.send(b":hW#")
            await asyncio.sleep(0.5)
        assert not bridge.sim.asleep


@pytest.mark.parametrize("from_the_start", [True, False])
async def test_starsense_can_be_woken_after_its_line_was_lost(from_the_start: bool) -> None:
    """It tells ``V`` in its sleep, but not that it is one."""
    bridge = Bridge("cpc", "starsense-1.20")
    bridge.sim.asleep = from_the_start
    bridge.controller.start()
    try:
        client = bridge.client()
        if not from_the_start:
            await bridge.controller.site_read.wait()
            await asleep(bridge, client, "lx200")
            bridge.controller.line.transaction.connection_lost("unplugged")
        await asyncio.sleep(30.0)
        client.send(b":hW#")
        await asyncio.sleep(5 * SILENCE)
        assert not bridge.sim.asleep
    finally:
        await bridge.controller.close()


async def test_mount_tracks_after_waking_though_an_arrow_was_unacknowledged() -> None:
    """The acknowledgement of an arrow was lost, so nobody knows that the mount moves with its tracking put off."""
    async with Bridge("cpc") as bridge:
        client = bridge.client()
        lost = swallow(bridge, lambda data: data[:1] == b"P" and data[3] == 0x24 and data[4] > 0, carried_out=True)
        client.send(b":RM#:Mn#")
        await asyncio.sleep(5.0)
        client.send(b":hN#")
        await asyncio.sleep(3.0)
        client.send(b":Q#")
        await asyncio.sleep(3 * SILENCE)
        client.send(b":hW#")
        await asyncio.sleep(5 * SILENCE)
        assert lost and not bridge.sim.asleep and bridge.sim.tracking
