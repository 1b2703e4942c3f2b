"""Where the Sun is that must not come into the tube, and the rule that keeps the tube away from it.

It counts while it is up. When the mount's date and this computer's differ by more than a day nobody knows which one is
right, so both Suns count; while nobody has told a date, this computer's does, and the log says so, loudly.
"""

from __future__ import annotations

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.safety.view import ALLOWED, Verdict, View
from gateway.mount.site.site_clock import COMPUTER, BestSources

DAY = 86400.0
#: The Sun moves a twenty-thousandth of a degree a second against the stars: one place is good for a minute.
KEPT = 60.0
#: Altitude of a Sun that may still shine into a tube: refraction, the disk, and a horizon that lies lower than the eye.
SUN_IS_UP = -1.0
#: So much nearer to the Sun is no jitter, degrees.
NEARER = 0.05


class SunAvoidance:
    """``limit`` is how near to it the tube may come, degrees; with 0 there is no Sun at all."""

    def __init__(self, context: Context, sky: Sky, sources: BestSources) -> None:
        self._context, self._sky, self._sources = context, sky, sources
        self.limit = context.policy.limits.sun
        self._key: tuple[object, ...] = ()
        self._up: list[op.Equatorial] = []

    def up(self) -> list[op.Equatorial]:
        """The places of date of every Sun that counts now."""
        if not self.limit:
            return []
        best, host, site = self._sources.best_time(), self._sources.host(), self._sources.site()
        if best.source == COMPUTER and self._context.milestones.settled.is_set():  # else the mount may tell one yet
            self._context.note_once(
                "WARNING: nobody has told a date: the Sun is avoided by this computer's date and time"
            )
        key = best.unix // KEPT, host // KEPT, site
        if key != self._key:
            self._key = key
            moments = [best.unix]
            if abs(best.unix - host) > DAY:
                moments.append(host)
                self._context.note_once("WARNING: the mount's date is not this computer's: the Sun is avoided by both")
            self._up = [place for place in (self._place(unix, site) for unix in moments) if place is not None]
        return self._up

    def _place(self, unix: float, site: op.Place | None) -> op.Equatorial | None:
        """The Sun of one moment; None when it is down. Without a site it counts as up."""
        sky = self._sky
        ra, dec = sky.sun(unix)
        if site is not None and sky.horizon(ra, dec, site.latitude, site.longitude, unix)[1] < SUN_IS_UP:
            return None
        return op.Equatorial(ra, dec)

    def distances(self, seen: op.Equatorial) -> list[float]:
        """How far a place is from every Sun that counts, degrees."""
        return [separation(seen.ra, seen.dec, sun.ra, sun.dec) for sun in self.up()]


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
