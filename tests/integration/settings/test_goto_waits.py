"""Settings and gotos do not overtake each other: a goto is judged by the clock and the site that were set before it.

The mounts stand at 45 N, 10 E; what they were sent is read at their own end of the line.
"""

from __future__ import annotations

import asyncio
import struct
from contextlib import suppress
from typing import Any

import pytest

from gateway.astro.spherical import horizon_to_hour_angle
from gateway.core import operations as op
from gateway.core.errors import Busy
from tests.support import truth
from tests.support.in_process_gateway import Bridge
from tests.unit.mount.site.test_sources import as_lx200

LOWEST = 20.0
#: 22:00 UTC is right; three hours and a half earlier, in the notation of each protocol.
SLOW = b":SL18:30:00#"
SLOW_H = b"H" + bytes((18, 30, 0, 1, 15, 26, 0, 0))
SETS = {"lx200": (b":SL", b":SC", b":SG", b":St", b":Sg"), "nexstar": (b"H", b"W", b"I")}


def meade(mount: str = "lx200gps", **settings: Any) -> Bridge:
    config = {"lowest": LOWEST, "sun": 0.0, **settings.pop("config", {})}
    return Bridge(mount, driven="lx200", surface="lx200gps", config=config, latency=0.02, **settings)


def at_altitude(bridge: Bridge, azimuth: float, altitude: float, earlier: float = 0.0) -> tuple[float, float]:
    """Right ascension and declination of a place above the horizon, by a clock that is so many hours slow."""
    hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, 45.0)
    unix = bridge.clock() - earlier * 3600.0
    return (bridge.sim.mechanics.sky.lst(unix) - hour_angle) % 360.0, dec


def as_nexstar(ra: float, dec: float) -> bytes:
    return b"r%08X,%08X" % (int(ra / 360 * 2**32), int(dec % 360 / 360 * 2**32))


def order(bridge: Bridge, driven: str = "lx200") -> list[str]:
    """``set`` and ``goto`` in the order in which the mount heard them."""
    gotos = {"lx200": (b":MS", b":MA"), "nexstar": (b"r", b"b", b"R", b"B")}[driven]
    heard = [
        "set" if one.startswith(SETS[driven]) else "goto"
        for one in bridge.sent_requests()
        if one.startswith((*SETS[driven], *gotos))
    ]
    return [one for number, one in enumerate(heard) if number == 0 or heard[number - 1] != one]


async def lowest_of(bridge: Bridge, seconds: float) -> float:
    found: list[float] = []
    for _ in range(round(seconds / 0.2)):
        found.append(truth.altitude(bridge.sim))
        await asyncio.sleep(0.2)
    return min(found)


@pytest.mark.parametrize("together", [True, False])
async def test_goto_in_the_packet_of_a_new_clock_is_judged_by_that_clock(together: bool) -> None:
    """By the clock before it stands 25 degrees high, by the clock that was set 6 degrees below the horizon or so."""
    async with meade() as bridge:
        client = bridge.client()
        target = as_lx200(*at_altitude(bridge, 100.0, 25.0))
        if together:
            reply = await client.ask(SLOW + target, ending=b"#")
        else:
            await client.ask(SLOW)
            await asyncio.sleep(0.1)
            reply = await client.ask(target, ending=b"#")
        assert b"Below" in reply, reply
        assert order(bridge) == ["set"]
        assert await lowest_of(bridge, 30.0) > LOWEST


async def test_goto_allowed_by_a_new_clock_waits_until_the_mount_has_it() -> None:
    async with meade() as bridge:
        client = bridge.client()
        target = as_lx200(*at_altitude(bridge, 180.0, 50.0, 0.5))
        assert (await client.ask(b":SL21:30:00#" + target, ending=b"0")).endswith(b"0")
        assert order(bridge) == ["set", "goto"]


@pytest.mark.parametrize(
    "said", [b":SL18:30:00#", b":Sg030*00#", b":SG+00#:SL18:30:00#:SC01/15/26#", b":St+40*00#:Sg030*00#"]
)
async def test_slewing_mount_is_sent_no_site_and_no_clock(said: bytes) -> None:
    async with meade() as bridge:
        client = bridge.client()
        assert (await client.ask(as_lx200(*at_altitude(bridge, 180.0, 40.0)), ending=b"0")).endswith(b"0")
        await asyncio.sleep(0.6)
        await client.ask(said)
        while truth.moving(bridge.sim):
            assert order(bridge) == ["goto"]
            await asyncio.sleep(0.2)
        await asyncio.sleep(5.0)
        assert order(bridge) == ["goto", "set"]


async def test_mount_moved_by_hand_is_sent_no_clock() -> None:
    async with meade() as bridge:
        client = bridge.client()
        client.send(b":RS#:Mn#")
        await asyncio.sleep(1.0)
        await client.ask(SLOW)
        for _ in range(20):
            await client.ask(b":GR#")
            await asyncio.sleep(0.2)
        assert order(bridge) == []
        client.send(b":Qn#")
        await asyncio.sleep(6.0)
        assert order(bridge) == ["set"]


@pytest.mark.parametrize(("mount", "driven"), [("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("pause", [0.05, 0.15, 0.3])
async def test_site_is_not_sent_to_a_mount_that_begins_to_move_meanwhile(mount: str, driven: str, pause: float) -> None:
    async with Bridge(
        mount, driven=driven, aligned=driven == "lx200", surface="autostar", latency=0.3,
        config={"lowest": -90.0, "sun": 0.0},
    ) as bridge:  # fmt: skip
        await asyncio.sleep(8.0)
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":RS#:Sg074*30#:St+40*45#")
        await asyncio.sleep(pause)
        client.send(b":Mn#")
        await asyncio.sleep(5.0)
        sent = bridge.sent_requests()[before:]
        assert any(data.startswith((b"P\x02\x11", b":Mn")) for data in sent)
        assert not [data for data in sent if data.startswith((b"W", b":St", b":Sg"))]


async def test_lx200_refusal_during_a_clock_change_names_the_seconds_to_wait() -> None:
    """A classic works for ten seconds on a new date."""
    async with meade("lx200") as bridge:
        client = bridge.client()
        await client.ask(b":SG+00#:SL22:00:30#:SC01/16/26#", ending=b"#")
        reply = await client.ask(as_lx200(*at_altitude(bridge, 180.0, 50.0)), ending=b"#")
        words = reply.removeprefix(b"11")
        assert words[1:].startswith(b"The mount is taking a new clock"), reply
        assert words.endswith(b" seconds.#")
        assert len(words) <= 62
        assert order(bridge) == ["set"]


def nexstar_client_on_meade(mount: str = "lx200") -> Bridge:
    return Bridge(
        mount, driven="lx200", presented="nexstar", surface="cge", latency=0.02,
        config={"lowest": LOWEST, "sun": 0.0},
    )  # fmt: skip


async def test_nexstar_goto_during_a_clock_change_is_carried_out_afterwards() -> None:
    async with nexstar_client_on_meade() as bridge:
        client = bridge.client()
        assert await client.ask(b"H" + bytes((22, 0, 30, 1, 16, 26, 0, 0))) == b"#"
        assert await client.ask(as_nexstar(*at_altitude(bridge, 180.0, 50.0))) == b"#"
        assert await client.ask(b"L") == b"1#"
        await asyncio.sleep(20.0)
        assert order(bridge) == ["set", "goto"]


async def test_waiting_goto_is_judged_by_the_new_clock() -> None:
    async with nexstar_client_on_meade("lx200gps") as bridge:
        client = bridge.client()
        assert await client.ask(SLOW_H) == b"#"
        assert await client.ask(as_nexstar(*at_altitude(bridge, 100.0, 25.0))) == b"#"
        assert await lowest_of(bridge, 30.0) > LOWEST
        assert order(bridge) == ["set"]


@pytest.mark.parametrize("by", ["stop of another", "arrow", "hold", "client gone"])
async def test_stop_or_disconnection_cancels_a_goto_that_waits_for_the_clock(by: str) -> None:
    async with nexstar_client_on_meade() as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.9")
        assert await client.ask(b"H" + bytes((22, 0, 30, 1, 16, 26, 0, 0))) == b"#"
        assert await client.ask(as_nexstar(*at_altitude(bridge, 180.0, 50.0))) == b"#"
        if by == "stop of another":
            bridge.controller.begin_stop()
        elif by == "arrow":
            with suppress(Busy):  # the mount calculates
                await bridge.controller.perform(op.Move(op.Direction.NORTH, op.Rate(key=2)), max_delay=1.0)
        elif by == "hold":
            bridge.controller.hold.is_on = True
            bridge.controller.begin_stop()
            bridge.controller.hold.is_on = False
        else:
            client.close()
        await asyncio.sleep(1.0)
        bridge.controller.begin_stop()
        await asyncio.sleep(25.0)
        assert order(bridge) == ["set"]
        assert (await other.ask(b"L")) == b"0#"


async def test_newer_goto_replaces_one_that_waits_for_the_clock() -> None:
    async with nexstar_client_on_meade() as bridge:
        client = bridge.client()
        assert await client.ask(b"H" + bytes((22, 0, 30, 1, 16, 26, 0, 0))) == b"#"
        await client.ask(as_nexstar(*at_altitude(bridge, 180.0, 50.0)))
        await client.ask(as_nexstar(*at_altitude(bridge, 180.0, 60.0)))
        await asyncio.sleep(30.0)
        assert sum(one.startswith(b":MS") for one in bridge.sent_requests()) == 1
        assert truth.altitude(bridge.sim) == pytest.approx(60.0, abs=1.0)


async def test_incomplete_site_does_not_delay_gotos() -> None:
    """The classic hand control of the first kind tells no site."""
    async with Bridge("nexstar-gps", "1.2", surface="lx200gps", config={"sun": 0.0}) as bridge:
        client = bridge.client()
        assert await client.ask(b":St+45*00#") == b"1"
        before = bridge.clock()
        assert (await client.ask(b":Sr06:00:00#:Sd+50*00:00#:MS#", ending=b"0")).endswith(b"0")
        assert bridge.clock() - before < 1.0


async def test_goto_waits_for_the_time_that_another_program_is_still_setting() -> None:
    """The time of day was acknowledged, and goes to the mount two seconds later."""
    async with meade() as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.9")
        assert await client.ask(SLOW) == b"1"
        target = as_lx200(*at_altitude(bridge, 100.0, 25.0))
        reply = await other.ask(target, ending=b"#")
        assert b"Below" in reply, reply
        assert order(bridge) == ["set"]


async def test_arrow_is_not_begun_between_the_commands_of_a_clock() -> None:
    async with meade() as bridge:
        client = bridge.client()
        await client.ask(b":SG+00#:SL21:59:00#:SC01/15/26#", ending=b"#")
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2.0)
        heard = [one for one in bridge.sent_requests() if one.startswith((*SETS["lx200"], b":Mn"))]
        assert heard in ([b":Mn#"], [b":SG+00.0#", b":SL21:59:00#", b":SC01/15/26#", b":Mn#"])


async def test_stellarium_goto_during_a_clock_change_is_carried_out_afterwards() -> None:
    """Its message has no reply: it is not refused while the mount takes a clock for ten seconds."""
    config = {"lowest": LOWEST, "sun": 0.0}
    async with Bridge("lx200", driven="lx200", presented="stellarium", surface=None, config=config) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.SetClock(bridge.clock() + 86400.0 + 30.0, 0.0))
        ra, dec = at_altitude(bridge, 180.0, 50.0)
        place = struct.pack("<Ii", int(ra / 360.0 * 2**32), int(dec / 90.0 * 2**30))
        client.send(struct.pack("<HHQ", 20, 0, 0) + place)
        await asyncio.sleep(25.0)
        assert order(bridge) == ["set", "goto"]
