"""Contradictions: sources of site or time that differ, and a park position beyond the limits.

They are reported at the start, in one line, so that the user does not learn of them from a refusal. A goto or a motion
by arrow key is refused if by any source it leads beyond an altitude limit that the user has set, or near the Sun; a
motion by arrow key also ends there. A goto under way and tracking are judged by the best source alone, so that a wrong
source cannot stop a mount that is right.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

from gateway.core.about import EARLIEST_VALID_TIME
from gateway.core.errors import Fault, NearSun, Unsupported
from gateway.core.operations import GetStatus, Park, Place
from gateway.mount.context import Context
from gateway.mount.policy import check_unknown_park
from gateway.mount.site.astrometry import FixedSiteTime, SiteAstrometry, Sun
from gateway.mount.site.site_clock import (
    COMPUTER_SOURCE,
    CONFIG_SOURCE,
    FORMER_SITE_SOURCE,
    GPS_SOURCE,
    MOUNT_SOURCE,
    PROGRAM,
    SiteTimeSources,
    SourcedSite,
    SourcedTime,
    earth_distance,
)

#: The least differences that count as a contradiction: degrees on the Earth, and seconds.
SITE_CONTRADICTION, CLOCK_CONTRADICTION = 0.5, 120.0
#: Kilometres in a degree on the Earth.
KM_PER_DEGREE = 111.2
#: The refusal of a goto because the position of the Sun is unknown.
NO_TIME_TEXT = (
    "The time is unknown: this computer's clock is lost, and neither the mount nor a program has reported it. "
    "Set the time, or sun = 0 at night."
)


#: How to correct the site of each source; in CLOCK_REMEDIES, how to correct its time.
SITE_REMEDIES = {
    MOUNT_SOURCE: "the mount's at its hand control or in the program that sets it",
    GPS_SOURCE: "the receiver's by a new fix",
    CONFIG_SOURCE: "the key site of the configuration",
    PROGRAM: "the program's",
    FORMER_SITE_SOURCE: "or confirm the new one on the page, at the hand control, by the key site, or by a restart",
}
CLOCK_REMEDIES = {**SITE_REMEDIES, COMPUTER_SOURCE: "the clock of this computer"}


class Contradiction(NamedTuple):
    """Another site and time that may be the true ones.

    ``text`` says which two ``sources`` differ, ``difference`` by how much, and ``remedies`` how to correct each.
    ``short_text`` only describes the second source, for a sentence that has named the best source already.
    """

    site: Place | None
    unix_time: float
    text: str
    sources: tuple[str, str]
    difference: str
    remedies: dict[str, str]
    short_text: str = ""

    @property
    def remedy(self) -> str:
        """Return how to correct each of the two sources."""
        return f"correct the one that is wrong: {', or '.join(self.remedies[source] for source in self.sources)}"

    @property
    def warning_line(self) -> str:
        """Return the line for the log: both values, and how to correct each."""
        return f"{self.text}, so {self.remedy}"


def sun_refusal(sources: SiteTimeSources, sun: Sun, on_path: bool = False) -> NearSun:
    """Return the refusal of a motion that leads to the Sun, or past it (``on_path``), with its source."""
    text = "The way there passes too close to the Sun." if on_path else NearSun.default_text
    if sun.confirmed and sun.sync_shift is not None:
        off = max(abs(sun.sync_shift.first), abs(sun.sync_shift.second))
        return NearSun(
            f"{text} If the syncs were wrong, its axes are {off:.0f} degrees off: align the mount again.",
            f"The Sun, by its axes: {off:.0f} degrees off. Align it again.",
        )
    sites, times = sources.sites(), sources.times()
    others = [] if sun.site is None else [sun.site]
    contradiction = next(contradictions(sites[:1] + others, [times[0], sun.time._replace(doubtful=False)]), None)
    if sun.confirmed or contradiction is None:
        return NearSun(text)
    return NearSun(
        f"{text} {full_text(contradiction)}", f"{'Past' if on_path else 'Near'} the Sun by {summary(contradiction)}."
    )


def summary(contradiction: Contradiction) -> str:
    """Describe a contradiction in at most 45 characters, such as ``the computer (2.5 hours from the mount)``."""
    names = {COMPUTER_SOURCE: "the computer", CONFIG_SOURCE: "the config", GPS_SOURCE: "the GPS", PROGRAM: "a program"}
    best, other = (names.get(source, source) for source in contradiction.sources)
    return f"{other} ({contradiction.difference} from {best})"


def full_text(contradiction: Contradiction) -> str:
    """Return the whole text: which sources differ, by how much, and how to correct each."""
    text = contradiction.text[0].upper() + contradiction.text[1:]
    return f"{text}. {contradiction.remedy[0].upper()}{contradiction.remedy[1:]}."


def contradictions(sites: Sequence[SourcedSite], times: Sequence[SourcedTime]) -> Iterator[Contradiction]:
    """Yield the sites and times that differ too much from the best ones, which come first. A site is combined with the
    best time, a time with the best site.
    """
    unix = times[0].unix
    if sites:
        place, others = sites[0].place, sites[1:]
        for other in others:
            if (apart := earth_distance(place, other.place)) > SITE_CONTRADICTION:
                hint, far = likely_mistake(place, other.place), f"{apart * KM_PER_DEGREE:.0f} km"
                other_site = f"{other.source} says {site_text(other.place)}, {far} away{': ' * bool(hint)}{hint}"
                text = f"{sites[0].source_text} stands at {site_text(place)}, {other_site}"
                sources = (sites[0].source, other.source)
                yield Contradiction(other.place, unix, text, sources, far, SITE_REMEDIES, other_site)
    for time in times[1:]:
        if abs(time.unix - unix) > CLOCK_CONTRADICTION and not time.doubtful:
            place_of_best, span = sites[0].place if sites else None, _duration_text(time.unix - unix)
            both = f"{clock_text(unix)} and {clock_text(time.unix)} UTC"
            text = f"the clocks of {times[0].source_text} and of {time.source} differ by {span} ({both})"
            yield Contradiction(place_of_best, time.unix, text, (times[0].source, time.source), span, CLOCK_REMEDIES)


def contradictions_of(mount: Context) -> Iterator[Contradiction]:
    """Yield the present contradictions to the site and clock of a mount."""
    return contradictions(mount.sources.sites(), mount.sources.times())


def contradicting_skies(mount: Context) -> Iterator[tuple[Contradiction, SiteAstrometry]]:
    """Yield the contradictions, each with the astronomy by its site and time; nothing without a site."""
    own = mount.astrometry
    for contradiction in contradictions_of(mount):
        if contradiction.site is not None:
            known = FixedSiteTime(contradiction.site, contradiction.unix_time)
            yield contradiction, SiteAstrometry(own.sky, known, own.equinox)


def site_text(site: Place) -> str:
    """Return a site in the usual notation: ``45.0 N 10.0 E``."""
    north, east = "NS"[site.latitude < 0], "EW"[site.longitude < 0]
    return f"{abs(site.latitude):.1f} {north} {abs(site.longitude):.1f} {east}"


def clock_text(unix_time: float) -> str:
    """Return a time as date and minute; a mount may report any year."""
    try:
        return f"{datetime.fromtimestamp(unix_time, UTC):%Y-%m-%d %H:%M}"
    except (OverflowError, OSError, ValueError):
        return "no date"


def likely_mistake(site: Place, other_site: Place) -> str:
    """Return the likely mistake that turns one site into the other; empty if none fits."""
    written = {
        "the sign of a longitude looks wrong, east is positive": Place(site.latitude, -site.longitude),
        "the sign of a latitude looks wrong, north is positive": Place(-site.latitude, site.longitude),
        "both signs look wrong, north and east are positive": Place(-site.latitude, -site.longitude),
        "latitude and longitude look swapped, latitude comes first": Place(site.longitude, site.latitude),
    }
    for text, place in written.items():
        if abs(place.latitude) <= 90.0 and earth_distance(place, other_site) <= SITE_CONTRADICTION:
            return text
    return ""


def _duration_text(seconds: float) -> str:
    minutes = abs(seconds) / 60.0
    if minutes < 90:
        return f"{minutes:.0f} minutes"
    return f"{minutes / 60:.1f} hours" if minutes < 2880 else f"{minutes / 1440:.0f} days"


def is_time_unknown(best_time: SourcedTime) -> bool:
    """Whether the time is unknown: this computer's clock is lost, and there is no other source."""
    return best_time.doubtful and best_time.unix < EARLIEST_VALID_TIME


def contradiction_warning(mount: Context) -> str:
    """Return all contradictions as one warning line, with how to correct each; empty if there are none."""
    doubts = [doubt.warning_line for doubt in contradictions_of(mount)]
    doubts += _park_warning(mount)
    return f"WARNING: {'; '.join(doubts)}" if doubts else ""


def log_contradictions(mount: Context) -> None:
    """Log the warning about contradictions; not again for the same ones if only the times in its text change."""
    if warning := contradiction_warning(mount):
        mount.note_once(warning, kind=re.sub(r"\([^()]* UTC\)", "", warning))


def _park_warning(mount: Context) -> Iterator[str]:
    """Yield a warning if the mount can be parked and its park position is beyond the limits."""
    limits, status = mount.policy.limits, mount.cache.last_value(GetStatus)
    if not mount.driver.implementation(Park) or status is None:
        return
    goal = mount.driver.destination(Park())
    try:
        if goal is not None:
            on_sky = mount.astrometry.from_axes(goal, on_wedge=not mount.driver.german) if status.equatorial else None
            limits.check_altitude(goal.alt if on_sky is None else mount.astrometry.horizontal(on_sky).alt)
        elif not mount.policy.own_park:
            check_unknown_park(Park(), limits)
    except Unsupported:
        return  # without a site its altitude is unknown
    except Fault:
        yield (
            "its park position is beyond lowest or highest; it is parked there all the same"
            if mount.policy.own_park
            else "parking is refused, because its park position may lie beyond lowest or highest: see the key park"
        )
