"""Which way arrows and guide pulses go, on every build with ``--whole``."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import az_alt_rates_by_dec, az_alt_rates_by_ha, hour_angle_to_horizon, wrap180
from gateway.protocols.mechanics.truth import truth_of
from gateway.protocols.nexstar.driver.altaz import MAX_SLOW_SPEED
from tests.support import sampling
from tests.support.directions import NORTH, SOUTH, Scenario, on_the_axes, play, scenarios
from tests.support.in_process_gateway import Bridge

#: A fork on the meridian at 45 degrees of altitude and of latitude: its azimuth follows the stars at 21.27"/s, 85 as a
#: variable rate (quarters of an arcsecond), its altitude stands still. Half of sidereal is 7.52"/s.
FOLLOWS, STANDS = b"P\x03\x10\x06\x00\x55\0\0", b"P\x03\x11\x06\0\0\0\0"


def fork(**config: Any) -> Bridge:
    """On the meridian, with a line that takes no time."""
    return Bridge("cpc", "4.21", surface="lx200gps", latency=0.0, config={"sun": 0.0, **config})


def motions(bridge: Bridge, since: int) -> list[bytes]:
    """What changed the mount."""
    return [data for data in bridge.sent_requests()[since:] if data[:1] in b"PTM"]


# --- the sky from the axes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("latitude", [45.0, -34.0, 5.0])
@pytest.mark.parametrize(("hour_angle", "dec"), [(-50.0, 20.0), (30.0, -15.0), (100.0, 60.0), (-5.0, -40.0)])
def test_computed_axis_rates_match_the_slopes_of_the_coordinates(
    latitude: float, hour_angle: float, dec: float
) -> None:
    small = 1e-5
    az, alt = hour_angle_to_horizon(hour_angle, dec, latitude)
    for rates, step in ((az_alt_rates_by_ha, (small, 0.0)), (az_alt_rates_by_dec, (0.0, small))):
        later = hour_angle_to_horizon(hour_angle + step[0], dec + step[1], latitude)
        slope = wrap180(later[0] - az) / small, (later[1] - alt) / small
        assert rates(az, alt, latitude) == pytest.approx(slope, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("place", [(0.0, 90.0), (180.0, 90.0), (0.0, 45.0)])
def test_computed_axis_rates_are_finite_at_the_zenith_and_the_pole(place: tuple[float, float]) -> None:
    assert all(
        abs(rate) <= 100.0 for rates in (az_alt_rates_by_ha, az_alt_rates_by_dec) for rate in rates(*place, 45.0)
    )


# --- alt-az: on top of tracking -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arrow", "first", "second"),
    [
        (b"w", b"P\x03\x10\x06\x00\x73\0\0", STANDS),  # 21.27 + 7.52
        (b"e", b"P\x03\x10\x06\x00\x37\0\0", STANDS),  # 21.27 - 7.52
        (b"n", b"P\x03\x11\x06\x00\x1e\0\0", FOLLOWS),
        (b"s", b"P\x03\x11\x07\x00\x1e\0\0", FOLLOWS),
    ],
)
async def test_slow_arrow_adds_to_the_tracking_of_both_axes(arrow: bytes, first: bytes, second: bytes) -> None:
    async with fork() as bridge:
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":RG#:M%s#" % arrow)
        await asyncio.sleep(2.0)
        assert motions(bridge, before) == [b"T\0", first, second]
        client.send(b":Q%s#" % arrow)
        await asyncio.sleep(0.1)
        axes = (b"\x10", b"\x11") if arrow in b"ew" else (b"\x11", b"\x10")
        assert motions(bridge, before)[3:] == [*(b"P\x02%s\x24\0\0\0\0" % axis for axis in axes), b"T\x01"]
        await asyncio.sleep(1.0)
        assert bridge.sim.tracking


async def test_releasing_one_of_two_slow_arrows_leaves_the_other_moving() -> None:
    async with fork() as bridge:
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":RG#:Mw#")
        await asyncio.sleep(1.0)
        client.send(b":Mn#")
        await asyncio.sleep(1.0)
        west, north = b"P\x03\x10\x06\x00\x73\0\0", b"P\x03\x11\x06\x00\x1e\0\0"
        assert motions(bridge, before) == [b"T\0", west, STANDS, north, west]
        client.send(b":Qw#")
        await asyncio.sleep(1.0)
        assert motions(bridge, before)[5:] == [FOLLOWS, north], "the other one goes on, on top of tracking"
        client.send(b":Qn#")
        await asyncio.sleep(1.0)
        assert motions(bridge, before)[-1] == b"T\x01"
        assert bridge.sim.tracking


async def test_fast_arrow_leaves_a_slow_arrow_alone_and_its_axis_then_tracks_again() -> None:
    async with fork() as bridge:
        client = bridge.client()
        client.send(b":RG#:Mn#")
        await asyncio.sleep(1.0)
        client.send(b":RM#:Mw#")
        await asyncio.sleep(1.0)
        assert truth_of(bridge.sim).rate1 == pytest.approx(1.0, rel=0.01)
        assert truth_of(bridge.sim).rate2 == pytest.approx(7.5205 / 3600, rel=0.02)
        client.send(b":Qw#")
        await asyncio.sleep(2.0)
        assert truth_of(bridge.sim).rate1 == pytest.approx(21.3 / 3600, rel=0.03)
        client.send(b":Q#")
        await asyncio.sleep(2.0)
        assert bridge.sim.tracking and not truth_of(bridge.sim).moving


async def test_slow_arrow_without_tracking_turns_only_its_motor() -> None:
    async with fork() as bridge:
        client = bridge.client()
        client.send(b":AL#")
        await asyncio.sleep(2.0)
        before = len(bridge.sent_requests())
        client.send(b":RG#:Mw#")
        await asyncio.sleep(1.0)
        client.send(b":Qw#")
        await asyncio.sleep(1.0)
        assert motions(bridge, before) == [b"P\x02\x10\x24\x01\0\0\0", b"P\x02\x10\x24\0\0\0\0"]
        assert not bridge.sim.tracking


@pytest.mark.parametrize(
    ("config", "pulse", "first", "second"),
    [
        ({}, b"w", b"P\x03\x10\x06\x00\x73\0\0", STANDS),
        ({}, b"n", b"P\x03\x11\x06\x00\x1e\0\0", FOLLOWS),
        ({"guide_directions": "sky"}, b"w", b"P\x03\x10\x06\x00\x80\0\0", STANDS),  # half as fast again
        ({"guide_directions": "sky"}, b"e", b"P\x03\x10\x06\x00\x2b\0\0", STANDS),
        ({"guide_directions": "sky"}, b"s", b"P\x03\x11\x07\x00\x1e\0\0", FOLLOWS),
    ],
)
async def test_alt_az_guide_pulse_ends_in_tracking_without_a_standstill(
    config: dict[str, Any], pulse: bytes, first: bytes, second: bytes
) -> None:
    async with fork(**config) as bridge:
        bridge.driver.motor_delay = 0.0  # nothing stands still while this line tells both motors
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":Mg%s1000#" % pulse)
        await asyncio.sleep(0.9)
        assert motions(bridge, before) == [b"T\0", first, second]
        await asyncio.sleep(0.3)
        back = [FOLLOWS, STANDS] if pulse in b"ew" else [STANDS, FOLLOWS]
        assert motions(bridge, before)[3:] == [*back, b"T\x01"]
        assert bridge.sim.tracking and not truth_of(bridge.sim).moving


async def test_two_simultaneous_pulses_add_up_on_both_axes() -> None:
    """PHD2 may send both; to the south-east both of them turn both axes."""
    async with Bridge("cpc", "4.21", latency=0.02, config={"sun": 0.0, "guide_directions": "sky"}) as bridge:
        client = bridge.client()
        await client.ask(b":Sz130*00#:Sa+40*00#:MA#", ending=b"0")
        await asyncio.sleep(60.0)
        before = truth_of(bridge.sim)
        began = bridge.sim.true_position()
        client.send(b":Mgw2000#:Mgn2000#")
        await asyncio.sleep(6.0)
        ended = bridge.sim.true_position()
        assert truth_of(bridge.sim).t > before.t and bridge.sim.tracking
        assert wrap180(began[0] - ended[0]) * 3600 == pytest.approx(15.04, rel=0.15)
        assert (ended[1] - began[1]) * 3600 == pytest.approx(15.04, rel=0.15)


@pytest.mark.parametrize("latency", [0.02, 0.05])
@pytest.mark.parametrize("pulse", [b"n", b"e"])
@pytest.mark.parametrize("ms", [100, 300])
async def test_short_guide_pulses_last_as_long_as_requested(latency: float, pulse: bytes, ms: int) -> None:
    """To tell two motors takes longer, and tracking stands still meanwhile: both are made up for."""
    async with Bridge("cpc", "4.21", latency=latency, config={"sun": 0.0}) as bridge:
        client = bridge.client()
        await client.ask(b":Sz130*00#:Sa+40*00#:MA#", ending=b"0")
        await asyncio.sleep(60.0)
        for learning in (True, False):
            before = truth_of(bridge.sim)
            for _ in range(1 if learning else 5):
                client.send(b":Mg%s%04d#" % (pulse, ms))
                await asyncio.sleep(3.0)
        first, second = on_the_axes(before, truth_of(bridge.sim), NORTH, True)
        asked = 5 * ms / 1000.0 * 7.5205 * (1 if pulse == b"n" else -1)
        along, across = (second, first) if pulse == b"n" else (first, second)
        assert along * 3600 == pytest.approx(asked, abs=0.15 * abs(asked) + 1.0)
        assert abs(across) * 3600 < 5 * 0.7


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.05, 0.15])
async def test_first_guide_pulse_leaves_the_other_axis_tracking(latency: float) -> None:
    """How long the line takes was guessed for it: over a fast line the azimuth ran 2" ahead of the stars."""
    async with Bridge("cpc", "4.21", latency=latency, config={"sun": 0.0}) as bridge:
        before = truth_of(bridge.sim)
        bridge.client().send(b":Mgn2000#")
        await asyncio.sleep(6.0)
        across, along = on_the_axes(before, truth_of(bridge.sim), NORTH, True)
        assert along * 3600 == pytest.approx(15.04, abs=0.5)
        assert abs(across) * 3600 < 0.7


@pytest.mark.parametrize("end", [b":Q#", b":Qw#", b":Sr05:00:00#:Sd+20*00:00#:MS#"])
@pytest.mark.parametrize("motion", [b":RG#:Mw#", b":Mgw3000#"])
async def test_stop_or_goto_ends_a_guide_pulse_and_restores_tracking(motion: bytes, end: bytes) -> None:
    async with fork() as bridge:
        client = bridge.client()
        client.send(motion)
        await asyncio.sleep(1.0)
        client.send(end)
        await asyncio.sleep(90.0)
        assert bridge.sim.tracking and not truth_of(bridge.sim).moving
        since = len(bridge.sent_requests())
        await asyncio.sleep(5.0)
        assert not motions(bridge, since), "nothing of it is left"


@pytest.mark.parametrize(
    ("mount", "version", "config", "words"),
    [
        ("nexstar-gps", "2.2", {}, "give --mode"),
        ("slt", "4.03", {"site": None}, ""),
        ("gt", "101.0", {}, "before 1.6"),
        ("nexstar-gps", "1.6", {"mode": "alt-az"}, "give it with --site"),
    ],
)
async def test_guide_pulse_that_cannot_be_done_is_refused_with_a_reason(
    mount: str, version: str, config: dict[str, Any], words: str
) -> None:
    """An SLT tells its site itself; a NexStar GPS its GPS unit's, while it has a fix."""
    async with Bridge(mount, version, config={"sun": 0.0, **config}) as bridge:
        if mount == "nexstar-gps" and words.endswith("--site"):
            bridge.driver.site = None
        since = len(bridge.sent_requests())
        bridge.client().send(b":Mgw1000#")
        await asyncio.sleep(2.0)
        sent = motions(bridge, since)
        told = [entry.note for entry in bridge.entries if "guid" in entry.note.lower() or "latitude" in entry.note]
        assert bool(sent) is (mount == "slt")
        assert bool(told) is (mount != "slt")
        assert all(words in note for note in told)


@pytest.mark.parametrize(("aligned", "words"), [(False, "is not aligned"), (True, "does not track")])
async def test_guide_refusal_on_a_german_mount_does_not_call_it_alt_az(aligned: bool, words: str) -> None:
    async with Bridge("cge", "4.21", aligned=aligned, config={"sun": 0.0}) as bridge:
        client = bridge.client()
        client.send(b":AL#")
        await asyncio.sleep(2.0)
        since = len(bridge.sent_requests())
        client.send(b":Mgn0500#")
        await asyncio.sleep(2.0)
        assert not motions(bridge, since)
        (told,) = [entry.note for entry in bridge.entries if "guide" in entry.note]
        assert words in told and "alt-az" not in told


async def test_arrow_above_the_tracking_limit_turns_only_its_motor() -> None:
    async with fork() as bridge:
        client, before = bridge.client(), len(bridge.sent_requests())
        client.send(b":RM#:Mw#")
        await asyncio.sleep(1.0)
        assert motions(bridge, before) == [b"T\0", b"P\x02\x10\x24\x07\0\0\0"]
        assert MAX_SLOW_SPEED < 1.0


# --- a German mount: the motor or the sky -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("guide", "side", "command"),
    [("motor", "east", 36), ("motor", "west", 36), ("sky", "east", 36), ("sky", "west", 37)],
)
async def test_guide_pulse_north_goes_by_the_motor_or_sky_as_configured(guide: str, side: str, command: int) -> None:
    async with Bridge("cge", "4.21", latency=0.0, config={"sun": 0.0, "guide_directions": guide}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock()) / 15.0
        hours = (sidereal + (-2.0 if side == "east" else 2.0)) % 24.0
        target = b":Sr%02d:%02d:00#:Sd+30*00:00#:MS#" % (int(hours), int(hours % 1 * 60))
        await client.ask(target, ending=b"0")
        await asyncio.sleep(90.0)
        since = len(bridge.sent_requests())
        client.send(b":Mgn1000#")
        await asyncio.sleep(2.0)
        assert bytes((80, 2, 17, command, 1, 0, 0, 0)) in motions(bridge, since)


# --- a Meade: motor sense -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("site", "up"), [(NORTH, b":Mn#"), (SOUTH, b":Ms#")])
async def test_second_motor_of_a_polar_fork_turns_towards_the_elevated_pole(
    site: tuple[float, float], up: bytes
) -> None:
    async with Bridge("lx200", driven="lx200", presented="nexstar", surface="cpc", site=site) as bridge:
        client, since = bridge.client(), len(bridge.sent_requests())
        await client.ask(b"P\x02\x11\x24\x04\0\0\0")
        await asyncio.sleep(1.0)
        assert up in bridge.sent_requests()[since:]
        await client.ask(b"P\x02\x11\x24\0\0\0\0")
        await asyncio.sleep(1.0)


# --- all of it, in short ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "case",
    [
        Scenario("lx200", "cpc", "4.21", "fork", SOUTH),
        Scenario("lx200", "cge", "4.21", "german west", NORTH, "sky"),
        Scenario("lx200", "avx", "5.31", "german east", SOUTH),
        Scenario("lx200", "cpc", "4.21", "alt-az", NORTH, "sky"),
        Scenario("lx200", "slt", "4.03", "alt-az", SOUTH),
        Scenario("nexstar", "lx200gps", None, "fork", SOUTH),
        Scenario("nexstar", "autostar", None, "german west", NORTH),
        Scenario("nexstar", "autostar", None, "alt-az", SOUTH),
    ]
    if not sampling.WHOLE
    else list(scenarios()),
    ids=str,
)
def test_arrow_and_guide_pulse_move_the_tube_the_right_way_on_the_sky(case: Scenario) -> None:
    assert not [row for row in play(case) if not row.right]
