"""One answer lost at the worst moment: motion ends all the same, tracking comes back, the gateway goes on."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.cable import swallow
from tests.support.in_process_gateway import Bridge

RATE_0 = b"P\x02\x10\x24\x00\x00\x00\x00"


@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "cge"), ("lx200", "autostar"), ("lx200", "onstep")])
async def test_stop_reaches_a_mount_whose_answers_are_all_lost(driven: str, mount: str) -> None:
    """One wire is broken, or a bridge swallows what the mount says: a stop must not wait until that is mended."""
    async with Bridge(mount, driven=driven, latency=0.05, config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        client.send(b":RS#:Me#")
        await asyncio.sleep(1)
        swallow(bridge, lambda data: True, times=1_000_000, carried_out=True)
        await asyncio.sleep(3)
        client.send(b":Q#")
        await asyncio.sleep(8)
        still = bridge.sim.true_position()
        await asyncio.sleep(5)
        assert bridge.sim.true_position() == pytest.approx(still, abs=0.05)


async def test_guide_pulse_ends_though_an_answer_was_lost() -> None:
    async with Bridge("cge", "3.02", latency=0.05) as bridge:
        swallow(bridge, lambda data: data == RATE_0)
        bridge.client().send(b":Mgw1000#")
        await asyncio.sleep(10)
        still = bridge.sim.true_position()
        await asyncio.sleep(10)
        assert bridge.sim.true_position() == pytest.approx(still, abs=1e-3)


@pytest.mark.parametrize("gap", [0.0, 0.05, 0.1, 0.15, 0.2, 0.3])
async def test_stop_shortly_after_an_arrow_keeps_tracking(gap: float) -> None:
    async with Bridge("cge", latency=0.1) as bridge:
        client, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        client.send(b":RS#:Mn#")
        for _ in range(10):
            other.send(b":GR#:GD#:D#:GW#")
            await asyncio.sleep(0.1)
        client.send(b":Qn#")
        await asyncio.sleep(gap)
        client.send(b":Q#")
        await asyncio.sleep(5)
        assert bridge.sim.tracking
        assert await client.ask(b":GW#") == b"PT1"


async def test_tracking_returns_though_its_command_was_lost() -> None:
    async with Bridge("cge", latency=0.05) as bridge:
        client = bridge.client()
        client.send(b":RM#:Mn#")
        await asyncio.sleep(1)
        swallow(bridge, lambda data: data == b"T\x02")
        client.send(b":Qn#")
        await asyncio.sleep(20)
        assert bridge.sim.tracking


async def test_mount_is_identified_despite_one_lost_answer() -> None:
    bridge = Bridge()
    swallow(bridge, lambda data: data == b"V")
    bridge.controller.start()
    await asyncio.sleep(20)
    assert len(await bridge.client().ask(b":GR#")) == 9
    await bridge.controller.close()


async def test_motion_behind_a_stop_in_one_packet_is_carried_out() -> None:
    async with Bridge(latency=0.1) as bridge:
        client = bridge.client()
        reply = await client.ask(b"#:Q#:Sr07:00:00#:Sd+30*00:00#:MS#", ending=b"110")
        assert reply == b"110"
        await asyncio.sleep(2)
        assert bridge.sim.slewing
        client.send(b":Q#:RM#:Mn#")
        before = bridge.sim.true_position()
        await asyncio.sleep(3)
        assert bridge.sim.true_position()[1] != pytest.approx(before[1], abs=0.5)


@pytest.mark.parametrize("gap", [0.0, 0.1, 0.2, 0.3, 0.4, 0.6])
async def test_stop_of_a_goto_reaches_a_meade_at_any_moment(gap: float) -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="6-8se", latency=0.1) as bridge:
        client = bridge.client()
        assert await client.ask(b"r60000000,20000000") == b"#"
        await asyncio.sleep(gap)
        assert await client.ask(b"M") == b"#"
        await asyncio.sleep(3)
        assert not bridge.sim.slewing
        assert await client.ask(b"L") == b"0#"


@pytest.mark.parametrize("tenths", range(0, 30, 2))
async def test_goto_after_a_park_ends_in_tracking(tenths: int) -> None:
    async with Bridge("cge", latency=0.1, speed=20.0) as bridge:
        client = bridge.client()
        client.send(b":hP#")
        await asyncio.sleep(1.0 + tenths / 10)
        reply = await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", ending=b"110")
        assert reply == b"110"
        while await client.ask(b":D#") == b"\x7f#":
            await asyncio.sleep(0.5)
        await asyncio.sleep(3)
        assert bridge.sim.tracking


async def test_land_mode_set_right_after_an_arrow_stays_set() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        client.send(b":RM#:Mn#")
        await asyncio.sleep(1)
        client.send(b":Qn#")
        await asyncio.sleep(0.3)
        client.send(b":AL#")
        await asyncio.sleep(5)
        assert not bridge.sim.tracking
        client.send(b":AP#")
        await asyncio.sleep(1)
        client.send(b":AL#:Q#")
        await asyncio.sleep(3)
        assert not bridge.sim.tracking


async def test_lx200_program_can_set_date_and_time_a_second_time() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        await client.ask(b":SG+00#:SL05:00:00#:SC01/10/26#", ending=b" #")
        assert await client.ask(b":GC#") == b"01/10/26#"
        await client.ask(b":SG+00#:SL22:00:00#:SC01/15/26#", ending=b" #")
        await asyncio.sleep(1)
        assert await client.ask(b":GC#") == b"01/15/26#"


GOTO = b":Sr05:00:00#:Sd+30*00:00#:MS#"


@pytest.mark.parametrize("mount", ["lx200", "lx200-16", "autostar", "lx200gps"])
@pytest.mark.parametrize("end", [b":Qe#", b":Q#"])
async def test_goto_with_a_lost_acknowledgement_is_noticed_and_can_be_ended(mount: str, end: bytes) -> None:
    """Nobody polls ``:D#``: the gateway looks itself."""
    async with Bridge(mount, driven="lx200") as bridge:
        client = bridge.client()
        swallow(bridge, lambda data: data == b":MS#", carried_out=True)
        assert await client.ask(GOTO, 5.0, ending=b"0") == b"11", "it has begun, and nobody knows that in time"
        assert bridge.sim.slewing
        assert bridge.controller.slewing
        assert bridge.sent_requests().count(b":MS#") == 1
        client.send(end)
        await asyncio.sleep(2.0)
        assert not bridge.sim.slewing
        await asyncio.sleep(3.0)
        assert not bridge.controller.slewing


@pytest.mark.parametrize("mount", ["lx200", "autostar", "lx200gps"])
async def test_goto_that_the_mount_did_not_hear_is_reported_as_failed(mount: str) -> None:
    async with Bridge(mount, driven="lx200") as bridge:
        client = bridge.client()
        swallow(bridge, lambda data: data == b":MS#")
        assert await client.ask(GOTO, ending=b".#") == b"11"
        assert [entry.note for entry in bridge.entries if entry.note.startswith("Goto: ")]
        assert not bridge.sim.slewing
        assert await client.ask(b":D#", ending=b"#") == b"#"
        assert await client.ask(GOTO, ending=b"0") == b"110"
        assert bridge.sim.slewing


@pytest.mark.parametrize("mount", ["lx200", "autostar", "lx200gps"])
def test_goto_on_a_silent_line_is_checked_when_the_line_is_back(mount: str) -> None:
    async def program() -> None:
        async with Bridge(mount, driven="lx200", speed=0.4) as bridge:
            client = bridge.client()
            wire = bridge.controller.line.wire
            good = wire.feed  # type: ignore[attr-defined]
            silent = [False]

            def feed(data: bytes) -> bytes:
                silent[0] = silent[0] or data == b":MS#"
                answer = bytes(good(data))
                return b"" if silent[0] else answer

            wire.feed = feed  # type: ignore[attr-defined]
            assert await client.ask(GOTO, 8.0, ending=b".#") == b"11"
            wire.feed = good  # type: ignore[attr-defined]
            await asyncio.sleep(8.0)
            assert bridge.sim.slewing
            assert bridge.controller.slewing, "it goes on, and the gateway knows"
            client.send(b":Qe#")
            await asyncio.sleep(3.0)
            assert not bridge.sim.slewing

    run(program())
