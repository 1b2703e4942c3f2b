"""Where the Sun is that must not come into the tube.

It counts while it is up. When the mount's date and this computer's differ by more than a day nobody knows which one is
right, so both Suns count; while nobody has told a date, this computer's does, and the log says so, loudly.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway import operations as op
from gateway.hub.derived import Derived
from gateway.safety import SUN_IS_UP
from gateway.spherical import separation
from gateway.transcript import Transcript

DAY = 86400.0
#: The Sun moves a twenty-thousandth of a degree a second against the stars: one place is good for a minute.
KEPT = 60.0


class Suns:
    """``limit`` is how near to it the tube may come, degrees; with 0 there is no Sun at all.

    ``settled`` says whether the mount has had its chance to tell the date.
    """

    def __init__(self, derived: Derived, transcript: Transcript, limit: float, settled: Callable[[], bool]) -> None:
        self._derived, self._transcript, self.limit, self._settled = derived, transcript, limit, settled
        self._key: tuple[object, ...] = ()
        self._up: list[op.Equatorial] = []

    def up(self) -> list[op.Equatorial]:
        """The places of date of every Sun that counts now."""
        if not self.limit:
            return []
        observatory = self._derived.observatory
        if observatory.clock() is None and self._settled():
            self._transcript.note_once(
                "mount", "WARNING: nobody has told a date: the Sun is avoided by this computer's date and time"
            )
        mount, host, site = observatory.unix(), observatory.host(), observatory.site()
        key = mount // KEPT, host // KEPT, site
        if key != self._key:
            self._key = key
            moments = [mount]
            if abs(mount - host) > DAY:
                moments.append(host)
                self._transcript.note_once(
                    "mount", "WARNING: the mount's date is not this computer's: the Sun is avoided by both"
                )
            self._up = [place for place in (self._place(unix, site) for unix in moments) if place is not None]
        return self._up

    def _place(self, unix: float, site: op.Place | None) -> op.Equatorial | None:
        """The Sun of one moment; None when it is down. Without a site it counts as up."""
        sky = self._derived.sky
        ra, dec = sky.sun(unix)
        if site is not None and sky.horizon(ra, dec, site.latitude, site.longitude, unix)[1] < SUN_IS_UP:
            return None
        return op.Equatorial(ra, dec)

    def distances(self, seen: op.Equatorial) -> list[float]:
        """How far a place is from every Sun that counts, degrees."""
        return [separation(seen.ra, seen.dec, sun.ra, sun.dec) for sun in self.up()]
