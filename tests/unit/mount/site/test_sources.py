"""The limits go by the best source of site and time: no program's word switches them off, and contradictions are named.

Sites and clocks are set by the manuals' own bytes. The simulated mounts stand at 45 N, 10 E and keep the true time.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.presence import NO_PROGRAM
from gateway.mount.safety.admission.contradictions import contradictions
from gateway.mount.site.readers import SiteView
from gateway.mount.site.site_clock import (
    COMPUTER_SOURCE,
    CONFIG_SOURCE,
    GPS_SOURCE,
    MOUNT_SOURCE,
    PROGRAM,
    SiteClock,
    SiteTimeSources,
)
from tests.integration.safety.test_sun import JUNE, SKY
from tests.support.each import each
from tests.support.in_process_gateway import EVENING, Bridge

LIMIT = 10.0

#: What programs get wrong -> the bytes by which they tell it; 22:00 UTC on 2026-01-15 is right.
LX200 = {
    "another latitude": b":St+10*00#",
    "longitude with the wrong sign": b":Sg010*00#",
    "Greenwich": b":St+51*29#:Sg000*00#",
    "latitude and longitude swapped": b":St+10*00#:Sg315*00#",
    "three hours slow": b":SG+00#:SL19:00:00#:SC01/15/26#",
    "morning instead of evening": b":SG+00#:SL10:00:00#:SC01/15/26#",
    "the zone with the wrong sign": b":SG+01#:SL23:00:00#:SC01/15/26#",
    "a date of 1970": b":SG+00#:SL00:00:00#:SC01/01/70#",
}
NEXSTAR = {
    "another longitude": b"W" + bytes((45, 0, 0, 0, 40, 0, 0, 1)),
    "three hours slow": b"H" + bytes((19, 0, 0, 1, 15, 26, 0, 0)),
}


def low_target(bridge: Any, altitude: float = 2.0) -> tuple[float, float]:
    """Right ascension and declination, degrees, of a place that truly stands so high in the south-west."""
    hour_angle, dec = horizon_to_hour_angle(225.0, altitude, 45.0)
    return (bridge.sim.mechanics.sky.lst(bridge.clock()) - hour_angle) % 360.0, dec


def as_lx200(ra: float, dec: float) -> bytes:
    """The target and ``:MS#``."""
    hours, degrees = round(ra / 15.0 * 3600) % 86400, round(abs(dec) * 3600)
    return b":Sr%02d:%02d:%02d#:Sd%s%02d*%02d:%02d#:MS#" % (
        hours // 3600,
        hours // 60 % 60,
        hours % 60,
        b"-" if dec < 0 else b"+",
        degrees // 3600,
        degrees // 60 % 60,
        degrees % 60,
    )


def altitude(bridge: Any) -> float:
    """How high the tube truly points."""
    now, mechanics = bridge.clock(), bridge.sim.mechanics
    ra, dec = mechanics.true_position(now)
    return hour_angle_to_horizon(mechanics.sky.lst(now) - ra, dec, 45.0)[1]


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize("wrong", LX200)
async def test_no_lx200_program_switches_a_limit_off(mount: str, wrong: str) -> None:
    async with Bridge(mount, config={"lowest": LIMIT}) as bridge:
        client = bridge.client()
        await client.ask(LX200[wrong])
        await asyncio.sleep(3.0)
        reply = await client.ask(as_lx200(*low_target(bridge)), ending=b"#")
        assert reply.startswith(b"111Object Below Lower Limit."), reply
        await asyncio.sleep(20.0)
        assert altitude(bridge) > LIMIT


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize("wrong", NEXSTAR)
async def test_no_nexstar_program_switches_a_limit_off(mount: str, wrong: str) -> None:
    async with Bridge(mount, config={"lowest": LIMIT}, presented="nexstar", surface="cpc") as bridge:
        client = bridge.client()
        assert await client.ask(NEXSTAR[wrong]) == b"#"
        await asyncio.sleep(3.0)
        ra, dec = low_target(bridge)
        await client.ask(b"r%08X,%08X" % (int(ra / 360 * 2**32), int(dec % 360 / 360 * 2**32)))
        await asyncio.sleep(20.0)
        assert altitude(bridge) > LIMIT


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize("wrong", ["Greenwich", "morning instead of evening", "another latitude"])
async def test_wrong_site_or_time_permits_no_sun_goto(mount: str, wrong: str) -> None:
    """In June, when the Sun is 63 degrees high at 6h +23 26'."""
    async with Bridge(mount, start=JUNE) as bridge:
        client = bridge.client()
        await client.ask(b":Sg071*45#" if wrong == "Greenwich" else LX200[wrong])
        await asyncio.sleep(3.0)
        assert b"Sun" in await client.ask(b":Sr06:00:00#:Sd+23*26:00#:MS#", ending=b"#")
        await asyncio.sleep(20.0)
        assert separation(*bridge.sim.mechanics.true_position(bridge.clock()), *SKY.sun(bridge.clock())) > 20.0


@pytest.mark.parametrize("mount", ["cpc", "cge"])
async def test_wrong_time_from_a_program_ends_no_tracking_far_from_a_limit(mount: str) -> None:
    async with Bridge(mount, config={"lowest": LIMIT}) as bridge:
        client = bridge.client()
        await client.ask(as_lx200(*low_target(bridge, 55.0)), ending=b"0")
        await asyncio.sleep(30.0)
        await client.ask(b":SG+00#:SL10:00:00#:SC01/15/26#")
        for _ in range(60):
            await client.ask(b":GR#")
            await asyncio.sleep(1.0)
        assert bridge.sim.tracking
        assert altitude(bridge) == pytest.approx(55.0, abs=1.0)


async def test_reported_altitude_is_the_true_one_and_the_set_site_is_read_back() -> None:
    async with Bridge("cge", config={"lowest": LIMIT}) as bridge:
        client = bridge.client()
        await client.ask(as_lx200(*low_target(bridge, 40.0)), ending=b"0")
        await asyncio.sleep(40.0)
        await client.ask(b":St+10*00#")
        await asyncio.sleep(3.0)
        assert (await client.ask(b":Gt#")) == b"+10*00#"
        told = await client.ask(b":GA#")
        assert abs(int(told[1:3]) + int(told[4:6]) / 60 - altitude(bridge)) < 0.1


@pytest.mark.parametrize(
    ("site", "ahead", "words"),
    [
        ((10.0, -80.0), 0.0, b"the config (9224 km from the mount)"),
        (None, -21600.0, b"the computer (6.0 hours from the mount)"),
    ],
)
def test_goto_too_low_by_one_of_two_site_or_time_sources_is_refused(
    site: tuple[float, float] | None, ahead: float, words: bytes
) -> None:
    """30 degrees high in the south-east by the mount, below a written limit by the other source."""

    async def program() -> None:
        async with Bridge("cge", host_ahead=ahead, config={"site": site, "lowest": 1.0}) as bridge:
            client = bridge.client()
            hour_angle, dec = horizon_to_hour_angle(110.0, 30.0, 45.0)
            there = (bridge.sim.mechanics.sky.lst(bridge.clock()) - hour_angle) % 360.0, dec
            assert await client.ask(as_lx200(*there), ending=b"#") == b"112Too low by %s.#" % words
            assert not bridge.sim.slewing
            high = (bridge.sim.mechanics.sky.lst(bridge.clock()) - 20.0) % 360.0, 60.0
            if site is not None:
                return
            assert (await client.ask(as_lx200(*high), ending=b"0")).endswith(b"0"), "above the horizon by both"

    run(program())


@pytest.mark.parametrize(
    ("changed", "asked", "told"),
    [
        (b"W" + bytes((30, 0, 0, 0, 20, 0, 0, 0)), b":Gt#:Gg#", b"+30*00#-020*00#"),
        (b"H" + bytes((3, 0, 0, 1, 16, 26, 0, 0)), b":GC#", b"01/16/26#"),
    ],
)
async def test_site_or_time_set_at_the_hand_control_is_noticed_within_a_minute(
    changed: bytes, asked: bytes, told: bytes
) -> None:
    """Also after a program has set something else."""
    async with Bridge("cpc") as bridge:
        client = bridge.client()
        await client.ask(b":St+10*00#:SG+00#:SL19:00:00#:SC01/15/26#")
        bridge.sim.feed(changed)
        for _ in range(60):
            await client.ask(b":GR#")
            await asyncio.sleep(1.0)
        assert await client.ask(asked, ending=told[-3:]) == told
        assert any("changed at the mount" in entry.note for entry in bridge.entries)


# --- which source counts ----------------------------------------------------------------------------------------


def test_sources_rank_mount_gps_configuration_or_computer_and_programs_last() -> None:
    site_clock = SiteClock(lambda: 0.0, lambda: EVENING, None)
    best = SiteTimeSources(site_clock)
    SiteView(site_clock, NO_PROGRAM).store_site(op.SetSite(1.0, 1.0))
    SiteView(site_clock, NO_PROGRAM).store_clock(op.SetClock(EVENING + 1e4, 0.0))
    assert [site.source for site in best.sites()] == ["a program (2026-01-15)"]
    assert [time.source for time in best.times()] == [COMPUTER_SOURCE]
    site_clock.configured_site = op.Place(2.0, 2.0)
    site_clock.take_gps(op.Gps(linked=True, place=op.Place(3.0, 3.0), unix=EVENING + 2e4))
    site_clock.take_mount_site(op.Place(4.0, 4.0))
    site_clock.take_mount_clock(op.Moment(EVENING + 3e4, 0.0))
    assert [(site.source, site.place.latitude) for site in best.sites()] == [
        (MOUNT_SOURCE, 4.0),
        (GPS_SOURCE, 3.0),
        (CONFIG_SOURCE, 2.0),
    ]
    assert [(time.source, time.unix - EVENING) for time in best.times()] == [
        (MOUNT_SOURCE, 3e4),
        (GPS_SOURCE, 2e4),
        (COMPUTER_SOURCE, 0.0),
    ]
    assert len(list(contradictions(best.sites(), best.times()))) == 4


@each(
    ("host", "ahead", "told", "sources"),
    [
        (3600.0 - EVENING, None, False, [COMPUTER_SOURCE]),
        (3600.0 - EVENING, None, True, [PROGRAM, COMPUTER_SOURCE]),
        (3600.0 - EVENING, 0.0, True, [MOUNT_SOURCE]),
        (3600.0 - EVENING, 3700.0 - EVENING, True, [MOUNT_SOURCE, COMPUTER_SOURCE]),
        (0.0, 9999.0, True, [MOUNT_SOURCE, COMPUTER_SOURCE]),
        (0.0, None, True, [COMPUTER_SOURCE]),
    ],
)
def test_unset_computer_clock_counts_only_where_no_better_time_source_exists(
    host: float, ahead: float | None, told: bool, sources: list[str]
) -> None:
    """``host`` and ``ahead`` are by how much this computer's and the mount's clocks are ahead, None if it has none."""
    site_clock = SiteClock(lambda: 0.0, lambda: EVENING + host, None)
    best = SiteTimeSources(site_clock)
    if told:
        SiteView(site_clock, NO_PROGRAM).store_clock(op.SetClock(EVENING, 1.0))
    if ahead is not None:
        site_clock.take_mount_clock(op.Moment(EVENING + ahead, 0.0))
    assert [time.source for time in best.times()] == sources
    assert best.best_time().source == sources[0]
    site_clock.take_mount_site(op.Place(45.0, 10.0))
    doubtful = [time.doubtful for time in best.times()]
    assert doubtful == [
        source == COMPUTER_SOURCE and sources != [MOUNT_SOURCE, COMPUTER_SOURCE] and host != 0.0 for source in sources
    ]
    assert not any("computer" in one.text for one in contradictions(best.sites(), best.times())) or host == 0.0


def test_gps_without_a_fix_and_small_differences_cause_no_warning() -> None:
    site_clock = SiteClock(lambda: 0.0, lambda: EVENING + 60.0, op.Place(45.1, 10.1))
    best = SiteTimeSources(site_clock)
    site_clock.take_gps(op.Gps(linked=False, place=op.Place(0.0, 0.0), unix=0.0))
    site_clock.take_mount_site(op.Place(45.0, 10.0))
    site_clock.take_mount_clock(op.Moment(EVENING, 0.0))
    assert [site.source for site in best.sites()] == [MOUNT_SOURCE, CONFIG_SOURCE]
    assert not list(contradictions(best.sites(), best.times()))


@each(
    ("ahead", "doubted", "contradicts"),
    [(-7200.0, False, True), (20 * 86400.0, False, True), (-7200.0, True, False), (20 * 86400.0, True, False)],
)
def test_doubtful_computer_clock_is_not_reported_to_contradict_the_mount(
    ahead: float, doubted: bool, contradicts: bool
) -> None:
    """A Raspberry Pi without a clock of its own begins where it was switched off."""
    site_clock = SiteClock(lambda: 0.0, lambda: EVENING + ahead, None, "doubtful" if doubted else "auto")
    site_clock.take_mount_site(op.Place(45.0, 10.0))
    site_clock.take_mount_clock(op.Moment(EVENING, 0.0))
    best = SiteTimeSources(site_clock)
    assert bool(list(contradictions(best.sites(), best.times()))) is contradicts


GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
SINCE_1970 = -EVENING + 1000.0


@pytest.mark.parametrize(("sun", "told", "done"), [(20.0, False, False), (20.0, True, True), (0.0, False, True)])
async def test_goto_is_refused_at_unknown_time_if_sun_is_avoided(sun: float, told: bool, done: bool) -> None:
    config = {"lowest": -90.0, "sun": sun, "site": [45.0, 10.0]}
    async with Bridge("gt", "101.0", config=config, host_ahead=SINCE_1970) as bridge:
        client = bridge.client()
        if told:
            await client.ask(b":SG+00#:SL22:00:00#:SC01/15/26#", ending=b"#")
            await asyncio.sleep(3.0)
        reply = await client.ask(GOTO, ending=b"0" if done else b"#")
        assert reply.endswith(b"0" if done else b"#")
        assert (b"time is unknown" in reply.lower()) is not done
