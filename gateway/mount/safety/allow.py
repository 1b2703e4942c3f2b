"""The safety rules: whether the motion of the mount may continue. The first rule that forbids it decides.

A rule is a pure function of a ``View``, evaluated at every position. It may only restrict motion, and it never forbids
a motion that leads out of a forbidden region. A moving mount must not pass an altitude limit, come near the Sun, or go
past the meridian, where the tube of an equatorial mount meets its pier. Gotos are checked beforehand, too.
"""

from __future__ import annotations

from gateway.mount.policy import Limits
from gateway.mount.safety.stop_timing import MIN_INTERVAL
from gateway.mount.safety.view import ALLOWED, FASTER_THAN_TRACKING, Verdict, View

#: Degrees by which a goto that ends at a limit may overshoot.
OVERSHOOT = 0.05
#: Degrees by which the Sun must have come nearer before it counts as an approach; less is jitter.
NEARER = 0.05


def allow(view: View) -> Verdict:
    """Return the verdict that forbids the motion, else the one with the earliest deadline for the next position."""
    soonest = ALLOWED
    for rule in (altitude, near_sun, meridian):
        verdict = rule(view)
        if verdict.reason:
            return verdict
        soonest = _sooner(soonest, verdict)
    return soonest


def first_stretch(view: View, now: float, speed: float) -> Verdict:
    """Return the deadline for the first position after a motion by hand begins, in whatever direction it moves.

    The mount must have reported a position before it can reach any limit. ``speed`` is that of all axes together,
    degrees a second. The first stretch of the motion has been checked already (``admission/by_hand.py``).
    """
    here, limits, timing = view.seen.last, view.limits, view.timing
    if here is None or view.status is None or not view.status.aligned or speed <= FASTER_THAN_TRACKING:
        return Verdict()
    rooms = [distance - view.sun for distance in here.suns]
    rooms += [altitude - limits.lowest for altitude in here.altitudes if limits.lowest > -90.0]
    rooms += [limits.highest - altitude for altitude in here.altitudes if limits.highest < 90.0]
    nearest = min((room for room in rooms if room > 0.0), default=180.0)
    seconds = nearest / speed - timing.to_stop - (now - here.at)
    return Verdict(within=max(seconds, timing.interval + MIN_INTERVAL), limit="a limit")


# --- altitude ---------------------------------------------------------------------------------------------------------


def leaving(limits: Limits, before: float, now: float, margin: float = 0.0) -> bool:
    """Whether an altitude is outside the limits, or within ``margin`` degrees of them, and is getting worse.

    Limits of -90 and 90 degrees are off, because nothing lies beyond them.
    """
    sinking = limits.lowest > -90.0 and now < limits.lowest + margin and now < before
    rising = limits.highest < 90.0 and now > limits.highest - margin and now > before
    return sinking or rising


def altitude(view: View) -> Verdict:
    """End a motion before it passes an altitude limit, by what the mount tells or by what it told before its syncs."""
    before, last, changes = view.seen.before, view.seen.last, view.seen.changes
    if before is None or last is None or changes is None:
        return ALLOWED
    limits, earlier, soonest = view.limits, view.seen.earlier, ALLOWED
    for number, (then, now) in enumerate(zip(before.altitudes, last.altitudes, strict=False)):
        grew = _earlier(changes.altitudes, None if earlier is None else earlier.altitudes, number)
        rate = view.ahead(changes.altitudes[number], grew)
        if leaving(limits, then, now, view.margin(rate) - OVERSHOOT * view.on_checked_path):
            return Verdict(f"the altitude limit ({now:.1f} degrees{', if the syncs were wrong' * (number > 0)})")
        if now < then and limits.lowest > -90.0:
            soonest = _sooner(soonest, view.allowed_within(now - limits.lowest, rate, "the altitude limit"))
        elif now > then and limits.highest < 90.0:
            soonest = _sooner(soonest, view.allowed_within(limits.highest - now, rate, "the altitude limit"))
    return soonest


def _earlier(changes: tuple[float, ...], before: tuple[float, ...] | None, number: int) -> float | None:
    """Return one of the speeds before these; None if there were others then."""
    return before[number] if before is not None and len(before) == len(changes) else None


def _sooner(one: Verdict, other: Verdict) -> Verdict:
    """Return the verdict with the earlier deadline."""
    return min(one, other, key=lambda verdict: float("inf") if verdict.within is None else verdict.within)


# --- the Sun ----------------------------------------------------------------------------------------------------------


def near_sun(view: View) -> Verdict:
    """Forbid coming nearer to a Sun than the limit, measured from ``farthest``, so that slow approaches count too.

    Suns of other sources end only the arrows of programs, because a wrong source must not end a motion that is right.
    """
    before, last, soonest = view.seen.before, view.seen.last, ALLOWED
    if before is None or last is None:
        return ALLOWED
    count = len(last.suns) if view.moving.by_hand else view.own_suns
    for number, (then, now) in enumerate(zip(before.suns[:count], last.suns[:count], strict=True)):
        rate = _rate(view, number)
        if now >= view.sun + view.margin(rate):
            soonest = _sooner(soonest, view.allowed_within(now - view.sun, rate, "the Sun") if now < then else ALLOWED)
        elif now < view.seen.farthest[number] - NEARER:
            return Verdict(f"the Sun ({now:.0f} degrees from it)")
    return soonest


def farthest(view: View) -> tuple[float, ...]:
    """Return, for each Sun, the greatest distance since the tube came near it, or the present one if it is not near."""
    if view.seen.last is None:
        return ()
    return tuple(
        now if now >= view.sun + view.margin(_rate(view, number)) or now < before - NEARER else max(now, before)
        for number, (now, before) in enumerate(zip(view.seen.last.suns, view.seen.farthest, strict=True))
    )


def _rate(view: View, number: int) -> float:
    """How fast the tube may approach one of the Suns, degrees a second."""
    changes, earlier = view.seen.changes, view.seen.earlier
    assert changes is not None
    grew = _earlier(changes.suns, None if earlier is None else earlier.suns, number)
    return view.ahead(changes.suns[number], grew)


# --- the meridian -----------------------------------------------------------------------------------------------------


def meridian(view: View) -> Verdict:
    """End a motion at the limit of the hour angle. Gotos are exempt, because they may change the pier side."""
    limit, past = view.limits.hour_angle, view.past
    if limit is None or past is None or past.rate <= 0.0 or view.seen.before is None or view.moving.slewing:
        return ALLOWED
    rate = view.ahead(past.rate, past.earlier)
    if past.degrees > limit - view.margin(rate):
        return Verdict(f"the hour angle limit ({past.degrees / 15.0:.2f} hours past the meridian)")
    return view.allowed_within(limit - past.degrees, rate, "the hour angle limit")
