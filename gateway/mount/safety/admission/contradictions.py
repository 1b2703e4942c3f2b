"""Contradictions: sources of site or time that differ, and a park position beyond the limits.

They are reported at the start, in one line, because that is better than to learn of them from a refusal. A goto that
any of the differing sources forbids is refused. A motion under way is judged by the best source alone, so that a wrong
source cannot stop a mount that is right.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core.about import RELEASED
from gateway.core.errors import Fault, NearSun, Unsupported
from gateway.core.operations import Equatorial, GetStatus, Park, Place
from gateway.mount.context import Context
from gateway.mount.policy import Limits, check_own_park
from gateway.mount.site.astrometry import Sun
from gateway.mount.site.site_clock import BestSources, Site, Time

#: The least differences that count as a contradiction: degrees on the Earth, and seconds.
SITE_MATTERS, CLOCK_MATTERS = 0.5, 120.0
#: Without the date the position of the Sun is unknown.
UNKNOWN_TIME = (
    "The time is unknown: this computer's clock is lost, and neither the mount nor a program has reported it. "
    "Set the time, or sun = 0 at night."
)


class Contradiction(NamedTuple):
    """Another site and time that may be the true ones; ``words`` say which sources differ."""

    place: Place | None
    unix: float
    words: str


def check_contradictions(sources: BestSources, sky: Sky, limits: Limits, goal: Equatorial, doubted: bool) -> None:
    """Check the altitude of a goto to ``goal`` by every source that contradicts the best one, if it is ``doubted``.

    Raises BelowHorizon or TooHigh with the sources in words; NearSun if the time is unknown.
    """
    sites, times = sources.sites(), sources.times()
    if limits.sun > 0.0 and time_unknown(times[0]):
        raise NearSun(UNKNOWN_TIME)
    for place, unix, words in contradictions(sites, times) if doubted else ():
        if place is None:
            continue
        try:
            limits.check_altitude(sky.horizon(goal.ra, goal.dec, place.latitude, place.longitude, unix)[1])
        except Fault as fault:
            raise _because(fault, words) from None


def with_contradiction(fault: Fault, sources: BestSources) -> Fault:
    """Return a refusal by the best source; if others contradict that, with the words for it."""
    found = next(contradictions(sources.sites(), sources.times()), None)
    return fault if found is None else _because(fault, found.words)


def _because(fault: Fault, words: str) -> Fault:
    return type(fault)(f"{fault} {words[0].upper()}{words[1:]}.")


def too_near(sources: BestSources, sun: Sun, words: str | None = None) -> NearSun:
    """Return the refusal of a motion towards a Sun, in these ``words``; if other sources show it, they are named."""
    sites, times = sources.sites(), sources.times()
    told = [*sites[:1], *([sun.site] if sun.site is not None else [])], [times[0], sun.time]
    why = [found.words for found in contradictions(*told)]
    return NearSun(" ".join([words or NearSun.words, *(f"{one[0].upper()}{one[1:]}." for one in why)]))


def contradictions(sites: list[Site], times: list[Time]) -> Iterator[Contradiction]:
    """Yield what other sources say that differs too much, each site or time combined with the best of the other."""
    unix = times[0].unix
    if sites:
        place, others = sites[0].place, sites[1:]
        for other in others:
            if _apart(place, other.place) > SITE_MATTERS:
                hint = likely_mistake(place, other.place)
                yield Contradiction(
                    other.place,
                    unix,
                    f"{sites[0].who} stands at {site_text(place)}, {other.source} says "
                    f"{site_text(other.place)}{': ' * bool(hint)}{hint}",
                )
    for time in times[1:]:
        apart = abs(time.unix - unix)
        if apart > CLOCK_MATTERS and not time.doubtful:
            yield Contradiction(
                sites[0].place if sites else None,
                time.unix,
                f"the clocks of {times[0].who} and of {time.source} differ by {_span(time.unix - unix)}",
            )


def _apart(one: Place, other: Place) -> float:
    return separation(one.longitude, one.latitude, other.longitude, other.latitude)


def site_text(place: Place) -> str:
    """Return a site in the usual notation: ``45.0 N 10.0 E``."""
    north, east = "NS"[place.latitude < 0], "EW"[place.longitude < 0]
    return f"{abs(place.latitude):.1f} {north} {abs(place.longitude):.1f} {east}"


def likely_mistake(one: Place, other: Place) -> str:
    """Return the likely mistake that turns one site into the other; empty if none fits."""
    written = {
        "the sign of a longitude looks wrong, east is positive": Place(one.latitude, -one.longitude),
        "the sign of a latitude looks wrong, north is positive": Place(-one.latitude, one.longitude),
        "both signs look wrong, north and east are positive": Place(-one.latitude, -one.longitude),
        "latitude and longitude look swapped, latitude comes first": Place(one.longitude, one.latitude),
    }
    for words, place in written.items():
        if abs(place.latitude) <= 90.0 and _apart(place, other) <= SITE_MATTERS:
            return words
    return ""


def _span(seconds: float) -> str:
    minutes = abs(seconds) / 60.0
    if minutes < 90:
        return f"{minutes:.0f} minutes"
    return f"{minutes / 60:.1f} hours" if minutes < 2880 else f"{minutes / 1440:.0f} days"


def time_unknown(best: Time) -> bool:
    """Whether the time is unknown: this computer's clock is lost, and there is no other source."""
    return best.doubtful and best.unix < RELEASED


def contradiction_warning(mount: Context) -> str:
    """Return the contradictions as one warning line; empty if there are none."""
    found = [
        f"{words} (gotos that either of them would forbid are refused)"
        for place, _, words in contradictions(mount.sources.sites(), mount.sources.times())
        if place is not None
    ]
    found += _park_warning(mount)
    return f"WARNING: {'; '.join(found)}" if found else ""


def _park_warning(mount: Context) -> Iterator[str]:
    """Yield a warning if the mount can be parked and its park position is beyond the limits."""
    limits, status = mount.policy.limits, mount.cache.value(GetStatus)
    if not mount.driver.implementation(Park) or status is None:
        return
    there = mount.driver.destination(Park())
    try:
        if there is not None:
            on_sky = mount.astrometry.from_axes(there, wedge=not mount.driver.german) if status.equatorial else None
            limits.check_altitude(there.alt if on_sky is None else mount.astrometry.horizon(on_sky).alt)
        elif not mount.policy.own_park:
            check_own_park(Park(), limits)
    except Unsupported:
        return  # without a site its altitude is unknown
    except Fault:
        yield (
            "its park position is beyond lowest or highest; it is parked there all the same"
            if mount.policy.own_park
            else "parking is refused, because its park position may lie beyond lowest or highest: see the key park"
        )
