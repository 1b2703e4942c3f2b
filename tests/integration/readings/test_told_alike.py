"""A program that polls, whose replies are told again, hears what one hears that asks for the first time.

Each scenario changes something of what is told, while one program asks at every moment; after each of its replies
another one that has just come asks the same. A place may have gone on by an arcminute with the sky, and no more.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import pytest

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.reported_positions import degrees

STEP = 0.08
LONG_AGO = EVENING - 28 * 365.25 * 86400.0
LX200 = (b":GR#", b":GD#", b":GZ#", b":GA#", b":D#", b":Gt#", b":Gg#", b":GW#")
NEXSTAR = (b"e", b"E", b"z", b"Z", b"L", b"w", b"t", b"J")
Scenario = Callable[[Bridge], Awaitable[None]]


def alike(question: bytes, told: bytes, fresh: bytes) -> bool:
    """Whether both say the same; azimuth and altitude go on with the sky between two readings."""
    if told == fresh or not fresh or question not in (b":GZ#", b":GA#", b"z", b"Z"):
        return told == fresh
    if question in (b":GZ#", b":GA#"):
        return abs(wrap180(degrees(told) - degrees(fresh))) < 1.0 / 60.0
    pairs = zip(told.rstrip(b"#").split(b","), fresh.rstrip(b"#").split(b","), strict=True)
    whole = 2 ** (4 * (len(told) // 2 - 1))
    return all(abs(wrap180((int(one, 16) - int(other, 16)) * 360.0 / whole)) < 1.0 / 60.0 for one, other in pairs)


async def compared(bridge: Bridge, questions: tuple[bytes, ...], scenario: Scenario) -> None:
    """Ask half of the questions at every moment, the one who polls first, until some time after the scenario's end."""
    pollers = [(question, bridge.client(f"10.0.0.{number}")) for number, question in enumerate(questions, 10)]
    going, left, moment = asyncio.ensure_future(begun_later(scenario, bridge)), 40, 0
    while left:
        left -= going.done()
        moment += 1
        for question, poller in pollers[moment % 2 :: 2]:
            if poller.connection.client.has_running_operations:  # type: ignore[attr-defined]
                continue  # it waits for the mount
            await asyncio.sleep(0)  # not more than two may be answered in a turn
            poller.received, newcomer = b"", bridge.client("10.0.0.250")
            poller.send(question)
            newcomer.send(question)
            if poller.received:
                assert alike(question, poller.received, newcomer.received), (
                    question,
                    poller.received,
                    newcomer.received,
                )
            newcomer.close()
        await asyncio.sleep(STEP)
    await going


async def begun_later(scenario: Scenario, bridge: Bridge) -> None:
    await asyncio.sleep(1.5)
    await scenario(bridge)


# --- what happens -----------------------------------------------------------------------------------------------------


async def goes_and_is_stopped(bridge: Bridge) -> None:
    """A goto, waited for and under way, another one, and a stop."""
    for ra, dec, seconds in ((120.0, 30.0, 3.0), (105.0, 40.0, 2.0)):
        await bridge.controller.perform(op.Goto(ra, dec))
        await asyncio.sleep(seconds)
    await bridge.controller.stop()
    await asyncio.sleep(2.0)


async def moves_by_hand(bridge: Bridge) -> None:
    """Arrows that come and go, one of them twice."""
    north, west = (op.Move(way, op.Rate(name="max")) for way in (op.Direction.NORTH, op.Direction.WEST))
    for operation in (north, west, op.StopAxis(2), west, op.StopAxis(1)):
        await bridge.controller.perform(operation)
        await asyncio.sleep(1.1)


async def is_moved_at_its_keys(bridge: Bridge) -> None:
    """Somebody beside the mount: nothing of it goes through the gateway."""
    simulator: Any = bridge.sim
    mechanics = simulator.mechanics
    for axis, rate in ((1, 2.0), (2, -2.0), (1, 0.0), (2, 0.0)):
        mechanics.set_rate(simulator.now, axis, rate)
        await asyncio.sleep(1.3)


async def is_synced(bridge: Bridge) -> None:
    seen = await bridge.controller.read(op.Position())
    await bridge.controller.perform(op.Sync((seen.ra + 1.0) % 360.0, seen.dec))
    await asyncio.sleep(1.0)


async def tracks_and_does_not(bridge: Bridge) -> None:
    for on in (False, True):
        with suppress(Unsupported):  # a classic tracks always
            await bridge.controller.perform(op.SetTracking(on=on))
        await asyncio.sleep(1.0)


async def loses_its_line(bridge: Bridge) -> None:
    wire: Any = bridge.controller.line.wire
    feed, wire.feed = wire.feed, lambda data: b""
    await asyncio.sleep(8.0)
    wire.feed = feed
    await asyncio.sleep(4.0)


async def is_told_another_site(bridge: Bridge) -> None:
    await bridge.controller.perform(op.SetSite(latitude=-30.0))
    await asyncio.sleep(0.3)
    await bridge.controller.perform(op.SetSite(longitude=100.0))
    await asyncio.sleep(1.0)
    await bridge.controller.perform(op.SetSite(latitude=20.0))
    await asyncio.sleep(3.0)


async def is_told_another_time(bridge: Bridge) -> None:
    if bridge.controller.sources.site() is None:
        await bridge.controller.perform(op.SetSite(45.0, 10.0))
        await asyncio.sleep(1.0)
    for hours in (5.0, 9.0):
        await bridge.controller.perform(op.SetClock(bridge.clock() + hours * 3600.0, 0.0))
        await asyncio.sleep(1.5)


async def finds_its_satellites(bridge: Bridge) -> None:
    """A program asks what the GPS unit has found, which tells the site where nothing else does."""
    await bridge.controller.perform(op.SetSite(-30.0, 100.0))
    await asyncio.sleep(1.0)
    with suppress(Unsupported):  # before there was a pass-through
        await bridge.controller.answer(op.GetGps())
    await asyncio.sleep(1.0)


async def is_set_at_its_keys(bridge: Bridge) -> None:
    """Another site and another time at the hand control, read again after a while."""
    bridge.sim.feed(b"W" + bytes((20, 0, 0, 0, 100, 0, 0, 0)))
    await bridge.controller.site_settings.renew(op.GetSite)
    await asyncio.sleep(0.5)
    bridge.sim.feed(b"H" + bytes((3, 0, 0, 1, 16, 26, 0, 0)))
    await bridge.controller.site_settings.renew(op.GetClock)
    await asyncio.sleep(0.5)


MOUNTS = [("cge", "nexstar"), ("6-8se", "nexstar"), ("autostar", "lx200"), ("lx200", "lx200")]


@pytest.mark.parametrize(
    "scenario",
    [goes_and_is_stopped, moves_by_hand, is_moved_at_its_keys, is_synced, tracks_and_does_not, loses_its_line],
)
@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
async def test_polling_program_reads_the_same_motion_as_a_newly_connected_one(
    mount: str, driven: str, presented: str, scenario: Scenario
) -> None:
    async with Bridge(
        mount, driven=driven, presented=presented, surface=None, config={"lowest": -90.0, "sun": 0.0}
    ) as bridge:
        await compared(bridge, LX200 if presented == "lx200" else NEXSTAR, scenario)


#: An equatorial mount that takes what it is told; one that tells neither, and that keeps its sync here.
TAKES: dict[str, Any] = {"mount": "cge", "aligned": False}
TELLS_NOTHING: dict[str, Any] = {"mount": "nexstar-gps", "version": "1.2"}
HAS_GPS: dict[str, Any] = {"mount": "nexstar-gps", "version": "1.6"}


@pytest.mark.parametrize("scenario", [is_told_another_site, is_told_another_time, is_set_at_its_keys])
@pytest.mark.parametrize("presented", ["lx200", "nexstar"])
@pytest.mark.parametrize(("settings", "start"), [(TAKES, EVENING), (TELLS_NOTHING, LONG_AGO)])
async def test_polling_program_reads_the_same_site_and_time_as_a_newly_connected_one(
    settings: dict[str, Any], start: float, presented: str, scenario: Scenario
) -> None:
    """By this computer's clock it is 1998 in the second case, so that a program's is believed."""
    async with Bridge(
        **settings, presented=presented, surface=None, start=start, config={"lowest": -90.0, "sun": 0.0}
    ) as bridge:
        if settings["mount"] == "nexstar-gps":
            seen = await bridge.controller.read(op.Position())
            await bridge.controller.perform(op.Sync((seen.ra + 1.0) % 360.0, seen.dec))
            assert any(bridge.driver.sync_offset)
        await compared(bridge, LX200 if presented == "lx200" else NEXSTAR, scenario)


async def test_gps_position_found_late_is_reported_at_once() -> None:
    """It found none when the gateway asked it first."""
    async with Bridge(**HAS_GPS, surface=None, config={"lowest": -90.0, "sun": 0.0}) as bridge:
        seen = await bridge.controller.read(op.Position())
        await bridge.controller.perform(op.Sync((seen.ra + 1.0) % 360.0, seen.dec))
        bridge.site_clock.mount_site = None
        await compared(bridge, LX200, finds_its_satellites)
        assert bridge.site_clock.gps_site is not None


@pytest.mark.parametrize(
    ("question", "forget"),
    [
        (b":GR#", lambda bridge: bridge.controller.cache.forget(op.Position)),
        (b":GR#", lambda bridge: bridge.controller.reader.mark_outdated()),
        (b":D#", lambda bridge: bridge.controller.cache.forget(op.Slewing)),
    ],
    ids=["position forgotten", "position outdated", "slewing forgotten"],
)
async def test_reading_dropped_from_the_cache_is_not_reported(
    question: bytes, forget: Callable[[Bridge], None]
) -> None:
    async with Bridge("cge", surface=None) as bridge:
        client = bridge.client()
        for _ in range(3):
            assert await client.ask(question, ending=b"#")
        client.received = b""
        client.send(question)
        assert client.received, "it is told again"
        client.received = b""
        forget(bridge)
        client.send(question)
        assert client.received == b"", "the mount is asked"


def test_ra_of_one_instant_is_not_reported_with_dec_of_another() -> None:
    """Between the halves that one program asks for another one is told a later moment: each gets both of its own."""

    async def program() -> None:
        async with Bridge("cge", surface=None, latency=0.02, config={"lowest": -90.0, "sun": 0.0}) as bridge:
            client, other = bridge.client(), bridge.client("10.0.0.2")
            client.send(b":RS#:Mw#:Ms#")
            await asyncio.sleep(3.0)

            def told(asking: Any, question: bytes) -> bytes:
                asking.received = b""
                asking.send(question)
                return bytes(asking.received)

            for _ in range(30):
                told(client, b":GR#")
                await asyncio.sleep(0.055)
                told(other, b":GR#")
                told(client, b":GD#")
                await asyncio.sleep(0.01)
                both = told(client, b":GR#") + told(client, b":GD#")
                await asyncio.sleep(0.0)
                assert told(bridge.client("10.0.0.3"), b":GR#:GD#") == both
                await asyncio.sleep(0.07)

    run(program())
