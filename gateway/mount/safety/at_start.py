"""What does not fit together is said at the start, in one line: it is cheaper to hear then than from a refusal.

Where the mount parks against the altitude limits, its own site and clock against the configuration and this computer.
"""

from __future__ import annotations

from collections.abc import Iterator

from gateway.core import operations as op
from gateway.core.errors import Fault, Unsupported
from gateway.mount.safety.admission.contradictions import contradictions
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.rules.park import check_own_park
from gateway.mount.site.site_clock import BestSources


def doubts(mount: MountInputs, sources: BestSources) -> str:
    """One line, or nothing."""
    found = [*_contradictions(sources), *_park(mount)]
    return f"WARNING: {'; '.join(found)}" if found else ""


def _contradictions(sources: BestSources) -> Iterator[str]:
    for place, _, words in contradictions(sources.sites(), sources.times()):
        if place is not None:
            yield f"{words} (gotos that either of them would forbid are refused)"


def _park(mount: MountInputs) -> Iterator[str]:
    """Only where the mount can be parked at all."""
    limits, status = mount.context.policy.limits, mount.readings.value(op.GetStatus)
    if not mount.driver.way(op.Park) or status is None:
        return
    there = mount.driver.destination(op.Park())
    try:
        if there is not None:
            limits.check_altitude(_altitude(mount, there, status.equatorial))
        elif not mount.context.policy.own_park:
            check_own_park(op.Park(), limits)
    except Unsupported:
        return  # without a site nobody knows
    except Fault:
        yield (
            "its park position lies beyond lowest or highest, where it is parked all the same"
            if mount.context.policy.own_park
            else "parking is refused, because its park position may lie beyond lowest or highest: see the key park"
        )


def _altitude(mount: MountInputs, there: op.GotoAxes, equatorial: bool) -> float:
    """Raises Unsupported where the site is not known."""
    if not equatorial:
        return there.alt
    return mount.astrometry.horizon(mount.astrometry.from_axes(there, wedge=not mount.driver.german)).alt
