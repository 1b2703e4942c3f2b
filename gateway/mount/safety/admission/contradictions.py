"""Contradictions: sources of site or time that differ, and a park position beyond the limits.

They are reported at the start, in one line, because that is better than to learn of them from a refusal. A goto that
any of the differing sources forbids is refused. A motion under way is judged by the best source alone, so that a wrong
source cannot stop a mount that is right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core.about import RELEASED
from gateway.core.errors import BelowHorizon, Contradicted, Fault, NearSun, Unsupported
from gateway.core.operations import AxisPosition, Equatorial, GetStatus, Park, Place
from gateway.mount.context import Context
from gateway.mount.policy import Limits, check_own_park
from gateway.mount.site.astrometry import Shift, Sun
from gateway.mount.site.site_clock import COMPUTER, CONFIGURED, GPS, MOUNT, PROGRAM, BestSources, Site, Time

#: The least differences that count as a contradiction: degrees on the Earth, and seconds.
SITE_MATTERS, CLOCK_MATTERS = 0.5, 120.0
#: Kilometres in a degree on the Earth.
KM = 111.2
#: Without the date the position of the Sun is unknown.
UNKNOWN_TIME = (
    "The time is unknown: this computer's clock is lost, and neither the mount nor a program has reported it. "
    "Set the time, or sun = 0 at night."
)


#: How to correct each source of a site, and of a time.
SITE_SET = {
    MOUNT: "the mount's at its hand control or in the program that sets it",
    GPS: "the receiver's by a new fix",
    CONFIGURED: "the key site of the configuration",
    PROGRAM: "the program's",
}
CLOCK_SET = {**SITE_SET, COMPUTER: "the clock of this computer"}


class Contradiction(NamedTuple):
    """Another site and time that may be the true ones.

    ``words`` say which sources differ, ``apart`` by how much, and ``remedies`` how to correct each. ``other`` is what
    the other one says of the site, for where the best one stands already.
    """

    place: Place | None
    unix: float
    words: str
    sources: tuple[str, str]
    apart: str
    remedies: dict[str, str]
    other: str = ""


def check_contradictions(sources: BestSources, sky: Sky, limits: Limits, goal: Equatorial, doubted: bool) -> None:
    """Check the altitude of a goto to ``goal`` by every source that contradicts the best one, if it is ``doubted``.

    Raises Contradicted, which names the sources; NearSun if the time is unknown.
    """
    sites, times = sources.sites(), sources.times()
    if limits.sun > 0.0 and time_unknown(times[0]):
        raise NearSun(UNKNOWN_TIME, "The time is unknown. Set the clock, or sun = 0 at night.")
    for one in contradictions(sites, times) if doubted else ():
        if one.place is None:
            continue
        try:
            altitude = sky.horizon(goal.ra, goal.dec, one.place.latitude, one.place.longitude, one.unix)[1]
            limits.check_altitude(altitude)
        except Fault as fault:
            which = "low" if isinstance(fault, BelowHorizon) else "high"
            by = f"Too {which} by {_briefly(one)}."
            raise Contradicted(f"Too {which}, if {one.sources[1]} is right: {_at_length(one)}", by) from None


def with_contradiction(fault: Fault, sources: BestSources) -> Fault:
    """Return a refusal by the best source; if others contradict that, with the words for it."""
    found = next(contradictions(sources.sites(), sources.times()), None)
    if found is None:
        return fault
    words = f"{fault} {_at_length(found)}"
    return type(fault)(words, words)


def check_synced(limits: Limits, altitude: float, shift: Shift) -> None:
    """Check the ``altitude`` to which a goto brings the tube if the syncs that turned its axes were wrong.

    Raises Contradicted.
    """
    try:
        limits.check_altitude(altitude)
    except Fault as fault:
        which, off = "low" if isinstance(fault, BelowHorizon) else "high", max(abs(shift.first), abs(shift.second))
        raise Contradicted(
            f"Too {which}, if the syncs since the alignment were wrong: they have turned an axis by {off:.0f} degrees. "
            "Align the mount again.",
            f"Too {which} by its axes: syncs turned one by {off:.0f} degrees.",
        ) from None


def too_near(sources: BestSources, sun: Sun, way: bool = False) -> NearSun:
    """Return the refusal of a motion towards a Sun, or on a ``way`` past it, with the sources that show it."""
    words = "The way there passes too close to the Sun." if way else NearSun.words
    if sun.own and sun.shift is not None:
        off = max(abs(sun.shift.first), abs(sun.shift.second))
        return NearSun(
            f"{words} Since a sync or the alignment its axes are {off:.0f} degrees off: align the mount again.",
            f"The Sun, by its axes: {off:.0f} degrees off. Align it again.",
        )
    sites, times = sources.sites(), sources.times()
    others = [] if sun.site is None else [sun.site]
    told = next(contradictions(sites[:1] + others, [times[0], sun.time._replace(doubtful=False)]), None)
    if sun.own or told is None:
        return NearSun(words)
    return NearSun(f"{words} {_at_length(told)}", f"{'Past' if way else 'Near'} the Sun by {_briefly(told)}.")


def _briefly(one: Contradiction) -> str:
    """Return at most 45 characters: ``the computer (2.5 hours from the mount)``."""
    names = {COMPUTER: "the computer", CONFIGURED: "the config", GPS: "the GPS", PROGRAM: "a program"}
    best, other = (names.get(source, source) for source in one.sources)
    return f"{other} ({one.apart} from {best})"


def _at_length(one: Contradiction) -> str:
    ways = ", or ".join(one.remedies[source] for source in one.sources)
    return f"{one.words[0].upper()}{one.words[1:]}. Correct the one that is wrong: {ways}."


def contradictions(sites: Sequence[Site], times: Sequence[Time]) -> Iterator[Contradiction]:
    """Yield what other sources say that differs too much, each site or time combined with the best of the other."""
    unix = times[0].unix
    if sites:
        place, others = sites[0].place, sites[1:]
        for other in others:
            if (apart := _apart(place, other.place)) > SITE_MATTERS:
                hint, far = likely_mistake(place, other.place), f"{apart * KM:.0f} km"
                told = f"{other.source} says {site_text(other.place)}, {far} away{': ' * bool(hint)}{hint}"
                words = f"{sites[0].who} stands at {site_text(place)}, {told}"
                yield Contradiction(other.place, unix, words, (sites[0].source, other.source), far, SITE_SET, told)
    for time in times[1:]:
        if abs(time.unix - unix) > CLOCK_MATTERS and not time.doubtful:
            place_of_best, span = sites[0].place if sites else None, _span(time.unix - unix)
            words = f"the clocks of {times[0].who} and of {time.source} differ by {span}"
            yield Contradiction(place_of_best, time.unix, words, (times[0].source, time.source), span, CLOCK_SET)


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
    status, driver = mount.cache.value(GetStatus), mount.driver
    by_axis = status is not None and status.aligned and not status.equatorial and not driver.german
    if not (by_axis and driver.implementation(AxisPosition)):
        refused = "gotos that either of them would forbid are refused"
    elif mount.policy.limits.sun > 0.0:
        refused = "gotos that come near the Sun by either are refused, the altitude limits go by its axis"
    else:
        refused = "nothing is refused for that, the altitude limits go by its axis"
    found = [
        f"{one.words} ({refused})"
        for one in contradictions(mount.sources.sites(), mount.sources.times())
        if one.place is not None
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
