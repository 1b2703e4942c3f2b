"""Simulated motors gather and lose speed as real ones do; guiding and tracking stay exact. Numbers reckoned by hand."""

from __future__ import annotations

import math
from random import Random

import pytest

from gateway.astro.axes import Build, Observer
from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.protocols.mechanics.mount import Mechanics
from tests.support.each import each
from tests.support.sampling import as_a_rule

#: A power of two, so that a quarter of a second is exact.
START = 2.0**30
#: Degrees a second squared: four degrees a second in one second.
ACCELERATION = 4.0


def mount(build: Build = Build.GERMAN, on: bool = False) -> Mechanics:
    made = Mechanics(build, Observer(45.0, 10.0), START, (60.0, 20.0))
    assert (made.max_rate, made.acceleration) == (4.0, ACCELERATION)
    made.track(START, on)
    return made


def second(made: Mechanics, seconds: float) -> float:
    return made.axes(START + seconds)[1]


def test_simulated_rate_is_reached_and_left_in_a_second() -> None:
    made = mount()
    made.set_rate(START, 2, 4.0)
    assert [second(made, t) - 20.0 for t in (0.0, 0.5, 1.0, 1.5, 2.0)] == pytest.approx([0.0, 0.5, 2.0, 4.0, 6.0])
    assert made.speeds(START + 2.0)[1] == pytest.approx(4.0)
    made.set_rate(START + 2.0, 2, 0.0)
    assert [second(made, t) - 20.0 for t in (2.0, 2.5, 3.0, 9.0)] == pytest.approx([6.0, 7.5, 8.0, 8.0])


def test_slower_simulated_rate_is_reached_sooner_and_a_reversal_later() -> None:
    made = mount()
    made.set_rate(START, 2, 1.0)
    assert [second(made, t) - 20.0 for t in (0.25, 1.25)] == pytest.approx([0.125, 1.125])
    made.set_rate(START + 1.25, 2, -3.0)  # a second to change by four degrees a second, at rest after a quarter
    assert [second(made, t) - 20.0 for t in (1.5, 2.25, 3.25)] == pytest.approx([1.25, 0.125, -2.875])


def test_simulated_stop_while_accelerating_brakes_from_the_reached_speed() -> None:
    made = mount()
    made.set_rate(START, 2, 4.0)
    made.set_rate(START + 0.5, 2, 0.0)  # two degrees a second by then
    assert [second(made, t) - 20.0 for t in (0.5, 1.0, 5.0)] == pytest.approx([0.5, 1.0, 1.0])
    assert made.is_ramping(START + 0.9) and made.is_moving(START + 0.9)


def test_simulated_goto_accelerates_creeps_and_arrives_exactly() -> None:
    """39.5 degrees: 1 s up, 35.5078 degrees at full speed, 0.9375 s down to a quarter of a degree a second.

    The last half degree: 1.96875 s, and 0.0625 s down to rest.
    """
    made = mount()
    made.goto_axes(START, 60.0, 60.0)
    assert second(made, 1.0) == pytest.approx(22.0)
    assert second(made, 2.0) == pytest.approx(26.0)
    ends = 1.0 + 35.5078125 / 4.0 + 0.9375 + 1.96875 + 0.0625
    assert second(made, ends - 0.0625) == pytest.approx(60.0 - 0.0078125)
    assert made.slewing(START + ends - 1e-3) and not made.slewing(START + ends + 1e-3)
    assert second(made, ends + 1e-3) == second(made, 99.0) == 60.0
    assert not made.is_moving(START + 99.0)


def test_cancelled_simulated_goto_brakes_for_a_second_and_then_tracks() -> None:
    made = mount(on=True)
    made.goto_axes(START, 60.0, 60.0)
    assert second(made, 3.0) == pytest.approx(30.0)
    made.stop_goto(START + 3.0)
    assert not made.slewing(START + 3.0) and made.is_moving(START + 3.5)
    assert [second(made, t) for t in (3.5, 4.0, 60.0)] == pytest.approx([31.5, 32.0, 32.0])
    assert not made.is_moving(START + 4.1) and made.tracking(START + 4.1)
    assert made.speeds(START + 4.1)[0] == pytest.approx(SIDEREAL_RATE, abs=1e-6)


def test_sped_up_simulated_goto_brakes_at_the_same_speedup() -> None:
    made = mount()
    made.speedup = 6.0
    made.goto_axes(START, 60.0, 80.0)
    before = second(made, 1.0)
    made.stop_goto(START + 1.0)
    assert second(made, 1.0 + 1.0 / 6.0) - before == pytest.approx(2.0, abs=1e-4)  # as far, in a sixth of the time
    assert second(made, 9.0) - before == pytest.approx(2.0, abs=1e-4)


@each("build", list(Build))
def test_simulated_guide_pulse_moves_the_exact_angle(build: Build) -> None:
    made, other = mount(build, on=True), mount(build, on=True)
    made.pulse(START + 1.0, 2, 0.5 * SIDEREAL_RATE, 2.0)
    guided, followed = made.axes(START + 3.0), other.axes(START + 3.0)
    assert wrap180(guided[1] - followed[1]) == pytest.approx(SIDEREAL_RATE, abs=1e-7)
    assert wrap180(guided[0] - followed[0]) == pytest.approx(0.0, abs=1e-7)


def test_simulated_motion_without_ramps_is_immediate() -> None:
    made = mount()
    made.acceleration = math.inf
    made.set_rate(START, 2, 4.0)
    assert second(made, 0.5) == 22.0
    made.set_rate(START + 1.0, 2, 0.0)
    assert [second(made, t) for t in (1.0, 9.0)] == [24.0, 24.0]
    made.goto_axes(START + 10.0, 60.0, 28.5)  # four degrees at four a second, half a degree at a quarter
    assert made.slewing(START + 12.99) and not made.slewing(START + 13.0)


def order(made: Mechanics, now: float, chance: Random) -> None:
    """Anything that a mount may be told."""
    axis, rate = chance.choice((1, 2)), chance.choice((-4.0, -1.0, -0.003, 0.0, 0.003, 0.3, 4.0))
    what = chance.randrange(9)
    if what == 0:
        made.set_rate(now, axis, rate)
    elif what == 1:
        made.move(now, axis, rate, additive=abs(rate) < 0.01)
    elif what == 2:
        made.goto_sky(now, made.sky.lst(now) - chance.uniform(-60.0, 60.0), chance.uniform(0.0, 35.0))
    elif what == 3:
        made.goto_axis(now, axis, chance.uniform(30.0, 60.0))
    elif what == 4:
        made.stop_goto(now)
    elif what == 5:
        made.track(now, chance.random() < 0.7)
    elif what == 6:
        made.sync(now, made.sky.lst(now) - chance.uniform(-60.0, 60.0), chance.uniform(0.0, 35.0))
    elif what == 7:
        made.pulse(now, axis, 0.002 * chance.choice((-1, 1)), chance.uniform(0.01, 1.0))
    else:
        made.relocate(now, Observer(45.0, chance.uniform(5.0, 15.0), chance.uniform(-60.0, 60.0)))


@pytest.mark.parametrize("build", list(Build))
@pytest.mark.parametrize("seed", range(as_a_rule(2, whole=4)))
def test_no_order_changes_a_simulated_motor_speed_abruptly(build: Build, seed: int) -> None:
    """Places follow speeds, and speeds change at twice the acceleration at most: off one order and on to another."""
    chance, made = Random(seed), mount(build, on=True)
    step = 1.0 / 64.0
    now, before, speeds = START, made.axes(START), made.speeds(START)
    for _ in range(as_a_rule(2000, whole=3000)):
        now += step
        if chance.random() < 0.03:
            order(made, now, chance)
        here, then = made.axes(now), made.speeds(now)
        for axis in (0, 1):
            moved = wrap180(here[axis] - before[axis])
            zenith = 1.0 / max(0.02, math.cos(math.radians(here[1]))) if build is Build.ALTAZ else 1.0
            slack = 0.06 + 0.02 * zenith
            assert abs(moved / step - 0.5 * (speeds[axis] + then[axis])) < slack, (now - START, axis)
            assert abs(then[axis] - speeds[axis]) < 2.0 * ACCELERATION * step + slack, (now - START, axis)
        before, speeds = here, then


def test_simulated_tracking_through_the_zenith_keeps_the_motor_speed() -> None:
    """There the azimuth of what is tracked turns round in no time: it must not be run on from for minutes."""
    made = mount(Build.ALTAZ, on=True)
    made.goto_axes(START, 10.0, 90.0)
    for quarter in range(4 * 120):
        made.axes(START + quarter / 4.0)
    assert not made.is_ramping(START + 120.0)
    made.track(START + 120.0, False)
    stood = made.axes(START + 122.0)
    assert made.axes(START + 200.0) == stood
