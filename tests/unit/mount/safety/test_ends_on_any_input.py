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
from gateway.mount.motion.seen import Changes, Observed, PositionSample, add_position, at_one_time
from gateway.mount.motion.wanted import Moving
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.altitudes import Source
from gateway.mount.safety.admission.by_hand import Start, check_either_way, check_turns
from gateway.mount.safety.admission.contradictions import contradictions, likely_mistake, site_text
from gateway.mount.safety.admission.slew_paths import Journey, check_ways, is_clear, path_points, paths_within
from gateway.mount.safety.allow import StopTiming, View, ahead, allow, farthest, first_stretch
from gateway.mount.safety.hour_angle import check_past, past_meridian, turned_by_side
from gateway.mount.safety.sync_sum import SyncSum, check_sync
from gateway.mount.safety.unattended import SunAhead
from gateway.mount.safety.watch import StallWatch
from gateway.mount.site.astrometry import Shift
from gateway.mount.site.site_clock import COMPUTER, CONFIGURED, MOUNT, Site, Time
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
def test_safety_rules_end_on_any_input(n: list[float], suns: int, slewing: bool) -> None:
    def decide() -> None:
        limits, timing = Limits(n[0], n[1], n[2], n[3], n[4]), StopTiming(n[5], 2, n[6])
        before, last = (
            PositionSample(at, op.Equatorial(n[7], n[8]), n[9 + step], n[10 - step], tuple(n[:suns]), further=(n[11],))
            for step, at in enumerate((n[5], n[6]))
        )
        changes = Changes((n[0], n[1]), tuple(n[:suns]))
        seen = add_position(Observed(before, before, changes, Changes(), n[3], n[4], n[5], tuple(n[:suns])), last)
        view = View(seen, limits, timing, Moving(slewing, {}), n[0], op.Status(True, False, op.Tracking.OFF))
        allow(view), farthest(view), first_stretch(view, n[1], n[2])
        at_one_time(n[3], op.Equatorial(n[4], n[5]), before, n[6])

    ends(decide)


@some
@given(st.lists(wild, min_size=8, max_size=8))
def test_axis_and_sync_sums_end_on_any_input(n: list[float]) -> None:
    here, there = op.Equatorial(n[0], n[1]), op.Equatorial(n[2], n[3])
    limits = Limits(n[4], n[5], n[6], n[7], n[0])
    geometry = Geometry(Build.GERMAN, n[4])
    watch, steps = StallWatch(), count()
    for decide in (
        lambda: past_meridian(turned_by_side(n[0], "W"), german=True),
        lambda: check_past(limits, n[1], german=False),
        lambda: check_sync(n[0], SyncSum(n[1], n[2]), [(n[3], n[4]), (n[5], n[6])], here, there),
        lambda: ahead(n[0], n[1], n[2], n[3], n[4]),
        lambda: [watch.find_stalled(AxisSample(next(steps), (n[0], n[1]), n[2]), {1: n[3]}, n[4]) for _ in range(3)],
        lambda: fold_declination(*geometry.readings((n[0], n[1]), (n[2], n[3]), (n[5], n[6]))),
        lambda: separation(n[0], n[1], n[2], n[3]),
        lambda: sidereal_time(n[0], n[1]),
    ):
        ends(decide)


@some
@given(pairs, pairs, pairs, wild)
@example((0.0, 0.0), (1e300, 0.0), (0.0, 0.0), 20.0)
@example((0.0, 0.0), (0.0, math.nan), (0.0, 0.0), 20.0)
def test_path_past_the_sun_ends_on_any_input(start: Any, turn: Any, place: Any, limit: float) -> None:
    ends(lambda: is_clear(start, turn, place, limit))


@some
@given(pairs, pairs, wild, wild)
def test_contradiction_check_ends_on_any_input(one: Any, other: Any, unix: float, further: float) -> None:
    sites = [Site(op.Place(*one), MOUNT), Site(op.Place(*other), CONFIGURED)]
    times = [Time(unix, MOUNT), Time(further, COMPUTER)]
    ends(lambda: list(contradictions(sites, times)))
    ends(lambda: (likely_mistake(sites[0].place, sites[1].place), site_text(sites[0].place)))


# --- what asks a mount -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@some
@given(st.lists(wild, min_size=12, max_size=12), st.sampled_from((None, "site", "clock", "syncs", "position")))
@example([1e12, 1e300, *WORST[:10]], None)
@example([math.nan, math.inf, *WORST[:10]], None)
def test_safety_decides_though_every_mount_value_is_not_a_number(
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
                bridge.site_clock.host = lambda: n[8]
                bridge.site_clock.mount_clock = op.Moment(n[9], 0.0), controller.now()
            elif unknown == "syncs":
                context.synced.value = SyncSum(n[8], n[9], (n[10], n[11]), (n[0], n[1]))
            elif unknown == "position":
                here = op.Equatorial(n[8], n[9])
            context.suns._frame_until = -math.inf
            goal, limits = op.Equatorial(n[0], n[1]), Limits(n[2], n[3], n[4], n[5], n[6])
            decisions: list[Callable[[], object]] = [
                lambda: context.suns.distances(here),
                lambda: SunAhead(context, controller.reader, controller.watch).check(here),
                lambda: controller.watch.check_position(here),
                lambda: controller.watch.hour_angle.take_reading(op.Horizontal(n[0], n[1])),
            ]
            shifts = Shift(n[0], n[1], True), Shift(n[2], n[3], False)
            for some_limits in (limits, context.policy.limits):
                start = Start(here, status, (Source(context), *(Source(context, sync_shift=one) for one in shifts)))
                journey = Journey(status.equatorial, here, {False, True}, goal)
                decisions += [
                    lambda start=start, on=some_limits: check_turns(context, on, start, {1: n[0], 2: n[1]}),
                    lambda start=start, on=some_limits: check_either_way(context, on, start, {1: n[1], 2: n[0]}),
                    lambda journey=journey, on=some_limits: [
                        list(path_points(one)) for one in paths_within(context, on, journey)
                    ],
                    lambda journey=journey, on=some_limits: check_ways(context, on, journey),
                ]  # type: ignore[misc]
            for decide in decisions:
                with contextlib.suppress(Fault, ArithmeticError, ValueError, StopIteration):
                    decide()

    ends(lambda: run(program()))


@pytest.mark.parametrize("mount", ["cpc", "evolution"])
@pytest.mark.parametrize("ms", [10**9, 10**12, 10**300])
def test_guide_pulse_of_any_length_is_judged_at_once(mount: str, ms: int) -> None:
    async def program() -> None:
        async with Bridge(mount, config={"lowest": 10.0}) as bridge:
            for pulse in (op.Pulse(op.Direction.SOUTH, ms), op.PulseAxis(2, 1, ms, 1e300)):
                with pytest.raises(Fault):
                    await bridge.controller.admission.admit(pulse)

    ends(lambda: run(program()))
