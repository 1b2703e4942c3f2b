"""What ends a motion waits for the exchange on the wire and for nothing else, whatever another client asks for."""

from __future__ import annotations

import asyncio

import pytest

from gateway.mount.link.queue import STOP
from gateway.protocols.base.driver import Send
from tests.support.in_process_gateway import Bridge

NORTH_STOPS, EAST_STOPS = b"P\x02\x11\x24\0\0\0\0", b"P\x02\x10\x24\0\0\0\0"
EAST_MOVES = b"P\x02\x10\x25"
LATENCY = 0.1


@pytest.mark.parametrize("flood", [b":TL#", b":TQ#", b":AP#", b":RC#:Me#", b":GR#:GZ#:GW#", b":Mge0500#", b":Qe#"])
@pytest.mark.safety_line(1)
async def test_stop_is_the_next_command_that_the_mount_hears(flood: bytes) -> None:
    """Whatever waits and whatever runs, and at whatever moment of it."""
    for moment in (0.01, 0.13, 0.26, 0.37, 0.52, 0.9):
        async with Bridge("cge", latency=LATENCY) as bridge:
            noisy, quiet = bridge.client(), bridge.client()
            noisy.send(b":RM#:Mn#")
            await asyncio.sleep(2.0)
            noisy.send(flood * 20)
            await asyncio.sleep(moment)
            before = len(bridge.sent_requests())
            asked = bridge.clock()
            quiet.send(b":Q#")
            await asyncio.sleep(0.6)
            stop = [entry for entry in bridge.entries if entry.side == "mount" and entry.arrow == ">"][before]
            assert stop.data in (NORTH_STOPS, EAST_STOPS, b"M"), (moment, bridge.sent_requests()[before:])
            assert stop.time - asked <= LATENCY + 0.001


@pytest.mark.parametrize("other", [b":RC#:Me#", b":TL#:TQ#:TL#"])
async def test_stop_of_one_axis_is_sent_before_a_motion_of_the_other_axis(other: bytes) -> None:
    for moment in (0.01, 0.06, 0.13, 0.17):
        async with Bridge("cge", latency=LATENCY) as bridge:
            first, second = bridge.client(), bridge.client()
            first.send(b":RM#:Mn#")
            await asyncio.sleep(2.0)
            second.send(other)
            await asyncio.sleep(moment)
            before = len(bridge.sent_requests())
            first.send(b":Qn#")
            await asyncio.sleep(2.0)
            sent = bridge.sent_requests()[before:]
            assert sent[0] == NORTH_STOPS, (moment, sent)
            if b"Me" in other:
                assert bridge.controller.wanted.axes_moved_by_hand == {1}
                assert any(request.startswith(EAST_MOVES) for request in bridge.sent_requests())


async def test_stop_of_one_axis_right_after_a_goto_ends_both_axes() -> None:
    """It came after the goto, which the mount has not been told of yet; both axes stay where they are."""
    async with Bridge("cge", latency=LATENCY) as bridge:
        client = bridge.client()
        client.send(b":Sr07:00:00#:Sd+30*00:00#:MS#")
        await asyncio.sleep(0.02)
        bridge.client().send(b":Qe#")
        await asyncio.sleep(2.0)
        assert not any(request.startswith(b"r") for request in bridge.sent_requests()) or b"M" in bridge.sent_requests()
        assert not bridge.sim.slewing
        assert bridge.sim.tracking


async def test_repeated_stop_of_one_axis_is_queued_once() -> None:
    async with Bridge("cge", latency=LATENCY) as bridge:
        before = len(bridge.sent_requests())
        bridge.client().send(b":Qe#" * 50 + b":Qn#")
        await asyncio.sleep(1.0)
        halts = [request for request in bridge.sent_requests()[before:] if request in (EAST_STOPS, NORTH_STOPS)]
        assert halts == [EAST_STOPS, NORTH_STOPS]


async def test_stop_cuts_the_pause_of_an_old_scope_short_and_is_repeated_after_it() -> None:
    async with Bridge("lx200", driven="lx200", latency=LATENCY) as bridge:
        client = bridge.client()
        client.send(b":RM#:Mn#")
        while b":Mn#" not in bridge.sent_requests():
            await asyncio.sleep(0.001)
        asked = bridge.clock()
        client.send(b":Q#")
        await asyncio.sleep(0.5)
        stops = [entry.time - asked for entry in bridge.entries if entry.data == b":Q#" and entry.side == "mount"]
        assert stops == pytest.approx([0.0, 0.05], abs=0.002)


async def test_arrow_after_a_cancelled_stop_is_sent_once() -> None:
    """A halt that died in the queue because a stop came must not have the next arrow pressed twice."""
    async with Bridge("lx200", driven="lx200", latency=LATENCY) as bridge:
        client, other = bridge.client(), bridge.client()
        other.send(b":RC#:Me#")
        while b":Me#" not in bridge.sent_requests():
            await asyncio.sleep(0.001)
        dead = asyncio.ensure_future(bridge.controller.line.exchange(Send("Qn"), STOP))
        await asyncio.sleep(0)
        dead.cancel()
        client.send(b":RM#:Mn#")
        await asyncio.sleep(1.0)
        assert bridge.sent_requests().count(b":Mn#") == 1
        assert bridge.sent_requests().count(b":RM#") == 1


async def test_stop_does_not_wait_for_the_verification_of_an_acknowledgement() -> None:
    """Whether more follows a bare ``#`` is waited for, but not while a stop waits."""
    for moment in range(1, 60, 4):
        async with Bridge("cge", latency=LATENCY) as bridge:
            noisy, quiet = bridge.client(), bridge.client()
            noisy.send(b":RM#:Mn#:Me#")
            await asyncio.sleep(moment / 100.0)
            before = len(bridge.sent_requests())
            asked = bridge.clock()
            quiet.send(b":Q#")
            await asyncio.sleep(0.6)
            stop = [entry for entry in bridge.entries if entry.side == "mount" and entry.arrow == ">"][before]
            heard = [entry.time for entry in bridge.entries if entry.arrow == "raw" and entry.time <= stop.time]
            assert stop.time - max(asked, heard[-1]) < 0.002, (moment, stop)


@pytest.mark.parametrize("motion", [b":RS#:Mn#", b":Sr07:00:00#:Sd+30*00:00#:MS#"])
async def test_lx200_restart_ends_all_motion(motion: bytes) -> None:
    """Meade's manual: :I# "causes the telescope to cease current operations and restart at its power on"."""
    async with Bridge("cge", surface="lx200gps") as bridge:
        client = bridge.client()
        client.send(motion)
        await asyncio.sleep(2.0)
        assert bridge.controller.moving
        assert await client.ask(b":I#", ending=b"X") == b"X"
        await asyncio.sleep(3.0)
        assert not bridge.controller.moving
        assert not bridge.sim.slewing
        assert bridge.sim.tracking


async def test_stop_ends_no_pulse_that_the_motor_has_ended_itself() -> None:
    async with Bridge("evolution", "5.31") as bridge:
        client = bridge.client()
        client.send(b":Mgn0500#")
        await asyncio.sleep(3.0)
        sent = len(bridge.sent_requests())
        client.send(b":Q#")
        await asyncio.sleep(1.0)
        assert b"M" in bridge.sent_requests()[sent:]
        assert not [data for data in bridge.sent_requests()[sent:] if data[:1] == b"P" and data[3:4] == b"\x26"]


async def test_stop_ends_a_pulse_that_the_motor_times_itself() -> None:
    """AUX 0x26 lasts up to 2.55 s and what is left of nine seconds would follow."""
    async with Bridge("evolution", "5.31") as bridge:
        client = bridge.client()
        client.send(b":Mgn9000#")
        await asyncio.sleep(1.0)
        assert bridge.sim.mechanics.pulsing(bridge.clock(), 2)
        client.send(b":Q#")
        await asyncio.sleep(0.6)
        assert not bridge.sim.mechanics.pulsing(bridge.clock(), 2)
        sent = len(bridge.sent_requests())
        await asyncio.sleep(10.0)
        assert not [data for data in bridge.sent_requests()[sent:] if data[:1] == b"P"]
        assert bridge.sim.tracking
