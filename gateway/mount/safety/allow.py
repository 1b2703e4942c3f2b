"""Whether what moves the mount may go on, by every rule there is; what the first of them forbids is not allowed.

A rule is a pure function of a ``View``, evaluated at every position. It makes things more restful, never less, and
never forbids what leads out of a forbidden place. What moves the mount may come neither beyond an altitude limit, nor
near the Sun, nor past the meridian, where the tube of an equatorial mount comes to its pier; a goto is checked by where
it leads as well, before it begins.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core.errors import PastMeridian
from gateway.mount.policy import AT_LIMIT, Limits
from gateway.mount.safety.stop_timing import SHORTEST
from gateway.mount.safety.view import ALLOWED, RESTLESS, Verdict, View

#: A goto that ends at a limit may overshoot by so much.
OVERSHOOT = 0.05
#: So much nearer to the Sun is no jitter, degrees.
NEARER = 0.05
#: Farther past the meridian than that, a tube has gone round under the pole and not against the pier.
AROUND_THE_POLE = 90.0


def allow(view: View) -> Verdict:
    """The first reason why it must not go on, else the soonest moment at which it must have been seen again."""
    verdicts = []
    for rule in (altitude, near_sun, meridian):
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


# --- altitude ---------------------------------------------------------------------------------------------------------


def leaving(limits: Limits, before: float, now: float, margin: float = 0.0) -> bool:
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


# --- the Sun ----------------------------------------------------------------------------------------------------------


def near_sun(view: View) -> Verdict:
    """Nearer than the limit, and nearer than it was farthest since: a slow approach counts like a fast one."""
    before, last, soonest = view.seen.before, view.seen.last, ALLOWED
    if before is None or last is None:
        return ALLOWED
    for number, (then, now) in enumerate(zip(before.suns, last.suns, strict=True)):
        rate = _rate(view, number)
        if now >= view.sun + view.margin(rate):
            soon = view.until(now - view.sun, rate, "the Sun") if now < then else ALLOWED
            if soon.within is not None and (soonest.within is None or soon.within < soonest.within):
                soonest = soon
        elif now < view.seen.farthest[number] - NEARER:
            return Verdict(f"the Sun ({now:.0f} degrees from it)")
    return soonest


def farthest(view: View) -> tuple[float, ...]:
    """From how far the tube has come towards each Sun since it came near; far from it, where it is now."""
    if view.seen.last is None:
        return ()
    return tuple(
        now if now >= view.sun + view.margin(_rate(view, number)) or now < before - NEARER else max(now, before)
        for number, (now, before) in enumerate(zip(view.seen.last.suns, view.seen.farthest, strict=True))
    )


def _rate(view: View, number: int) -> float:
    """How fast it may come nearer to one of the Suns, degrees a second."""
    changes, earlier = view.seen.changes, view.seen.earlier
    assert changes is not None
    comparable = earlier is not None and len(earlier.suns) == len(changes.suns)
    return view.ahead(changes.suns[number], earlier.suns[number] if comparable and earlier is not None else None)


# --- the meridian -----------------------------------------------------------------------------------------------------


def meridian(view: View) -> Verdict:
    """What leads past the meridian ends at the limit of the hour angle, a goto excepted: it may change sides."""
    before, last, changes = view.seen.before, view.seen.last, view.seen.changes
    limit = view.limits.hour_angle
    equatorial = view.status is not None and view.status.equatorial
    if limit is None or not equatorial or view.moving.slewing or not can_be_told(view.german, view.side):
        return ALLOWED
    if before is None or last is None or changes is None or before.hour_angle is None or last.hour_angle is None:
        return ALLOWED
    side, earlier = view.side if view.german else None, view.seen.earlier
    then, now = past_meridian(before.hour_angle, side), past_meridian(last.hour_angle, side)
    if now <= then:
        return ALLOWED
    rate = view.ahead(changes.hour_angle, None if earlier is None else earlier.hour_angle)
    if now > limit - view.margin(rate):
        return Verdict(f"the hour angle limit ({now / 15.0:.2f} hours past the meridian)")
    return view.until(limit - now, rate, "the hour angle limit")


def can_be_told(german: bool | None, side: str | None) -> bool:
    """Whether anybody knows how far past the meridian it is: a German mount must have told its side to be watched."""
    return german is not None and (bool(side) or not german)


def past_meridian(hour_angle: float, side: str | None) -> float:
    """How many degrees a tube stands beyond the meridian, towards the pier; negative where it is free.

    ``side`` is the side of the pier that the tube of a German mount is on. On the west side it looks east and has the
    pier before it once the hour angle is positive; on the east side it is the other way round. Without a side it is a
    fork on a wedge, whose hour angle counts in both directions.
    """
    hour_angle = wrap180(hour_angle)
    past = abs(hour_angle) if side is None else hour_angle if side == "W" else -hour_angle
    return past if side is None or past <= AROUND_THE_POLE else past - 360.0


def check_hour_angle(limits: Limits, hour_angle: float) -> None:
    """Raises PastMeridian for a target too far from the meridian for a mount that cannot change sides."""
    if limits.hour_angle is not None and abs(wrap180(hour_angle)) > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


def check_shaft(limits: Limits, first: float) -> None:
    """The same by the first axis of a German mount, which reads 90 degrees with the counterweight shaft down.

    Past the meridian the shaft stands above level. Raises PastMeridian.
    """
    if limits.hour_angle is not None and abs(wrap180(first - 90.0)) - 90.0 > limits.hour_angle + AT_LIMIT:
        raise PastMeridian
