"""The physical truth of a simulated mount: by other people's astronomy, and untouched by anything a client says."""

from __future__ import annotations

import asyncio
import json
import math
import os
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import median
from subprocess import TimeoutExpired
from typing import Any

import ephem
import pytest

from gateway.cli import main
from gateway.protocols.lx200.simulator.server import SimulatedLx200
from gateway.protocols.mechanics.truth import Truth, sample, truth_of
from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl
from tests.support.each import each
from tests.support.in_process_gateway import EVENING
from tests.support.process import Running, ask
from tests.support.simulated_meade import Clock

#: Day and night, north and south.
MOMENTS = [1768514400.0, 1782036000.0, 1799000000.0]
SITES = [(45.0, 10.0), (-33.9, 151.2)]


def mount(protocol: str, model: str, site: tuple[float, float] = SITES[0], start: float = EVENING, **more: Any) -> Any:
    clock = Clock()
    clock.now = start
    simulator: Any = (SimulatedHandControl if protocol == "nexstar" else SimulatedLx200)(
        model, clock=clock, site=site, **more
    )
    return simulator, clock


def put(simulator: Any, first: float, second: float) -> Truth:
    """Turn the axes there by their motors, tracking off."""
    mechanics, clock = simulator.mechanics, simulator.clock
    mechanics.track(clock.now, False)
    mechanics.goto_axes(clock.now, first, second)
    clock.now += 300.0
    return truth_of(simulator)


# --- what each field means ----------------------------------------------------------------------------------------


def test_true_position_of_a_new_alt_az_fork_is_its_switch_on_position() -> None:
    simulator, _ = mount("nexstar", "6-8se", aligned=False)
    seen = truth_of(simulator)
    assert (seen.t, seen.axis1, seen.axis2) == (EVENING, 180.0, 45.0)
    assert (seen.altitude, seen.azimuth) == pytest.approx((45.0, 180.0))
    assert seen.hour_angle == pytest.approx(0.0, abs=1e-9) and seen.past_meridian is None
    assert (seen.rate1, seen.rate2, seen.moving, seen.tracking) == (0.0, 0.0, False, False)


def test_true_azimuth_of_a_fork_tilted_beyond_the_zenith_is_turned_by_180() -> None:
    simulator, _ = mount("nexstar", "6-8se")
    seen = put(simulator, 180.0, 100.0)
    assert (seen.axis2, seen.altitude) == pytest.approx((100.0, 80.0))
    assert min(seen.azimuth, 360.0 - seen.azimuth) == pytest.approx(0.0, abs=1e-9)


@each(
    ("first", "second", "hour_angle", "dec", "past"),
    [
        (90.0, 90.0, None, 90.0, -90.0),  # as it is switched on: counterweight straight down
        (100.0, 60.0, 100.0, 60.0, -80.0),
        (10.0, 40.0, 10.0, 40.0, -10.0),
        (-10.0, 40.0, -10.0, 40.0, 10.0),  # looks west, and has passed the meridian towards the east
        (170.0, 140.0, -10.0, 40.0, -10.0),  # the same place from the other side of the pier
        (190.0, 140.0, 10.0, 40.0, 10.0),
    ],
)
def test_true_position_of_a_german_mount_beyond_its_meridian_is_on_the_other_side(
    first: float, second: float, hour_angle: float | None, dec: float, past: float
) -> None:
    """In the north axis 1 is the hour angle; past 90 degrees of axis 2 the tube is on the other side of the pier."""
    simulator, _ = mount("nexstar", "cge")
    simulator.feed(b"T\x00")
    simulator.mechanics.goto_axis(simulator.clock.now, 1, first)
    simulator.mechanics.goto_axis(simulator.clock.now, 2, second)
    simulator.clock.now += 300.0
    seen = truth_of(simulator)
    assert seen.past_meridian == pytest.approx(past)
    if hour_angle is not None:
        assert seen.hour_angle == pytest.approx(hour_angle)
    h, d, lat = math.radians(hour_angle or 0.0), math.radians(dec), math.radians(45.0)
    height = math.asin(math.sin(d) * math.sin(lat) + math.cos(d) * math.cos(lat) * math.cos(h))
    assert seen.altitude == pytest.approx(math.degrees(height))


@each("start", MOMENTS)
@each("site", SITES)
@each(("protocol", "model"), [("nexstar", "cpc"), ("nexstar", "cge"), ("lx200", "lx200")])
def test_true_position_agrees_with_pyephem(protocol: str, model: str, site: tuple[float, float], start: float) -> None:
    """PyEphem's sidereal time, horizon and Sun: the tube is seen where a star of that place would be."""
    simulator, _ = mount(protocol, model, site, start)
    chance = Random(1)
    for _ in range(5):
        seen = put(simulator, chance.uniform(0.0, 360.0), chance.uniform(-80.0, 80.0))
        here = ephem.Observer()
        here.lat, here.lon, here.pressure = math.radians(site[0]), math.radians(site[1]), 0
        here.date = ephem.Date(seen.t / 86400.0 + 25567.5)
        # ephem counts ra_of from altitude and azimuth at its own sidereal time; both in the equinox of date
        ra, dec = here.radec_of(math.radians(seen.azimuth), math.radians(seen.altitude))
        star = ephem.FixedBody()
        star._ra, star._dec, star._epoch = ra, dec, ephem.J2000
        star.compute(here)
        sun = ephem.Sun(here)
        assert (
            math.degrees(
                ephem.separation((star.az, star.alt), (math.radians(seen.azimuth), math.radians(seen.altitude)))
            )
            < 0.02
        )
        apart = ephem.separation((sun.az, sun.alt), (math.radians(seen.azimuth), math.radians(seen.altitude)))
        assert seen.sun_distance == pytest.approx(math.degrees(apart), abs=0.03)
        # of date, the right ascension of the tube is the sidereal time less its hour angle
        told_ra, told_dec = simulator.true_position()
        hour_angle = math.degrees(here.sidereal_time()) - told_ra
        assert abs((seen.hour_angle - hour_angle + 180.0) % 360.0 - 180.0) < 0.02
        d, h, lat = math.radians(told_dec), math.radians(hour_angle), math.radians(site[0])
        height = math.asin(math.sin(d) * math.sin(lat) + math.cos(d) * math.cos(lat) * math.cos(h))
        assert seen.altitude == pytest.approx(math.degrees(height), abs=0.02)


def test_truth_file_shows_the_rate_of_a_turning_axis() -> None:
    """Four degrees a second, reached in a second; the fork's other motor rests."""
    simulator, clock = mount("nexstar", "nexstar-gps", aligned=False)
    simulator.feed(b"P\x02\x11\x24\x09\0\0\0")
    seen = []
    for _ in range(4):
        clock.now += 0.5
        seen.append(truth_of(simulator))
    assert [one.rate2 for one in seen] == pytest.approx([2.0, 4.0, 4.0, 4.0], abs=1e-6)
    assert [one.axis2 for one in seen] == pytest.approx([45.5, 47.0, 49.0, 51.0], abs=1e-5)
    assert all(one.moving and not one.tracking and one.rate1 == 0.0 for one in seen)
    simulator.feed(b"P\x02\x11\x24\x00\0\0\0")
    clock.now += 0.5
    running_on = truth_of(simulator)
    assert running_on.moving and running_on.rate2 == pytest.approx(2.0, abs=1e-6)
    clock.now += 0.51
    rests = truth_of(simulator)
    assert not rests.moving and rests.rate2 == 0.0 and rests.axis2 == pytest.approx(53.0, abs=1e-4)


def test_truth_file_reports_a_guide_pulse_as_moving_but_not_tracking() -> None:
    simulator, clock = mount("nexstar", "cge")
    seen = truth_of(simulator)
    assert seen.tracking and not seen.moving
    assert seen.rate1 * 3600.0 == pytest.approx(15.041, abs=0.001)
    simulator.mechanics.pulse(clock.now, 2, 0.001, 1.0)
    clock.now += 0.5
    assert truth_of(simulator).moving and truth_of(simulator).rate2 == pytest.approx(0.001, abs=1e-6)
    clock.now += 1.0
    assert not truth_of(simulator).moving


def test_simulated_polar_mount_tracks_after_a_slow_declination_arrow() -> None:
    simulator, clock = mount("nexstar", "avx")
    simulator.feed(b"P\x03\x11\x06\x00\x1e\0\0")  # 7.5 arcseconds a second
    clock.now += 2.0
    assert truth_of(simulator).moving and not truth_of(simulator).tracking
    simulator.feed(b"P\x02\x11\x24\x00\0\0\0")
    clock.now += 2.0
    seen = truth_of(simulator)
    assert (seen.tracking, seen.moving, seen.rate2) == (True, False, 0.0)
    assert seen.rate1 * 3600.0 == pytest.approx(15.041, abs=0.001)


def test_simulated_alt_az_mount_does_not_track_right_after_an_arrow() -> None:
    """Both of its motors would have to follow the sky."""
    simulator, clock = mount("nexstar", "cpc")
    for key in (b"\x05", b"\x00"):
        simulator.feed(b"P\x02\x11\x24" + key + b"\0\0\0")
        clock.now += 2.0
    assert not truth_of(simulator).tracking


# --- what cannot change it ------------------------------------------------------------------------------------------

#: Sites, clocks, syncs, axis readings, restarts: all that a client may say without turning a motor.
NEXSTAR = [
    b"W\x21\x38\x33\x01\x97\x0c\x07\x00",
    b"H\x01\x02\x03\x04\x05\x1e\x00\x00",
    b"I\x01\x02\x03\x04\x05\x1e\x10\x00",
    b"s34AB0500,12CE0500",
    b"S34AB,12CE",
    b"u",
    b"P\x03\xb2\x83\x03\x04\0\0",
    b"P\x03\xb2\x84\x07\xdf\0\0",
    b"P\x04\xb2\xb3\x01\x02\x03\0",
    b"P\x04\x10\x04\x40\x00\x00\0",
    b"P\x04\x11\x04\x20\x00\x00\0",
    b"T\x00",
]
LX200 = [
    b":St-33*52#", b":Sg209*00#", b":SG+05#", b":SL03:04:05#", b":SC04/05/30#", b":W2#", b":St+10*00#", b":W1#",
    b":SS12:00:00#", b":Sr05:00:00#:Sd+20*00#:CM#", b":Sr06:00:00#:Sd-20*00#:CL#", b":hI300405010203#", b":gT#",
    b":AP#:AL#", b":AA#:AL#", b":AP#:AL#", b":So10#", b":Sh80#", b":U#", b":I#:AL#",
]  # fmt: skip


def unmoved(simulator: Any, clock: Clock, words: list[bytes]) -> None:
    before = truth_of(simulator)
    believed = simulator.mechanics.believed_position(clock.now)
    for word in words:
        simulator.feed(word)
        clock.now += 0.5
        seen = truth_of(simulator)
        assert (seen.altitude, seen.hour_angle) == pytest.approx((before.altitude, before.hour_angle), abs=2e-3), word
        assert abs((seen.azimuth - before.azimuth + 180.0) % 360.0 - 180.0) < 4e-3, word
        assert seen.t == clock.now and not seen.tracking
    assert seen.sun_distance == pytest.approx(before.sun_distance, abs=0.01 + 15.1 / 3600.0 * (clock.now - before.t))
    assert simulator.mechanics.believed_position(clock.now) != believed  # it did hear them


@each("model", ["cpc", "cge", "6-8se", "cgx"])
@each("aligned", [True, False])
def test_no_nexstar_setting_changes_the_true_position(model: str, aligned: bool) -> None:
    simulator, clock = mount("nexstar", model, aligned=aligned)
    simulator.feed(b"T\x00")
    unmoved(simulator, clock, NEXSTAR)


@each("model", ["autostar", "lx200gps", "lx200-16"])
def test_no_lx200_setting_changes_the_true_position(model: str) -> None:
    """A fork is put on its wedge and taken off in between: by the belief of another latitude the tube would swing."""
    simulator, clock = mount("lx200", model)
    simulator.feed(b":AL#")
    put(simulator, 140.0, 35.0)
    unmoved(simulator, clock, LX200)


def test_simulated_alt_az_mount_with_a_wrong_site_drifts_off_its_star() -> None:
    """What the motors really do counts: told that it stands in the south, it follows a sky that is not there."""
    simulator, clock = mount("nexstar", "cpc")
    simulator.feed(b"W\x21\x38\x33\x01\x97\x0c\x07\x00")
    before = truth_of(simulator)
    clock.now += 600.0
    after = truth_of(simulator)
    assert after.tracking
    assert abs(after.hour_angle - before.hour_angle - 600.0 * 15.041 / 3600.0) > 0.5  # a star would be there


# --- sampling ---------------------------------------------------------------------------------------------------


async def test_truth_file_skips_the_time_for_which_the_computer_was_suspended() -> None:
    clock = Clock()
    simulator, seen = SimulatedHandControl("cge", clock=clock), []
    sampler = asyncio.get_running_loop().create_task(sample(simulator, seen.append))
    await asyncio.sleep(0.01)
    for seconds in (0.1, 60.0, 0.1):
        clock.now += seconds
        await asyncio.sleep(0.11)
    sampler.cancel()
    assert [round(one.t - EVENING, 1) for one in seen] == [0.0, 0.1, 60.1, 60.2]


def test_truth_file_line_is_one_json_object_with_documented_names() -> None:
    simulator, _ = mount("nexstar", "cpc")
    line = truth_of(simulator).json_line()
    assert line.endswith("}\n") and line.count("\n") == 1
    told = json.loads(line)
    assert list(told) == [
        "t", "axis1", "axis2", "altitude", "azimuth", "hour_angle", "past_meridian", "sun_distance", "rate1",
        "rate2", "moving", "tracking",
    ]  # fmt: skip
    assert told["past_meridian"] is None and told["tracking"] is True and told["altitude"] == 45.0


def test_sim_command_writes_a_truth_file_while_two_programs_use_the_mount(tmp_path: Path) -> None:
    """The site is set and the mount synced to over one connection; another one sees that, and the file does not."""
    file = tmp_path / "truth.jsonl"
    sim = Running(
        "sim",
        "nexstar:cge",
        "--time",
        "2026-01-15T22:00:00Z",
        "--site=-33.9,151.2",
        "--truth",
        str(file),
        "--at",
        "tcp://127.0.0.1:0",
        "--at",
        "tcp://127.0.0.1:0",
    )
    try:
        one, other = sim.ready(), sim.ready()
        assert ask(one, b"T\x00") == b"#" and ask(other, b"t", b"\x00#") == b"\x00#"
        assert ask(one, b"W\x2d\0\0\0\x0a\0\0\0") == b"#"
        assert ask(other, b"w") == b"\x2d\0\0\0\x0a\0\0\0#"
        while len(file.read_text().splitlines()) < 5:
            with pytest.raises(TimeoutExpired):  # it lives, and writes ten a second
                sim.process.wait(0.1)
    finally:
        assert sim.end() == 0
    seen = [json.loads(line) for line in file.read_text().splitlines()]
    assert 0.0 <= seen[0]["t"] - EVENING < 5.0
    steps = [later["t"] - earlier["t"] for earlier, later in pairwise(seen)]
    assert min(steps) > 0.0 and median(steps) == pytest.approx(0.1, abs=0.05)
    assert {round(one["altitude"], 3) for one in seen} == {33.9}  # at the southern pole, where it stands
    assert seen[-1]["tracking"] is False


def test_unwritable_truth_file_is_reported_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "nowhere" / "truth.jsonl"
    assert main(["sim", "nexstar:cge", "--at", "tcp://127.0.0.1:0", "--truth", str(path)]) == 2
    assert f"cannot write {path}" in capsys.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only where there is a full device")
def test_truth_file_that_becomes_unwritable_ends_the_simulated_mount(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gateway.cli.serve.sim.open_regular_fd", os.open)
    assert main(["sim", "nexstar:cge", "--at", "tcp://127.0.0.1:0", "--truth", "/dev/full"]) == 2
    assert "the simulated mount has ended" in capsys.readouterr().err
