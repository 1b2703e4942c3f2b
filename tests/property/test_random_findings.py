"""What random plays brought to light, each as short as it can be told."""

from __future__ import annotations

import asyncio
import gc
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.looks import altitude


def test_failed_stop_that_nobody_awaits_is_one_log_line() -> None:
    """A hand control sent to sleep at its keys answers no stop: that is one line in the log and no traceback."""

    async def program() -> list[Any]:
        uncaught: list[Any] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: uncaught.append(context))
        async with Bridge("6-8se", surface="lx200gps") as bridge:
            client = bridge.client()
            client.send(b":RS#:Mn#")
            await asyncio.sleep(1)
            bridge.sim.asleep = True
            client.send(b":Qn#")
            await asyncio.sleep(60)
            gc.collect()
            assert any(entry.note.startswith("stop: No answer") for entry in bridge.entries)
        return uncaught

    assert run(program()) == []


@each("arrow", [b":Mn#", b":Mw#"])
async def test_arrow_emulated_by_small_gotos_is_refused_on_an_unaligned_mount(arrow: bytes) -> None:
    config = {"site": (45.0, 10.0), "mode": "alt-az"}
    async with Bridge("nexstar-gps", "1.2", aligned=False, config=config) as bridge:
        bridge.client().send(b":RS#" + arrow)
        await asyncio.sleep(5)
        assert not [sent for sent in bridge.sent_requests() if sent.startswith(b"R")]
        assert any(entry.note == "Arrow: Mount not aligned." for entry in bridge.entries)
        assert not bridge.controller.moving


async def test_first_position_read_on_a_busy_line_waits_for_the_reply() -> None:
    """Two seconds are for a mount that has never answered; one that is being spoken to answers in its turn."""
    async with Bridge("cpc", driven="nexstar", presented="nexstar", surface="cge", latency=0.28) as bridge:
        client = bridge.client()
        client.send(b"P\x02\x10\x24\x05\x00\x00\x00")
        await asyncio.sleep(2)
        client.send(b"b20000000,10AA0000" + b"P\x02\x11\x24\x05\x00\x00\x00" + b"r80000000,10AA0000")
        await asyncio.sleep(0.01)
        reply = await client.ask(b"Z")
        assert len(reply) == 10, reply


async def test_goto_right_after_tracking_off_is_checked_against_the_sun() -> None:
    """The manual's own order, T 0 and then the slew: the slew is looked at all the same."""
    june = 1782036000.0  # 2026-06-21 10:00 UTC: the Sun at azimuth 136, altitude 63
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se", start=june) as bridge:
        client = bridge.client()
        await client.ask(b"b82D80000,2CCC0000")  # azimuth 184, altitude 63: 21 degrees before it
        for _ in range(60):
            await asyncio.sleep(0.5)
            await client.ask(b"e")
        assert await client.ask(b"T\x00") == b"#"
        assert await client.ask(b"P\x02\x10\x25\x09\x00\x00\x00") == b"#"  # azimuth falls, 8 degrees a second
        await asyncio.sleep(1)
        assert b":Me#" not in bridge.sent_requests()
        assert any("Too close to the Sun" in entry.note for entry in bridge.entries)


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "cge"), ("lx200", "lx200")])
async def test_equatorial_mount_moved_by_motor_commands_stops_at_the_altitude_limit(driven: str, model: str) -> None:
    """A declination motor's sense on the sky depends on the pier side; its axis reading knows."""
    limits = {"lowest": 39.6}
    async with Bridge(model, driven=driven, presented="nexstar", surface="cge", config=limits) as bridge:
        client = bridge.client()
        assert await client.ask(b"r28000000,05B00000") == b"#"  # 3h45m, +8: in the west, 40 degrees high
        for _ in range(60):
            await asyncio.sleep(0.5)
            await client.ask(b"e")
        for turn in range(8):  # one of the two senses leads down
            await client.ask(bytes((80, 2, 17, 37 - turn % 2, 9, 0, 0, 0)))
            for _ in range(40):
                await asyncio.sleep(0.1)
                low = altitude(bridge)
                assert low > 39.5, (turn, low)


async def test_meade_that_starts_seeking_home_while_moved_is_stopped() -> None:
    """It says NAK to every question meanwhile: nobody knows where it is."""
    async with Bridge("lx200gps", driven="lx200", presented="lx200", surface="lx200gps") as bridge:
        client = bridge.client()
        client.send(b":RS#:Me#")
        await asyncio.sleep(1)
        client.send(b":hS#")
        await asyncio.sleep(3)
        assert b":Q#" in bridge.sent_requests()
        assert not bridge.controller.moving


@pytest.mark.parametrize("model", ["autostar", "lx200gps"])
def test_arrow_that_takes_over_from_a_goto_stops_at_the_altitude_limit(model: str) -> None:
    """The goto counts as under way for some seconds more; the motion is none that knows where it ends."""

    async def program() -> float:
        limits = {"lowest": 30.0}
        async with Bridge(
            model, driven="lx200", presented="nexstar", surface="6-8se", config=limits, latency=0.2
        ) as bridge:
            client = bridge.client()
            await client.ask(b"e")
            await client.ask(b"P\x02\x11\x25\x09\x00\x00\x00")
            low = 90.0
            for _ in range(60):
                bridge.controller.cache.put(op.Slewing, True, bridge.controller.now())
                await asyncio.sleep(0.1)
                low = min(low, altitude(bridge))
            return low

    assert run(program()) > 29.9


@pytest.mark.parametrize("motion", [b"P\x02\x11\x24\x09\x00\x00\x00", b"r80000000,40000000"])
async def test_moving_mount_is_sent_no_change_between_alt_az_and_equatorial(motion: bytes) -> None:
    """Alt-az and equatorial are two frames: axes that were checked in one must not be sent to in the other."""
    async with Bridge("gt", "104.0", presented="nexstar", surface="advanced-gt", config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        client.send(b"T\x02")
        await asyncio.sleep(5)
        before = len(bridge.sent_requests())
        client.send(motion)
        await asyncio.sleep(1)
        client.send(b"T\x01")
        await asyncio.sleep(1)
        client.send(b"M" + b"P\x02\x11\x24\x00\x00\x00\x00")
        await asyncio.sleep(10)
        assert b"T\x01" not in bridge.sent_requests()[before:]
        assert await client.ask(b"t") == b"\x02#"
        client.send(b"T\x01")  # at rest it is told
        await asyncio.sleep(2)
        assert b"T\x01" in bridge.sent_requests()[before:]


@each("aligned", [True, False])
async def test_aligned_hand_control_keeps_its_clock_when_the_gps_is_read(aligned: bool) -> None:
    async with Bridge("cpc", surface="lx200gps", aligned=aligned) as bridge:
        assert await bridge.client().ask(b":gT#") == b"1"
        await asyncio.sleep(1)
        assert any(sent.startswith(b"H") for sent in bridge.sent_requests()) is not aligned


async def test_telescope_without_a_home_search_reports_home_not_found() -> None:
    async with Bridge("lx200", driven="lx200") as bridge:
        assert await bridge.client().ask(b":h?#") == b"0"


@pytest.mark.parametrize(("axis", "first"), [(16, b"P\x02\x10\x24\0\0\0\0"), (17, b"P\x02\x11\x24\0\0\0\0")])
@pytest.mark.parametrize("other", [0, 3])
async def test_faster_of_two_motors_is_stopped_first(axis: int, first: bytes, other: int) -> None:
    async with Bridge() as bridge:
        await bridge.controller.perform(op.MoveAxis(axis - 15, 1, op.Rate(key=5)))
        if other:
            await bridge.controller.perform(op.MoveAxis(3 - (axis - 15), 1, op.Rate(key=other)))
        before = len(bridge.sent_requests())
        await bridge.controller.perform(op.AbortMotion())
        stops = [sent for sent in bridge.sent_requests()[before:] if sent.startswith(b"P\x02") and sent[4] == 0]
        assert stops[0] == first
        assert len(stops) == 2


@pytest.mark.parametrize(("driven", "model", "aligns"), [("lx200", "autostar", True), ("nexstar", "6-8se", False)])
async def test_far_second_sync_is_refused_after_a_first_sync_that_aligns(driven: str, model: str, aligns: bool) -> None:
    async with Bridge(model, driven=driven, presented="nexstar", surface="6-8se", aligned=False) as bridge:
        client = bridge.client()
        assert await client.ask(b"SFC12,2163") == b"#"
        syncs = [sent for sent in bridge.sent_requests() if sent.startswith((b"s", b"S", b":CM"))]
        await client.ask(b"S3A6F,1B8D", 2.0)
        again = [sent for sent in bridge.sent_requests() if sent.startswith((b"s", b"S", b":CM"))]
        assert bridge.sim.aligned is aligns
        if aligns:
            assert again == syncs
            assert any("Sync refused" in entry.note for entry in bridge.entries)


async def test_axis_position_is_reported_though_a_goto_begins_during_the_read() -> None:
    """A Meade tells azimuth and altitude in halves, which never agree on the way: the position says the same."""
    async with Bridge("lx200", driven="lx200", presented="nexstar", surface="lcm", latency=0.2) as bridge:
        first, second = bridge.client(), bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await asyncio.sleep(5.0)
        goal = f"r{int(((sidereal + 100.0) % 360.0) / 360.0 * 2**32):08X},{int(70.0 / 360.0 * 2**32):08X}"
        first.send(goal.encode())
        await asyncio.sleep(0.3)
        assert await second.ask(b"z", 3.0)
        while not bridge.controller.slewing:
            await asyncio.sleep(0.1)
        assert await second.ask(b"z", 3.0)
