"""The simulated mechanics by a clock of the test's own: tracking holds, gotos arrive, rates are rates."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from gateway.astro.axes import Build, Geometry, Observer
from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import separation, wrap180
from gateway.protocols.mechanics.mount import Mechanics
from tests.support.each import each

START = 1_775_000_000.0
ARCSECOND = 1 / 3600
SITES = (45.0, -34.0)
BUILDS = tuple(Build)


def mount(build: Build, latitude: float, *, on: bool = True, ramps: bool = True) -> Mechanics:
    """A mount at work: 40 degrees west of the meridian, 20 degrees on the equator's high side.

    Without ``ramps`` its motors change their speed at once, and what they are told is plain arithmetic.
    """
    sky = Observer(latitude, 10.0)
    pole = 1 if latitude > 0 else -1
    axes = Geometry(build, latitude).to_axes(40.0, 20.0 * pole, Geometry(build, latitude).is_flipped(40.0))
    made = Mechanics(build, sky, START, axes)
    made.acceleration = made.acceleration if ramps else math.inf
    made.flipped = made.geometry.is_flipped(40.0)
    made.track(START, on, sense=pole)
    return made


def apart(made: Mechanics, now: float, ra: float, dec: float) -> float:
    """Arcseconds between where the tube points and a place."""
    return separation(*made.true_position(now), ra, dec) * 3600


@each("latitude", SITES)
@each("build", BUILDS)
def test_simulated_mount_holds_a_star_only_while_tracking(build: Build, latitude: float) -> None:
    made = mount(build, latitude)
    ra, dec = made.true_position(START)
    before = made.axes(START)
    for minute in range(61):
        assert apart(made, START + 60 * minute, ra, dec) < 0.1
    assert made.tracking(START + 3600)
    assert made.axes(START + 3600) != before
    made.track(START + 3600, False)
    assert not made.tracking(START + 3600)
    ra, dec = made.true_position(START + 3600)
    drifted = made.true_position(START + 3700)
    assert wrap180(drifted[0] - ra) * 3600 == pytest.approx(1504.1, abs=0.1)
    assert drifted[1] == pytest.approx(dec, abs=1e-9)


@each("latitude", SITES)
@each("build", BUILDS)
@each("where", [(25.0, 10.0), (-60.0, -20.0), (-5.0, 5.0), (40.0, 20.0)])
def test_simulated_goto_arrives_exactly_on_the_moving_target(
    build: Build, latitude: float, where: tuple[float, float]
) -> None:
    made = mount(build, latitude)
    ra = made.sky.lst(START) - where[0]
    made.goto_sky(START, ra, where[1])
    distances, now = [], START
    while made.slewing(now):
        distances.append(apart(made, now, ra, where[1]))
        now += 0.5
        assert now < START + 300
    assert apart(made, now, ra, where[1]) < 1e-5
    assert apart(made, now + 1800, ra, where[1]) < 0.1
    assert made.tracking(now)
    assert len(set(distances)) == len(distances)


@each("build", BUILDS)
def test_simulated_goto_never_reverses_an_axis(build: Build) -> None:
    made = mount(build, 45.0, on=False)
    made.goto_axes(START, 130.0, 70.0)
    seen = [made.axes(START + n / 4) for n in range(400)]
    for axis, goal in ((0, 130.0), (1, 70.0)):
        left = [abs(wrap180(goal - axes[axis])) for axes in seen]
        assert left == sorted(left, reverse=True)
        assert left[-1] < 1e-9
    slow = [abs(b[0] - a[0]) for a, b in pairwise(seen) if b != a][-3:]
    assert max(slow) < 0.5  # the last of it is crept


def test_simulation_speed_shortens_only_gotos() -> None:
    usual, quick = mount(Build.GERMAN, 45.0), mount(Build.GERMAN, 45.0)
    quick.speedup = 10.0
    for made in (usual, quick):
        made.goto_axes(START, 100.0, 60.0)
    assert not quick.slewing(START + 2.5) and usual.slewing(START + 15)
    quick.track(START + 2.5, False)
    quick.move(START + 2.5, 1, 2.0)
    assert wrap180(quick.axes(START + 5.5)[0] - quick.axes(START + 4.5)[0]) == pytest.approx(2.0)


@each("speed", [4.0, 20.0])
def test_sped_up_simulated_goto_arrives_even_if_never_read(speed: float) -> None:
    made = mount(Build.ALTAZ, 48.1)
    made.speedup = speed
    ra, dec = made.true_position(START + 1.0)
    made.goto_sky(START + 1.0, ra + 40.0, dec - 10.0)
    assert apart(made, START + 61.0, ra + 40.0, dec - 10.0) < 1.0


def test_simulated_position_does_not_depend_on_being_read() -> None:
    looked, blind = mount(Build.ALTAZ, 45.0), mount(Build.ALTAZ, 45.0)
    for made in (looked, blind):
        made.goto_sky(START, 100.0, 60.0)
        made.pulse(START + 1, 1, 0.002, 1.0)
    for n in range(600):
        looked.axes(START + 1 + n / 5)
    assert looked.axes(START + 300) == pytest.approx(blind.axes(START + 300), abs=1e-6)


@each("latitude", SITES)
def test_slow_simulated_rates_add_to_tracking_and_fast_ones_suspend_it(latitude: float) -> None:
    made = mount(Build.GERMAN, latitude, ramps=False)
    west = made.geometry.pole_sign
    ra, _ = made.true_position(START)
    made.move(START, 1, west * 7.5 * ARCSECOND, additive=True)
    assert made.tracking(START + 10)
    made.move(START + 10, 1, 0.0)
    assert wrap180(made.true_position(START + 60)[0] - ra) * 3600 == pytest.approx(-75, abs=0.01)
    made.move(START + 60, 1, west * 1.0)
    made.move(START + 61, 1, 0.0)
    assert not made.tracking(START + 61)
    ra, _ = made.true_position(START + 61)
    assert wrap180(made.true_position(START + 71)[0] - ra) * 3600 == pytest.approx(150.4, abs=0.1)
    made.resume_tracking(START + 71)
    assert made.tracking(START + 71)


def test_stopping_a_resting_simulated_axis_changes_nothing() -> None:
    for build in BUILDS:
        made = mount(build, 45.0)
        made.move(START + 1, 1, 0.0)
        made.move(START + 1, 2, 0.0)
        assert made.tracking(START + 2)


def test_simulated_alt_az_motor_keeps_its_rate_while_the_other_is_moved() -> None:
    made = mount(Build.ALTAZ, 45.0, ramps=False)
    before, after = made.axes(START), made.axes(START + 1)
    made.move(START + 1, 2, 1.0)
    later = made.axes(START + 2)
    assert later[0] - after[0] == pytest.approx(after[0] - before[0], rel=1e-2)
    assert later[1] - after[1] == pytest.approx(1.0)


def test_stopping_one_simulated_axis_does_not_end_the_goto_of_the_other() -> None:
    made = mount(Build.GERMAN, 45.0)
    made.goto_axes(START, 100.0, 60.0)
    made.move(START + 1, 2, 0.0)
    assert made.slewing(START + 1, 1) and not made.slewing(START + 1, 2)
    made.move(START + 2, 1, 0.0)
    assert not made.slewing(START + 2)
    assert made.tracking(START + 2)


def test_newer_simulated_goto_replaces_the_running_one() -> None:
    made = mount(Build.ALTAZ, 45.0)
    made.goto_sky(START, 100.0, 60.0)
    there = made.axes(START + 2)
    made.goto_sky(START + 2, 50.0, 30.0)
    assert made.axes(START + 2) == pytest.approx(there)
    assert apart(made, START + 300, 50.0, 30.0) < 0.01


def test_simulated_sync_changes_coordinates_and_turns_no_axis() -> None:
    for build in BUILDS:
        made = mount(build, -34.0)
        truth, axes = made.true_position(START), made.axes(START)
        made.sync(START, 200.0, -40.0)
        assert made.axes(START) == pytest.approx(axes, abs=1e-9)
        assert apart(made, START, *truth) < 1e-6
        assert separation(*made.believed_position(START), 200.0, -40.0) < 1e-9
        made.goto_sky(START, 210.0, -35.0)
        assert separation(*made.believed_position(START + 300), 210.0, -35.0) < 1e-6


def test_simulated_german_mount_reports_declination_over_90_beyond_the_pole() -> None:
    made = mount(Build.GERMAN, 45.0, ramps=False)
    lst = sidereal_time(START, 10.0)
    made.goto_sky(START, lst + 30.0, 60.0)
    assert made.flipped and made.axes(START + 300)[1] == pytest.approx(120.0)
    assert made.believed_position(START + 300)[1] == pytest.approx(60.0)
    made.move(START + 300, 2, -2.0)
    made.move(START + 320, 2, 0.0)
    assert made.believed_position(START + 320)[1] == pytest.approx(100.0)
    assert made.true_position(START + 320)[1] == pytest.approx(80.0)


def test_simulated_goto_of_one_axis_leaves_the_other_tracking() -> None:
    made = mount(Build.GERMAN, 45.0)
    made.goto_axis(START, 2, 80.0)
    assert made.slewing(START + 1, 2) and not made.slewing(START + 1, 1)
    assert made.axes(START + 100)[1] == pytest.approx(80.0)
    turned = wrap180(made.axes(START + 110)[0] - made.axes(START + 100)[0])
    assert turned * 3600 == pytest.approx(150.41, abs=0.01)  # the other one tracks on


def test_simulated_axis_rate_has_an_upper_limit() -> None:
    made = mount(Build.ALTAZ, 45.0, on=False, ramps=False)
    made.set_rate(START, 1, 50.0)
    assert wrap180(made.axes(START + 1)[0] - made.axes(START)[0]) == pytest.approx(4.0)


def test_simulated_fork_put_on_its_wedge_keeps_pointing() -> None:
    made = mount(Build.ALTAZ, 45.0)
    place = made.true_position(START)
    made.set_build(START, Build.WEDGE)
    assert separation(*made.true_position(START), *place) < 1e-9
    assert separation(*made.believed_position(START), *place) < 1e-9
    made.track(START, True, sense=1)
    assert apart(made, START + 3600, *place) < 0.1


def test_new_site_turns_no_simulated_axis_and_keeps_tracking_the_same_place() -> None:
    for build in BUILDS:
        made = mount(build, 45.0)
        axes = made.axes(START)
        made.relocate(START, Observer(50.0, 20.0, 3600.0))
        assert made.axes(START) == pytest.approx(axes)
        place = made.believed_position(START)
        assert separation(*made.believed_position(START + 1800), *place) * 3600 < 0.1
