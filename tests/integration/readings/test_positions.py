"""Positions in motion are of the moment at which they are told, and after an order the mount is asked anew."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import horizon_to_hour_angle, separation, wrap180
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.readings.cache import NOT_CACHED
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.nexstar_flows import place
from tests.support.reported_positions import (
    FREE,
    MEADES,
    MOUNTS,
    bridge_to,
    degrees,
    reported_position,
    start_moving,
    tracked,
)
from tests.support.truth import moving

SURFACES = ("lx200", "nexstar")
every = pytest.mark.parametrize(("mount", "presented"), [(mount, face) for mount in MOUNTS for face in SURFACES])
by_turns = pytest.mark.parametrize("presented", SURFACES)
on_each = pytest.mark.parametrize("mount", MOUNTS)


@on_each
@by_turns
@pytest.mark.parametrize("by_hand", [False, True])
async def test_positions_a_tenth_of_a_second_apart_match_the_moving_tube(
    mount: str, presented: str, by_hand: bool
) -> None:
    async with bridge_to(mount, presented, latency=0.02) as bridge:
        client = bridge.client()
        await start_moving(client, presented, by_hand)
        await asyncio.sleep(2.6)
        last, errors = await reported_position(client, presented), []
        for _ in range(20):
            await asyncio.sleep(0.1)
            if not by_hand and separation(*bridge.sim.true_position(), 120.0, 30.0) < 6.0:
                break  # it slows down
            seen = await reported_position(client, presented)
            assert seen != last
            last = seen
            if abs(seen[1]) < 80.0:
                errors.append(separation(*seen, *bridge.sim.true_position()))
        assert sorted(errors)[len(errors) // 2] < 0.3
        assert max(errors) < 1.2, "a reading that is told as it came is up to four degrees old"


@pytest.mark.parametrize("mount", ["lx200", "autostar", "lx200gps"])
async def test_two_halves_of_a_meade_position_are_of_one_instant(mount: str) -> None:
    """A Meade answers half a position a time; on this line the halves are three degrees from each other."""
    async with bridge_to(mount, "lx200", latency=0.1) as bridge, tracked(bridge) as track:
        client = bridge.client()
        await start_moving(client, "lx200", True)
        await asyncio.sleep(3.0)
        off = []
        for _ in range(30):
            seen = await reported_position(client, "lx200")
            if abs(seen[1]) < 70.0:
                off.append(track.off(seen))
            await asyncio.sleep(0.07)
        assert len(off) > 5
        assert sorted(off)[len(off) // 2] < (0.1 if mount == "lx200" else 0.5) and max(off) < 1.0


@pytest.mark.parametrize("pair", [b":GR# :GD#", b":GZ# :GA#"])
async def test_both_coordinates_that_a_program_reads_are_of_one_instant(pair: bytes) -> None:
    async with bridge_to("cpc", "lx200", latency=0.02) as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        await start_moving(client, "lx200", True)
        await asyncio.sleep(2.5)
        first, second = pair.split()
        for _ in range(20):
            one = await client.ask(first, ending=b"#")
            at_once = bridge.client("10.0.0.3")
            expected = await at_once.ask(first + second, ending=b"#")
            await asyncio.sleep(0.3)
            await other.ask(second, ending=b"#")  # of another instant
            both = one + await client.ask(second, ending=b"#")
            assert both == expected
            at_once.close()
            await asyncio.sleep(0.13)


async def test_values_that_a_nexstar_program_reads_together_are_of_one_instant() -> None:
    async with bridge_to("cpc", "nexstar", latency=0.02) as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        await start_moving(client, "nexstar", True)
        for _ in range(7):  # a rate takes two readings
            await client.ask(b"z", ending=b"#")
            await asyncio.sleep(0.4)
        for n in range(40):
            ra, dec = place(await client.ask(b"e", ending=b"#"))
            await asyncio.sleep(0.025)
            asked = bridge.clock()
            az, alt = place(await (client if n % 2 else other).ask(b"z", ending=b"#"))
            if bridge.clock() - asked > 0.02:
                continue  # the mount was asked how it stands first, which takes its time
            hour_angle, there = horizon_to_hour_angle(az, alt, 45.0)
            assert separation(sidereal_time(bridge.clock(), 10.0) - hour_angle, there, ra, dec) < 0.12
            await asyncio.sleep(0.04 + 0.003 * n)  # else it is the same moment still, but not for all of it


@on_each
@by_turns
@pytest.mark.parametrize("by_hand", [False, True])
@pytest.mark.parametrize("phase", [0.0, 0.13, 0.29])
async def test_first_position_after_a_stop_is_read_after_the_stop(
    mount: str, presented: str, by_hand: bool, phase: float
) -> None:
    """A reading that is on the wire when the stop comes is not told after its acknowledgement."""
    async with bridge_to(mount, presented, latency=0.15, ramps=False) as bridge, tracked(bridge) as track:
        client, polls = bridge.client(), bridge.client("10.0.0.2")
        await reported_position(polls, presented)
        await start_moving(client, presented, by_hand)
        for _ in range(6):
            polls.send(b":GR#" if presented == "lx200" else b"e")
            await asyncio.sleep(0.3)
        await asyncio.sleep(phase)
        polls.received = b""
        await bridge.controller.stop()
        since, late = bridge.controller.now() - 0.16, bridge.client("10.0.0.3")
        for _ in range(4):
            seen = await reported_position(late, presented)
            assert track.off(seen, since) < 0.05
            await asyncio.sleep(0.05)


@on_each
@by_turns
@pytest.mark.parametrize("by_hand", [False, True])
async def test_reading_older_than_an_order_is_not_reported_after_it(mount: str, presented: str, by_hand: bool) -> None:
    async with bridge_to(mount, presented, latency=0.02, ramps=False) as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        before = await reported_position(other, presented)
        await start_moving(client, presented, by_hand)
        await asyncio.sleep(0.3)
        while not (bridge.controller.slewing or bridge.controller.wanted.axes_moved_by_hand):
            await asyncio.sleep(0.01)
        where = bridge.sim.true_position()
        seen = await reported_position(other, presented)
        assert separation(*before, *where) > 0.1
        assert separation(*seen, *before) > 0.05


@pytest.mark.parametrize("mount", MOUNTS)
async def test_reported_position_never_passes_the_target_of_a_goto(mount: str) -> None:
    async with bridge_to(mount, "lx200") as bridge:
        client, goal = bridge.client(), (120.0, 30.0)
        begin = await reported_position(client, "lx200")
        await start_moving(client, "lx200", False)
        while (await client.ask(b":D#", ending=b"#")).strip(b" #"):
            seen = await reported_position(client, "lx200")
            for which in {"lx200": (0, 1), "cge": (1,)}.get(mount, ()):  # others go round in other angles
                way, gone = wrap180(goal[which] - begin[which]), wrap180(seen[which] - begin[which])
                assert gone * (1 if way > 0 else -1) <= abs(way) + 0.01
            await asyncio.sleep(0.1)
        assert separation(*await reported_position(client, "lx200"), *goal) < 0.02


async def test_safety_rules_use_readings_and_not_extrapolated_positions() -> None:
    async with bridge_to("cge", "nexstar") as bridge:
        controller, looks = bridge.controller, []
        controller.reader.position_read.connect(looks.append)
        client = bridge.client()
        await start_moving(client, "nexstar", True)
        await asyncio.sleep(2.5)
        reckoned = 0
        for _ in range(30):
            await client.ask(b"e", ending=b"#")
            said = controller.cache.last_value(op.Position)
            assert await controller.read(op.Position()) is said
            reckoned += controller.peek(op.Position()) not in (NOT_CACHED, said)
            await asyncio.sleep(0.07)
        assert reckoned > 10
        assert len(looks) > 8
        assert all(min(separation(*said, seen.ra, seen.dec) for said in said_by(bridge)) < 1e-4 for seen in looks)


def said_by(bridge: Bridge) -> list[tuple[float, float]]:
    """Every place that a NexStar has told, as the driver understands it."""
    places = []
    for entry in bridge.entries:
        if entry.side == "mount" and entry.arrow == "<" and len(entry.data) == 18:
            places.append(place(entry.data))
    return places


# --- slewing ----------------------------------------------------------------------------------------------------------


@every
@pytest.mark.parametrize("phase", [0.05 * n for n in range(12)])
async def test_slewing_read_before_a_stop_is_not_reported_after_it(mount: str, presented: str, phase: float) -> None:
    """Whether it slews is on the wire when the stop comes: that answer is older than the stop. It is told
    until the mount rests, and not again.
    """
    async with bridge_to(mount, presented, latency=0.15) as bridge:
        client = bridge.client()
        question, idle = (b":D#", b"#") if presented == "lx200" else (b"L", b"0#")
        await start_moving(client, presented, False)
        for _ in range(5):
            await client.ask(question, ending=b"#")
            await asyncio.sleep(0.3)
        await asyncio.sleep(phase)
        await bridge.controller.stop()
        rested = None
        for _ in range(150):
            told = (await client.ask(question, ending=b"#")).replace(b" ", b"") != idle
            assert told or not moving(bridge.sim)
            assert rested is None or not told, "it began again"
            rested = bridge.clock() if rested is None and not told else rested
            await asyncio.sleep(0.02)
        assert rested is not None


@pytest.mark.parametrize("mount", MOUNTS)
async def test_slewing_is_reported_from_the_order_until_arrival(mount: str) -> None:
    async with bridge_to(mount, "lx200", latency=0.1) as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        assert not (await other.ask(b":D#", ending=b"#")).strip(b" #")
        client.send(b":Sr08:00:00#:Sd+30*00:00#:MS#")
        await asyncio.sleep(0.01)
        while (await other.ask(b":D#", ending=b"#")).strip(b" #"):
            await asyncio.sleep(0.05)
        assert separation(*bridge.sim.true_position(), 120.0, 30.0) < 0.02
        assert separation(*await reported_position(other, "lx200"), 120.0, 30.0) < 0.02


# --- what it costs ----------------------------------------------------------------------------------------------------


def handled(bridge: Bridge) -> list[bytes]:
    """The commands that the surface has had work with."""
    surface, frames = bridge.acceptor.binding.surface, []
    handle = surface.handle

    def counted(session: Any, frame: bytes) -> Any:
        frames.append(frame)
        return handle(session, frame)

    surface.handle = counted  # type: ignore[method-assign]
    return frames


async def polled(client: RehearsalClient, question: bytes, seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        assert await client.ask(question, ending=b"#")
        await asyncio.sleep(0.01)


@pytest.mark.parametrize("mount", ["cge", "6-8se", "autostar"])
@pytest.mark.parametrize(
    ("presented", "question"),
    [*(("lx200", question) for question in (b":GR#", b":GD#", b":GZ#", b":D#")), ("nexstar", b"e"), ("nexstar", b"z")],
)
async def test_poll_of_a_mount_at_rest_is_answered_from_the_cache(mount: str, presented: str, question: bytes) -> None:
    """A hundred polls a second, and only those have to be worked out that come after a new reading."""
    async with bridge_to(mount, presented) as bridge:
        client = bridge.client()
        await polled(client, question, 2.0)
        frames = handled(bridge)
        sent = len(bridge.sent_requests())
        await polled(client, question, 3.0)
        readings = len(bridge.sent_requests()) - sent
        assert len(frames) <= readings + 3 < 30


@every
async def test_reply_in_motion_is_reused_for_fifty_milliseconds(mount: str, presented: str) -> None:
    async with bridge_to(mount, presented, latency=0.02) as bridge:
        client, question = bridge.client(), b":GR#" if presented == "lx200" else b"e"
        await start_moving(client, presented, True)
        await asyncio.sleep(2.6)
        await client.ask(question, ending=b"#")
        frames, last, since = handled(bridge), b"", 0.0
        for _ in range(100):
            answer = await client.ask(question, ending=b"#")
            if answer != last:
                last, since = answer, bridge.controller.now()
            assert bridge.controller.now() - since <= 0.06
            await asyncio.sleep(0.01)
        assert len(frames) < 60


@on_each
@by_turns
@pytest.mark.parametrize("by_hand", [False, True])
def test_polls_in_motion_cost_the_line_at_most_two_exchanges_a_second(
    mount: str, presented: str, by_hand: bool
) -> None:
    """Against a gateway that nobody asks for positions while it moves the mount."""

    async def program(asked: bool) -> float:
        async with bridge_to(mount, presented) as bridge:
            client = bridge.client()
            await start_moving(client, presented, by_hand)
            await asyncio.sleep(2.0)
            before = len(bridge.sent_requests())
            for _ in range(40):
                if asked:
                    client.send(b":GR#" if presented == "lx200" else b"e")
                await asyncio.sleep(0.1)
            return (len(bridge.sent_requests()) - before) / 4.0

    assert run(program(True)) <= run(program(False)) + 2.0


async def test_resting_mount_is_read_only_when_its_position_expires() -> None:
    async with bridge_to("6-8se", "lx200") as bridge:
        client = bridge.client()
        await polled(client, b":GR#", 2.0)
        before = len(bridge.sent_requests())
        await polled(client, b":GR#", 5.0)
        asked = bridge.sent_requests()[before:]
        assert len(asked) - asked.count(b"w") <= 14 and asked.count(b"w") <= 2


async def test_position_check_finds_no_error_on_a_tracking_mount() -> None:
    async with bridge_to("cge", "lx200", config=FREE) as bridge, tracked(bridge) as track:
        await asyncio.sleep(0.1)
        assert track.off(bridge.sim.true_position()) < 1e-4
        assert not truth_of(bridge.sim).moving
        assert degrees(b"-00*30:36#") == pytest.approx(-0.51)
        assert "cge" not in MEADES
