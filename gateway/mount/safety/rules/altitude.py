"""Neither below the lowest nor above the highest altitude: the limits of targets, of motion, and of tracking."""

from __future__ import annotations

from gateway.mount.policy import Limits
from gateway.mount.safety.view import ALLOWED, Verdict, View

#: A goto that ends at a limit may overshoot by so much.
OVERSHOOT = 0.05


def leaving(limits: Limits, before: float, now: float, margin: float) -> bool:
    """Whether an altitude is outside the limits, or will be within ``margin`` degrees, and is getting worse.

    There is nothing below -90 and above 90: those limits are none.
    """
    sinking = limits.lowest > -90.0 and now < limits.lowest + margin and now < before
    rising = limits.highest < 90.0 and now > limits.highest - margin and now > before
    return sinking or rising


def altitude(view: View) -> Verdict:
    """What leads beyond an altitude limit ends before it."""
    before, last, changes = view.seen.before, view.seen.last, view.seen.changes
    if before is None or last is None or changes is None or before.altitude is None or last.altitude is None:
        return ALLOWED
    limits, earlier = view.limits, view.seen.earlier
    rate = view.ahead(changes.altitude, None if earlier is None else earlier.altitude)
    margin = view.margin(rate) - OVERSHOOT * view.going
    if leaving(limits, before.altitude, last.altitude, margin):
        return Verdict(f"the altitude limit ({last.altitude:.1f} degrees)")
    if last.altitude < before.altitude and limits.lowest > -90.0:
        return view.until(last.altitude - limits.lowest, rate, "the altitude limit")
    if last.altitude > before.altitude and limits.highest < 90.0:
        return view.until(limits.highest - last.altitude, rate, "the altitude limit")
    return ALLOWED
