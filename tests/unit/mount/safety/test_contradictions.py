"""What a refusal says when sources of site or time contradict each other, and whom that keeps from observing."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.control.requests import explain
from gateway.astro.ephemeris.sky import Sky
from gateway.core import operations as op
from gateway.core.errors import Contradicted, Fault
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.altitudes import contradicting_sources
from gateway.mount.safety.admission.contradictions import contradiction_warning, contradictions, sun_refusal
from gateway.mount.site.astrometry import SiteAstrometry, Sun, SyncShift
from gateway.mount.site.site_clock import (
    COMPUTER_SOURCE,
    CONFIG_SOURCE,
    GPS_SOURCE,
    MOUNT_SOURCE,
    PROGRAM,
    SiteClock,
    SiteTimeSources,
    SourcedSite,
    SourcedTime,
)
from tests.support.in_process_gateway import EVENING, Bridge

LONGEST = 60
HERE, FAR = op.Place(45.0, 10.0), op.Place(-44.0, -171.0)


def says_what_to_do(fault: Fault, *sources: str) -> None:
    """The whole text names both sources and the way out; the brief one fits a hand control's display."""
    told = explain(fault, Limits(lowest=20.0))
    for word in sources:
        assert word.lower() in told.lower()
    assert "Correct the one that is wrong" in told
    assert "lowest" not in told
    assert 0 < len(fault.brief) <= LONGEST, fault.brief


@pytest.mark.parametrize(("best", "other"), list(combinations([MOUNT_SOURCE, GPS_SOURCE, CONFIG_SOURCE, PROGRAM], 2)))
def test_contradicting_site_is_named_with_a_remedy(best: str, other: str) -> None:
    sites, time = [SourcedSite(HERE, best), SourcedSite(FAR, other)], SourcedTime(EVENING, MOUNT_SOURCE)
    [found] = contradictions(sites, [time])
    assert "km away" in found.text
    known = SiteTimeSources(SiteClock(lambda: 0.0, lambda: EVENING, None))
    known.sites, known.times = lambda: sites, lambda: [time]  # type: ignore[method-assign]
    says_what_to_do(sun_refusal(known, Sun(0.0, 0.0, False, time, sites[1])), best, other)
    says_what_to_do(sun_refusal(known, Sun(0.0, 0.0, False, time, sites[1]), on_path=True), best, other)
    zenith = op.Equatorial(Sky().sidereal_time(EVENING, 10.0), 45.0)
    astrometry, as_told = (
        SiteAstrometry(Sky(), known, "jnow"),
        SimpleNamespace(pointing=lambda position, shift: position),
    )
    mount: Any = SimpleNamespace(sources=known, astrometry=astrometry, suns=as_told)
    [source] = contradicting_sources(mount, Limits(lowest=20.0))
    with pytest.raises(Contradicted) as raised:
        source.check(Limits(lowest=20.0), source.altitude(zenith))
    says_what_to_do(raised.value, best, other)


@pytest.mark.parametrize(("best", "other"), list(combinations([MOUNT_SOURCE, GPS_SOURCE, COMPUTER_SOURCE, PROGRAM], 2)))
@pytest.mark.parametrize("apart", [200.0, 9000.0, 9e5, 9e7])
def test_contradicting_clock_is_named_with_a_remedy(best: str, other: str, apart: float) -> None:
    times = [SourcedTime(EVENING, best), SourcedTime(EVENING - apart, other, other == COMPUTER_SOURCE)]
    known = SiteTimeSources(SiteClock(lambda: 0.0, lambda: EVENING, None))
    site = SourcedSite(HERE, MOUNT_SOURCE)
    known.sites, known.times = lambda: [site], lambda: times  # type: ignore[method-assign]
    says_what_to_do(sun_refusal(known, Sun(0.0, 0.0, False, times[1], site)), best, other)


async def test_wrong_clock_is_reported_though_no_site_is_known() -> None:
    async with Bridge(host_ahead=7200.0) as bridge:
        context = bridge.controller.context
        context.site_clock.mount_site = context.site_clock.gps_site = context.site_clock.configured_site = None
        assert "the clocks of the mount and of this computer differ by 2.0 hours" in contradiction_warning(context)


def test_displaced_axes_are_named_with_a_remedy() -> None:
    known = SiteTimeSources(SiteClock(lambda: 0.0, lambda: EVENING, HERE))
    fault = sun_refusal(
        known, Sun(0.0, 0.0, True, SourcedTime(EVENING, MOUNT_SOURCE), None, SyncShift(-180.0, 0.0, False))
    )
    assert "180 degrees off" in str(fault)
    assert len(fault.brief) <= LONGEST
    assert sun_refusal(known, Sun(0.0, 0.0, True, SourcedTime(EVENING, MOUNT_SOURCE))).brief == ""
