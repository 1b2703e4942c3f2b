"""Whether what moves the mount may go on, by every rule there is; what the first of them forbids is not allowed.

One rule a file: ``altitude.py``, ``sun.py``, ``meridian.py``. Evaluated at every position.
"""

from __future__ import annotations

from gateway.mount.safety.rules.altitude import altitude
from gateway.mount.safety.rules.meridian import meridian
from gateway.mount.safety.rules.sun import near_sun
from gateway.mount.safety.stop_timing import SHORTEST
from gateway.mount.safety.view import RESTLESS, Verdict, View

RULES = altitude, near_sun, meridian


def allow(view: View) -> Verdict:
    """The first reason why it must not go on, else the soonest moment at which it must have been seen again."""
    verdicts = []
    for rule in RULES:
        verdict = rule(view)
        if verdict.reason:
            return verdict
        verdicts.append(verdict)
    return min(verdicts, key=lambda verdict: float("inf") if verdict.within is None else verdict.within)


def first_stretch(view: View, now: float, speed: float) -> Verdict:
    """A motion by hand begins, whichever way: it must be seen again before it can come to any limit.

    ``speed`` is that of all axes together, degrees a second. Its first stretch has been checked
    (``admission/motions.py``).
    """
    here, limits, timing = view.seen.last, view.limits, view.timing
    if here is None or view.status is None or not view.status.aligned or speed <= RESTLESS:
        return Verdict()
    rooms = [distance - view.sun for distance in here.suns]
    if here.altitude is not None:
        rooms += [here.altitude - limits.lowest] * (limits.lowest > -90.0)
        rooms += [limits.highest - here.altitude] * (limits.highest < 90.0)
    nearest = min((room for room in rooms if room > 0.0), default=180.0)
    seconds = nearest / speed - timing.to_stop - (now - here.at)
    return Verdict(within=max(seconds, timing.interval + SHORTEST), limit="a limit")
