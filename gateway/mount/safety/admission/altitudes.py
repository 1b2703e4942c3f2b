"""The altitude of a direction, by every source of site and time that counts, and as if the syncs were wrong.

An altitude by the best known site and time (``SiteTimeSources``; the mount's own, if known) is checked against all
limits. But if the syncs since the alignment were wrong, the tube points elsewhere; and another source of site and time
that contradicts the best one may be right. Altitudes by these are only checked against limits that somebody has set.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from math import acos, cos, degrees, radians, sin
from typing import NamedTuple

from gateway.astro.spherical import SIDEREAL_RATE, wrap360
from gateway.core.errors import BelowHorizon, Contradicted, Fault
from gateway.core.operations import Equatorial
from gateway.mount.context import Context
from gateway.mount.policy import Limits
from gateway.mount.safety.admission.contradictions import (
    Contradiction,
    contradicting_skies,
    contradictions_of,
    full_text,
    summary,
)
from gateway.mount.site.astrometry import PointingFrame, SiteAstrometry, SyncShift


class AltitudeSource(NamedTuple):
    """One way to calculate an altitude: by the best known site and time; as if the syncs were wrong, so that the tube
    is off by ``sync_shift``; or by another site and time (``contradiction``), with the astronomy for these in ``sky``.
    """

    mount: Context
    sync_shift: SyncShift | None = None
    contradiction: Contradiction | None = None
    sky: SiteAstrometry | None = None

    @property
    def is_best_known(self) -> bool:
        """Whether the altitude follows from the best known site and time, and the syncs count as right."""
        return self.sync_shift is None and self.contradiction is None

    def altitude(self, position: Equatorial) -> float:
        """Return the altitude of the tube while the mount reports ``position``, degrees."""
        return (self.sky or self.mount.astrometry).horizontal(self.mount.suns.pointing(position, self.sync_shift)).alt

    def check(self, limits: Limits, altitude: float) -> None:
        """Check an altitude that follows from this source. Raises BelowHorizon or TooHigh if the source is the best
        known one, else Contradicted, whose text names the source.
        """
        try:
            (limits if self.is_best_known else limits.without_default_altitudes()).check_altitude(altitude)
        except Fault as fault:
            which = "low" if isinstance(fault, BelowHorizon) else "high"
            if self.contradiction is not None:
                text = f"Too {which}, if {self.contradiction.sources[1]} is right: {full_text(self.contradiction)}"
                raise Contradicted(text, f"Too {which} by {summary(self.contradiction)}.") from None
            if self.sync_shift is None:
                raise
            off = max(abs(self.sync_shift.first), abs(self.sync_shift.second))
            raise Contradicted(
                f"Too {which}, if the syncs since the alignment were wrong: they have turned an axis by {off:.0f} "
                "degrees. Align the mount again.",
                f"Too {which} by its axes: syncs turned one by {off:.0f} degrees.",
            ) from None


def mount_sources(mount: Context) -> Iterator[AltitudeSource]:
    """Yield the source by the best site and time, then those as if the syncs were wrong; nothing without a site."""
    if mount.sources.site() is not None:
        yield AltitudeSource(mount)
        yield from unsynced_sources(mount, mount.tube_frame())


def unsynced_sources(mount: Context, frame: PointingFrame) -> Iterator[AltitudeSource]:
    """Yield an altitude source for each offset that the tube may have if the syncs were wrong."""
    for shift in frame.shifts:
        yield AltitudeSource(mount, sync_shift=shift)


def contradicting_sources(mount: Context, limits: Limits) -> Iterator[AltitudeSource]:
    """Yield the sources that contradict the best site and time; nothing if the user has set no altitude limit."""
    written = limits.without_default_altitudes()
    if written.lowest <= -90.0 and written.highest >= 90.0:
        return
    for contradiction, sky in contradicting_skies(mount):
        yield AltitudeSource(mount, contradiction=contradiction, sky=sky)


def check_goal(mount: Context, limits: Limits, goal: Equatorial) -> float:
    """Return the altitude of a goal in degrees by the best known site and time (a site must be known). Raises
    BelowHorizon or TooHigh if it violates a limit, Contradicted if the altitude by another source violates a set one.
    """
    altitude = check_altitude(mount, limits, goal)
    for source in (*unsynced_sources(mount, mount.tube_frame()), *contradicting_sources(mount, limits)):
        source.check(limits, source.altitude(goal))
    return altitude


def check_altitude(mount: Context, limits: Limits, goal: Equatorial) -> float:
    """Return the altitude of a goal in degrees by the best known site and time. Raises BelowHorizon or TooHigh."""
    altitude = mount.astrometry.horizontal(goal).alt
    try:
        limits.check_altitude(altitude)
    except Fault as fault:
        text = [f"{_violation_text(limits, altitude)} ({altitude:.0f}°).", *_rise_time_text(mount, limits, goal)]
        text += [full_text(first) for first in list(contradictions_of(mount))[:1]]
        raise type(fault)(" ".join(text), str(fault)) from None
    return altitude


def _violation_text(limits: Limits, altitude: float) -> str:
    if altitude > limits.highest:
        return f"It is above the highest altitude, {limits.highest:g}°"
    return "It is below the horizon" if limits.lowest <= 0.0 else f"It is below the lowest altitude, {limits.lowest:g}°"


def _rise_time_text(mount: Context, limits: Limits, goal: Equatorial) -> Iterator[str]:
    """Yield a sentence on when a goal rises above the lowest altitude, in the mount's local time if known."""
    latitude, dec, height = (radians(angle) for angle in (mount.astrometry.site().latitude, goal.dec, limits.lowest))
    hour_angle = mount.astrometry.sidereal_time() - goal.ra
    if mount.astrometry.horizontal(goal).alt > limits.lowest:
        return
    half = (sin(height) - sin(latitude) * sin(dec)) / max(1e-9, cos(latitude) * cos(dec))
    if half >= 1.0:
        yield "It does not rise here."
        return
    seconds = wrap360(-degrees(acos(max(-1.0, half))) - hour_angle) / SIDEREAL_RATE
    clock = mount.site_clock.mount_clock
    at = datetime.fromtimestamp(mount.sources.unix() + seconds, UTC) + timedelta(hours=clock[0].offset if clock else 0)
    yield f"It rises at {at:%H:%M}{'' if clock else ' UTC'}."
