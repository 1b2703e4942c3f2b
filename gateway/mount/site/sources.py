"""Which site and which clock the limits go by, and which others contradict them.

The mount's own count first: its coordinates are reckoned with them. Then its GPS receiver, the configuration (site) or
this computer's clock (time), and a program's word only where nothing else is known: any program may be set up wrongly,
and the limits belong to the owner of the telescope. What programs are told is another matter (``site_clock.py``).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gateway.astro.spherical import separation
from gateway.core.operations import Moment, Place
from gateway.mount.site.site_clock import SiteClock

#: Sources that differ by more than this contradict each other: degrees on the Earth, and seconds.
SITE_MATTERS, CLOCK_MATTERS = 0.5, 120.0
#: A computer whose clock shows an earlier time than 2024-01-01 has lost it. One that is off by more than a day, which
#: is no wrong zone and no morning for evening, contradicts nobody: many have no battery and no network.
EARLIEST, LOST = 1704067200.0, 86400.0

MOUNT, GPS, CONFIGURED, COMPUTER, PROGRAM = (
    "the mount", "its GPS", "the configuration", "this computer", "a program")  # fmt: skip


class Site(NamedTuple):
    """A site and who says so."""

    place: Place
    source: str


class Time(NamedTuple):
    """UTC as Unix seconds at this moment, and who says so."""

    unix: float
    source: str


class Contradiction(NamedTuple):
    """A site and a time that may be the true ones all the same; ``words`` say who says what."""

    place: Place | None
    unix: float
    words: str


class BestSources:
    """Site and time by the best source there is; what ``SiteAstrometry`` and the rules ask."""

    def __init__(self, site_clock: SiteClock) -> None:
        self._observatory = site_clock

    def sites(self) -> list[Site]:
        """Every site that is known, the best first."""
        told = self._observatory
        known = (
            (told.mount_site, MOUNT),
            (told.gps_site, GPS),
            (told.configured, CONFIGURED),
            (told.set_site(), PROGRAM),
        )
        return [Site(place, source) for place, source in known if place is not None]

    def times(self) -> list[Time]:
        """Every time that is known, the best first; this computer's last where it has plainly lost its clock."""
        told = self._observatory
        host = Time(told.host(), COMPUTER)
        found = [
            Time(moment.unix, source)
            for moment, source in ((told.running(told.mount_clock), MOUNT), (told.running(told.gps_clock), GPS))
            if moment is not None
        ]
        program = told.running(told.kept_clock)
        rest = [host] + ([Time(program.unix, PROGRAM)] if program is not None else [])
        return found + (rest if host.unix >= EARLIEST else rest[::-1])

    def site(self) -> Place | None:
        """The site in force for the limits; None when nobody has told one."""
        told = self._observatory
        return told.mount_site or told.gps_site or told.configured or told.set_site()

    def best_time(self) -> Time:
        """The best of ``times``, without the others where the mount tells one."""
        told = self._observatory
        moment = told.running(told.mount_clock)
        return self.times()[0] if moment is None else Time(moment.unix, MOUNT)

    def unix(self) -> float:
        """UTC in force for the limits, Unix seconds."""
        return self.best_time().unix

    def clock(self) -> Moment | None:
        """The same as a clock reading; None while only this computer tells the time."""
        best = self.best_time()
        return None if best.source == COMPUTER else Moment(best.unix, 0.0)

    @property
    def time_unknown(self) -> bool:
        """Whether nobody tells the time: this computer has plainly lost its clock, and there is no other."""
        best = self.best_time()
        return best.source == COMPUTER and best.unix < EARLIEST

    def host(self) -> float:
        """UTC by this computer's clock."""
        return self._observatory.host()

    def contradictions(self) -> Iterator[Contradiction]:
        """What others say that differs by more than matters, each site and each time with the best of the other."""
        sites, times = self.sites(), self.times()
        unix, by = times[0]
        if sites:
            (place, who), others = sites[0], sites[1:]
            for other in others:
                if _apart(place, other.place) > SITE_MATTERS:
                    hint = mistaken(place, other.place)
                    yield Contradiction(
                        other.place,
                        unix,
                        f"{who} stands at {shown(place)}, {other.source} says "
                        f"{shown(other.place)}{': ' * bool(hint)}{hint}",
                    )
        for time in times[1:]:
            apart = abs(time.unix - unix)
            if apart > CLOCK_MATTERS and not (time.source == COMPUTER and apart > LOST):
                yield Contradiction(
                    sites[0].place if sites else None,
                    time.unix,
                    f"the clocks of {by} and of {time.source} differ by {_span(time.unix - unix)}",
                )


def _apart(one: Place, other: Place) -> float:
    return separation(one.longitude, one.latitude, other.longitude, other.latitude)


def shown(place: Place) -> str:
    """A site as people write it: ``45.0 N 10.0 E``."""
    north, east = "NS"[place.latitude < 0], "EW"[place.longitude < 0]
    return f"{abs(place.latitude):.1f} {north} {abs(place.longitude):.1f} {east}"


def mistaken(one: Place, other: Place) -> str:
    """How one of two sites was most likely written wrongly; nothing where neither looks like the other."""
    written = {
        "the sign of a longitude looks wrong, east is positive": Place(one.latitude, -one.longitude),
        "the sign of a latitude looks wrong, north is positive": Place(-one.latitude, one.longitude),
        "both signs look wrong, north and east are positive": Place(-one.latitude, -one.longitude),
        "latitude and longitude look swapped, latitude comes first": Place(one.longitude, one.latitude),
    }
    return next(
        (
            words
            for words, place in written.items()
            if abs(place.latitude) <= 90.0 and _apart(place, other) <= SITE_MATTERS
        ),
        "",
    )


def _span(seconds: float) -> str:
    minutes = abs(seconds) / 60.0
    return (
        f"{minutes:.0f} minutes"
        if minutes < 90
        else f"{minutes / 60:.1f} hours"
        if minutes < 2880
        else (f"{minutes / 1440:.0f} days")
    )
