"""Tells of a Sun that comes to the tube by itself: to one that rests, or that rises beside one that tracks.

The gateway begins no motion, so it cannot move the tube away. It tells the user a quarter of an hour before, in the
log, in ``status`` and on the page, and goes on telling while the Sun is near.
"""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_RATE, separation
from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.astrometry import Sun
from gateway.mount.site.site_clock import MOUNT

#: Seconds for which the Sun is followed ahead, between two instants that are examined, and between two examinations;
#: until the next one if the mount must be asked first.
AHEAD, STEP, AGAIN, SOON = 900.0, 60.0, 30.0, 1.0
WAY_OUT = "cover the tube, or move it away."


class SunAhead:
    """``words`` say which Sun comes near and when; empty if none does. Call ``check`` with every position."""

    def __init__(self, mount: Context, reader: Reader, watch: LimitWatch) -> None:
        self._mount, self._reader, self._watch = mount, reader, watch
        self._next = float("-inf")
        self.words = ""

    def check(self, seen: op.Equatorial) -> None:
        """Examine a position of the mount, twice a minute."""
        mount, now = self._mount, self._mount.now()
        if now < self._next or not mount.suns.limit:
            return
        self._next = now + AGAIN
        before, self.words = self.words, ""
        if mount.movement.anything or self._watch.moved_by_others or not mount.sources.sites():
            return
        resting, tracking = self._find(seen, tracks=False), self._find(seen, tracks=True)
        if not (resting or tracking):
            return
        status, age = mount.cache.value(op.GetStatus), mount.cache.age(op.GetStatus, now)
        if status is None or age > AGAIN:  # without programs nobody asks whether it tracks
            self._reader.shared(op.GetStatus())
        if status is None or not status.aligned:
            self._next = now + SOON
            return
        self.words = resting if status.tracking is op.Tracking.OFF else tracking
        if self.words and not before:
            mount.note(f"WARNING: {self.words}")

    def _find(self, seen: op.Equatorial, tracks: bool) -> str:
        """Return what to tell of the first Sun that comes near a tube that rests, or that tracks; or an empty text."""
        suns = self._mount.suns
        up = {(sun.shift, sun.own) for sun in suns.up()}
        for minute in range(round(AHEAD / STEP) + 1):
            for sun in suns.suns(self._mount.frame(), minute * STEP):
                distance = self._distance(seen, sun, 0.0 if tracks else minute * STEP)
                if distance < suns.limit:
                    return self._words(sun, distance, minute, (sun.shift, sun.own) not in up, tracks)
        return ""

    def _distance(self, seen: op.Equatorial, sun: Sun, seconds: float) -> float:
        """How far a Sun of that time is from a tube that rests so long: the sky turns over it."""
        tube = self._mount.suns.tube(seen, sun.shift)
        return separation(tube.ra + SIDEREAL_RATE * seconds, tube.dec, sun.ra, sun.dec)

    def _words(self, sun: Sun, distance: float, minute: int, rises: bool, tracks: bool) -> str:
        source = sun.time.source if sun.site is None or sun.time.source != MOUNT else sun.site.source
        by = "" if sun.own else f" by {source}"
        tube = f"the {'tracking' if tracks else 'resting'} tube"
        when = "" if minute == 0 else f" in {minute} minute{'s' * (minute != 1)}"
        if minute and not rises:
            return f"the Sun{by} comes within {self._mount.suns.limit:g} degrees of {tube}{when}: {WAY_OUT}"
        return f"the Sun{by} {'rises' if rises else 'is'} {distance:.0f} degrees from {tube}{when}: {WAY_OUT}"
