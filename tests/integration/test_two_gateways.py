"""Two gateways in a row are the identity, within half a tick of the coarser field; UTC is exact.

NexStar program -> NexStar surface -> LX200 driver -> LX200 surface -> NexStar driver -> simulated hand control, and the
mirror image onto a simulated Meade.
"""

from __future__ import annotations

import asyncio
import calendar
import random
import zoneinfo
from datetime import UTC, datetime, timedelta
from functools import cache

import pytest

from gateway.astro.spherical import separation
from tests.support.in_process_gateway import Bridge
from tests.support.sampling import as_a_rule
from tests.support.two_gateways import TwoGateways, equatorial
from tests.support.typed_programs import degrees_of, nexstar_angle, nexstar_clock, unix_of

ARCSECOND = 1.0 / 3600.0
#: Half a tick of HH:MM:SS and of sDD*MM:SS, and of 24 bits on the way.
RA_HALF, DEC_HALF = 7.5 * ARCSECOND + 3e-5, 0.5 * ARCSECOND + 3e-5
INSTANTS = ["2026-01-15 22:00:00", "2026-07-15 22:00:00", "2026-12-31 23:59:40", "2027-01-01 00:00:20"]


@cache
def offsets() -> list[float]:
    """Every UTC offset in use today, in hours, both daylight-saving states."""
    moments = [datetime(2026, month, 15, tzinfo=UTC) for month in (1, 7)]
    found = {
        moment.astimezone(zoneinfo.ZoneInfo(name)).utcoffset()
        for name in zoneinfo.available_timezones()
        for moment in moments
    }
    return sorted(delta.total_seconds() / 3600 for delta in found if delta is not None)


def places(count: int) -> list[tuple[float, float]]:
    """Places all over the sky, the poles and the equinox included."""
    chance = random.Random(20260115)
    spread = [(chance.uniform(0, 360), chance.uniform(-89.9, 89.9)) for _ in range(count)]
    return [(0.0, 0.0), (359.999, -0.0001), (83.63, 89.99), (180.0, -89.99), (0.002, 0.4), (12.0, -0.4), *spread]


def hex_place(ra: float, dec: float) -> bytes:
    return b"%06X00,%06X00" % (round(ra / 360 * 2**24) % 2**24, round(dec / 360 * 2**24) % 2**24)


def test_time_zones_of_these_tests_include_quarter_hours() -> None:
    found = offsets()
    assert {-3.5, 5.5, 5.75, 8.75, 9.5, 12.75, 13.75} & set(found) >= {5.5, 5.75, 8.75, 9.5, 12.75}


async def test_positions_of_a_nexstar_program_reach_a_nexstar_mount_unchanged() -> None:
    bridge = Bridge("cge", config={"lowest": -90.0}, latency=0.0)
    async with TwoGateways(bridge, "lx200", "nexstar", "cge") as chain:
        client = chain.client()
        for ra, dec in places(as_a_rule(24, whole=60)):
            assert await client.ask(b"r" + hex_place(ra, dec)) == b"#"
            await asyncio.sleep(1.0)
            last = next(sent for sent in reversed(bridge.sent_requests()) if sent[:1] == b"r")
            there = equatorial(last[1:] + b"#")
            assert abs((there.ra - ra + 180) % 360 - 180) <= RA_HALF, (ra, dec, there)
            assert abs(there.dec - dec) <= DEC_HALF, (ra, dec, there)
            await client.ask(b"M")
            await asyncio.sleep(0.5)


async def test_sites_of_the_whole_globe_reach_a_nexstar_mount_unchanged() -> None:
    bridge = Bridge(aligned=False, latency=0.0)
    async with TwoGateways(bridge, "lx200", "nexstar", "6-8se") as chain:
        client = chain.client()
        chance = random.Random(7)
        corners = [(0.5, -0.5), (-0.5, 0.5), (89.99, 179.99), (-89.99, -179.99), (0.0, 180.0)]
        sites = corners + [(chance.uniform(-90, 90), chance.uniform(-180, 180)) for _ in range(as_a_rule(15, whole=40))]
        for latitude, longitude in sites:
            assert await client.ask(b"W" + nexstar_angle(latitude) + nexstar_angle(longitude)) == b"#"
            await asyncio.sleep(3.0)
            told = bridge.sim.feed(b"w")
            here = degrees_of(told[:4]), degrees_of(told[4:8])
            # the field between them has arcminutes
            assert abs(here[0] - latitude) <= 31 * ARCSECOND, (latitude, longitude, here)
            assert abs((here[1] - longitude + 180) % 360 - 180) <= 31 * ARCSECOND, (latitude, longitude, here)


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize("instant", INSTANTS)
async def test_utc_of_a_nexstar_program_reaches_a_nexstar_mount_exactly(instant: str) -> None:
    whole = [hours for hours in offsets() if hours == int(hours)]
    bridge = Bridge(aligned=False, latency=0.0)
    async with TwoGateways(bridge, "lx200", "nexstar", "6-8se") as chain:
        client = chain.client()
        moment = datetime.fromisoformat(instant)
        each = INSTANTS.index(instant) // 2 % 2  # of two that are played one has each zone with, one without
        for number, hours in enumerate(whole):
            for dst in as_a_rule(((number + each) % 2,), whole=(0, 1)):
                local = moment + timedelta(hours=hours)
                sent_at = asyncio.get_running_loop().time()
                assert await client.ask(b"H" + nexstar_clock(local, hours, dst)) == b"#"
                await asyncio.sleep(4.0)
                passed = asyncio.get_running_loop().time() - sent_at
                assert abs(unix_of(bridge.sim.feed(b"h")) - calendar.timegm(moment.timetuple()) - passed) <= 1.1


@pytest.mark.parametrize("instant", INSTANTS)
async def test_utc_of_an_lx200_program_reaches_a_nexstar_mount_from_every_zone(instant: str) -> None:
    async with Bridge(aligned=False, latency=0.0) as bridge:
        client = bridge.client()
        moment = datetime.fromisoformat(instant)
        for hours in offsets():
            shown = f"{-hours:+05.1f}"  # tenths are all there are: 5.75 goes out as 5.8, and is read as 5.75
            local = moment + timedelta(hours=hours)
            sent_at = asyncio.get_running_loop().time()
            command = f":SG{shown}#:SL{local:%H:%M:%S}#:SC{local:%m/%d/%y}#".encode()
            assert (await client.ask(command, ending=b" #")).startswith(b"111")
            await asyncio.sleep(2.0)
            passed = asyncio.get_running_loop().time() - sent_at
            assert abs(unix_of(bridge.sim.feed(b"h")) - calendar.timegm(moment.timetuple()) - passed) <= 1.1, hours


async def test_positions_survive_a_round_trip_within_a_second_of_time() -> None:
    bridge = Bridge("cge", latency=0.0)
    async with TwoGateways(bridge, "lx200", "nexstar", "cge") as chain:
        client = chain.client()
        told = equatorial(await client.ask(b"e"))
        truth = bridge.sim.true_position()
        assert separation(told.ra, told.dec, *truth) < 10 * ARCSECOND


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
async def test_positions_of_an_lx200_program_reach_a_meade_through_a_nexstar_surface(model: str) -> None:
    """LX200 program -> LX200 surface -> NexStar driver -> NexStar surface -> LX200 driver -> simulated Meade."""
    bridge = Bridge(model, driven="lx200", presented="nexstar", surface=None, latency=0.0, config={"lowest": -90.0})
    async with TwoGateways(bridge, "nexstar", "lx200", "autostar") as chain:
        client = chain.client()
        chance = random.Random(5)
        for _ in range(as_a_rule(8, whole=15)):
            seconds, arcseconds = chance.randrange(86400), chance.randrange(-320000, 320000)
            h, m, s = seconds // 3600, seconds // 60 % 60, seconds % 60
            a = abs(arcseconds)
            dec = f"{'-' if arcseconds < 0 else '+'}{a // 3600:02d}*{a // 60 % 60:02d}:{a % 60:02d}"
            command = f":Sr{h:02d}:{m:02d}:{s:02d}#:Sd{dec}#:MS#".encode()
            assert (await client.ask(command, 5, ending=b"110")).startswith(b"11")
            await asyncio.sleep(1.0)
            sent = bridge.sent_requests()
            # the identity, to the byte
            assert f":Sr{h:02d}:{m:02d}:{s:02d}#".encode() in sent
            assert f":Sd{dec}#".encode() in sent
            client.send(b":Q#")
            await asyncio.sleep(0.5)


@pytest.mark.parametrize("model", ["autostar", "lx200gps"])
@pytest.mark.parametrize("instant", INSTANTS)
async def test_utc_of_an_lx200_program_reaches_a_meade_from_every_zone(model: str, instant: str) -> None:
    bridge = Bridge(model, driven="lx200", presented="nexstar", surface=None, latency=0.0, aligned=False)
    async with TwoGateways(bridge, "nexstar", "lx200", "autostar") as chain:
        client = chain.client()
        moment = datetime.fromisoformat(instant)
        for hours in offsets()[INSTANTS.index(instant) % as_a_rule(2, whole=1) :: as_a_rule(2, whole=1)]:
            local = moment + timedelta(hours=hours)
            sent_at = asyncio.get_running_loop().time()
            command = f":SG{-hours:+05.1f}#:SL{local:%H:%M:%S}#:SC{local:%m/%d/%y}#".encode()
            assert (await client.ask(command, ending=b" #")).startswith(b"111")
            await asyncio.sleep(4.0)
            passed = asyncio.get_running_loop().time() - sent_at
            bridge.sim.feed(b"")  # come to now
            assert abs(bridge.sim.utc() - calendar.timegm(moment.timetuple()) - passed) <= 1.5, hours


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
async def test_sites_of_an_lx200_program_reach_a_meade_unchanged(model: str) -> None:
    bridge = Bridge(model, driven="lx200", presented="nexstar", surface=None, latency=0.0, aligned=False)
    async with TwoGateways(bridge, "nexstar", "lx200", "autostar") as chain:
        client = chain.client()
        chance = random.Random(9)
        for _ in range(as_a_rule(12, whole=25)):
            north, west = chance.randrange(-5400, 5401), chance.randrange(0, 21600)
            sign = "-" if north < 0 else "+"
            command = f":St{sign}{abs(north) // 60:02d}*{abs(north) % 60:02d}#:Sg{west // 60:03d}*{west % 60:02d}#"
            assert await client.ask(command.encode(), ending=b"11") == b"11"
            await asyncio.sleep(4.0)
            if model in ("autostar", "lx200gps"):  # an unaligned one is told; it has whole arcminutes
                assert bridge.sim.site[0] == pytest.approx(north / 60, abs=1e-6)
                assert abs((bridge.sim.site[1] + west / 60 + 180) % 360 - 180) < 1e-6
            told = await client.ask(b":Gt#")
            assert told == f"{sign}{abs(north) // 60:02d}*{abs(north) % 60:02d}#".encode()
