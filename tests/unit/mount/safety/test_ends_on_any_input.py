"""Every decision of safety ends on any input: positions, sites, clocks, goals and rates that are no finite numbers.

A loop that runs for ever would stop the whole gateway, a stop of the mount included. Whether such an input is refused
in words or by an error of arithmetic does not matter here; that it ends does, in far less time than a watchdog waits.
"""

from __future__ import annotations

import contextlib
import math
import signal
from collections.abc import Callable
from itertools import count
from typing import Any

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from gateway.astro.axes import Build, Geometry
from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import fold_declination, separation
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.motion.ends import AxisSample
from gateway.mount.motion.seen import ObservedMotion, PositionSample, Rates, add_position, extrapolate_ra
from gateway.mount.motion.wanted import MotionState
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.altitudes import AltitudeSource
from gateway.mount.safety.admission.by_hand import StretchStart, check_both_directions, check_turns
from gateway.mount.safety.admission.contradictions import contradictions, likely_mistake, site_text
from gateway.mount.safety.admission.slew_paths import Journey, check_paths, is_clear, path_points, paths_within
from gateway.mount.safety.allow import (
    JudgedState,
    StopTiming,
    farthest_from_suns,
    first_position_deadline,
    judge_motion,
    max_rate,
)
from gateway.mount.safety.hour_angle import angle_from_pier_side, check_past_meridian, past_meridian
from gateway.mount.safety.sync_sum import SyncSum, checked_sync_sum
from gateway.mount.safety.unattended import SunApproachWatch
from gateway.mount.safety.watch import StallWatch
from gateway.mount.site.astrometry import SyncShift
from gateway.mount.site.site_clock import COMPUTER_SOURCE, CONFIG_SOURCE, MOUNT_SOURCE, SourcedSite, SourcedTime
from tests.support.examples import some as a_few
from tests.support.in_process_gateway import Bridge

#: Seconds of processor time within which everything here must have ended; a watchdog waits 1.2 s.
PATIENCE = 10.0
pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="Windows cannot interrupt a loop")
WORST = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e12, 0.0, -0.0, 90.0, -90.0, 5e-324)
#: What fails is slow, so it is not made smaller.
some = settings(a_few, phases=(Phase.explicit, Phase.generate))
wild = st.sampled_from(WORST) | st.floats() | st.floats(-400.0, 400.0)
pairs = st.tuples(wild, wild)


class NeverEndsError(BaseException):
    """Nothing catches it."""


def ends(decide: Callable[[], object]) -> None:
    """Call it, and interrupt it if it takes too long. A refusal and an error of arithmetic are an end."""

    def interrupt(*_: object) -> None:
        raise NeverEndsError

    before = signal.signal(signal.SIGVTALRM, interrupt)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        decide()
    except (Fault, ArithmeticError, ValueError):
        pass
    except NeverEndsError:
        pytest.fail("it does not end")
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


# --- what is pure ----------------------------------------------------------------------------------------------------


@some
@given(st.lists(wild, min_size=12, max_size=12), st.integers(0, 3), st.booleans())
def test_safety_rules_do_not_hang_on_any_numbers(n: list[float], suns: int, slewing: bool) -> None:
    def decide() -> None:
        limits, timing = Limits(n[0], n[1], n[2], n[3], n[4]), StopTiming(n[5], 2, n[6])
        before, last = (
            PositionSample(
                at, op.Equatorial(n[7], n[8]), n[9 + step], n[10 - step], tuple(n[:suns]), other_altitudes=(n[11],)
            )
            for step, at in enumerate((n[5], n[6]))
        )
        changes = Rates((n[0], n[1]), tuple(n[:suns]))
        seen = add_position(ObservedMotion(before, before, changes, Rates(), n[3], n[4], n[5], tuple(n[:suns])), last)
        view = JudgedState(
            seen, limits, timing, MotionState(slewing, {}), n[0], op.Status(True, False, op.Tracking.OFF)
        )
        judge_motion(view), farthest_from_suns(view), first_position_deadline(view, n[1], n[2])
        extrapolate_ra(n[3], op.Equatorial(n[4], n[5]), before, n[6])

    ends(decide)


@some
@given(st.lists(wild, min_size=8, max_size=8))
def test_axis_and_sync_maths_does_not_hang_on_any_input(n: list[float]) -> None:
    here, there = op.Equatorial(n[0], n[1]), op.Equatorial(n[2], n[3])
    limits = Limits(n[4], n[5], n[6], n[7], n[0])
    geometry = Geometry(Build.GERMAN, n[4])
    watch, steps = StallWatch(), count()
    for decide in (
        lambda: past_meridian(angle_from_pier_side(n[0], "W"), german=True),
        lambda: check_past_meridian(limits, n[1], german=False),
        lambda: checked_sync_sum(n[0], SyncSum(n[1], n[2]), [(n[3], n[4]), (n[5], n[6])], here, there),
        lambda: max_rate(n[0], n[1], n[2], n[3], n[4]),
        lambda: [watch.find_stalled(AxisSample(next(steps), (n[0], n[1]), n[2]), {1: n[3]}, n[4]) for _ in range(3)],
        lambda: fold_declination(*geometry.axis_readings((n[0], n[1]), (n[2], n[3]), (n[5], n[6]))),
        lambda: separation(n[0], n[1], n[2], n[3]),
        lambda: sidereal_time(n[0], n[1]),
    ):
        ends(decide)


@some
@given(pairs, pairs, pairs, wild)
@example((0.0, 0.0), (1e300, 0.0), (0.0, 0.0), 20.0)
@example((0.0, 0.0), (0.0, math.nan), (0.0, 0.0), 20.0)
def test_sun_path_check_does_not_hang_on_any_numbers(start: Any, turn: Any, place: Any, limit: float) -> None:
    ends(lambda: is_clear(start, turn, place, limit))


@some
@given(pairs, pairs, wild, wild)
def test_contradiction_check_ends_on_any_input(one: Any, other: Any, unix: float, further: float) -> None:
    sites = [SourcedSite(op.Place(*one), MOUNT_SOURCE), SourcedSite(op.Place(*other), CONFIG_SOURCE)]
    times = [SourcedTime(unix, MOUNT_SOURCE), SourcedTime(further, COMPUTER_SOURCE)]
    ends(lambda: list(contradictions(sites, times)))
    ends(lambda: (likely_mistake(sites[0].place, sites[1].place), site_text(sites[0].place)))


# --- what asks a mount -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@some
@given(st.lists(wild, min_size=12, max_size=12), st.sampled_from((None, "site", "clock", "syncs", "position")))
@example([1e12, 1e300, *WORST[:10]], None)
@example([math.nan, math.inf, *WORST[:10]], None)
def test_safety_decides_on_a_goto_even_if_mount_values_are_nan(
    mount: str, driven: str, n: list[float], unknown: str | None
) -> None:
    async def program() -> None:
        async with Bridge(mount, driven=driven, config={"hour_angle_limit": 0.5, "lowest": 10.0}) as bridge:
            controller = bridge.controller
            context, here = controller.context, await controller.read(op.Position())
            status = await controller.read(op.GetStatus())
            if unknown == "site":
                bridge.site_clock.mount_site = op.Place(n[8], n[9])
            elif unknown == "clock":
                bridge.site_clock.computer_time = lambda: n[8]
                bridge.site_clock.mount_clock = op.Moment(n[9], 0.0), controller.now()
            elif unknown == "syncs":
                context.syncs.value = SyncSum(n[8], n[9], (n[10], n[11]), (n[0], n[1]))
            elif unknown == "position":
                here = op.Equatorial(n[8], n[9])
            context.suns._suns_valid_until = -math.inf
            goal, limits = op.Equatorial(n[0], n[1]), Limits(n[2], n[3], n[4], n[5], n[6])
            decisions: list[Callable[[], object]] = [
                lambda: context.suns.distances(here),
                lambda: SunApproachWatch(context, controller.reader, controller.watch).check(here),
                lambda: controller.watch.check_position(here),
                lambda: controller.watch.hour_angle.take_reading(op.Horizontal(n[0], n[1])),
            ]
            shifts = SyncShift(n[0], n[1], True), SyncShift(n[2], n[3], False)
            for some_limits in (limits, context.policy.limits):
                start = StretchStart(
                    here,
                    status,
                    (AltitudeSource(context), *(AltitudeSource(context, sync_shift=one) for one in shifts)),
                )
                journey = Journey(status.equatorial, here, {False, True}, goal)
                decisions += [
                    lambda start=start, on=some_limits: check_turns(context, on, start, {1: n[0], 2: n[1]}),
                    lambda start=start, on=some_limits: check_both_directions(context, on, start, {1: n[1], 2: n[0]}),
                    lambda journey=journey, on=some_limits: [
                        list(path_points(one)) for one in paths_within(context, on, journey)
                    ],
                    lambda journey=journey, on=some_limits: check_paths(context, on, journey),
                ]  # type: ignore[misc]
            for decide in decisions:
                with contextlib.suppress(Fault, ArithmeticError, ValueError, StopIteration):
                    decide()

    ends(lambda: run(program()))


@pytest.mark.parametrize("mount", ["cpc", "evolution"])
@pytest.mark.parametrize("ms", [10**9, 10**12, 10**300])
def test_overlong_guide_pulse_is_refused_without_delay(mount: str, ms: int) -> None:
    async def program() -> None:
        async with Bridge(mount, config={"lowest": 10.0}) as bridge:
            for pulse in (op.Pulse(op.Direction.SOUTH, ms), op.PulseAxis(2, 1, ms, 1e300)):
                with pytest.raises(Fault):
                    await bridge.controller.admission.admit(pulse)

    ends(lambda: run(program()))
