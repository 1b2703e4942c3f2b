"""Limits that no hand control gives over a wire: is this goto, this sync, this altitude, this hour angle allowed?

Pure functions; angles are degrees. A target exactly at a limit is allowed (an arcsecond of rounding counts as at the
limit), and a motion that leads out of a forbidden place is never forbidden.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from gateway.errors import BelowHorizon, PastMeridian, SyncTooFar, TooHigh
from gateway.operations import Equatorial
from gateway.spherical import separation, wrap180

_AT_LIMIT = 1.0 / 3600.0
#: Altitude of a Sun that may still shine into a tube: refraction, the disk, and a horizon that lies lower than the eye.
SUN_IS_UP = -1.0
#: Farther past the meridian than that, a tube has gone round under the pole and not against the pier.
_AROUND_THE_POLE = 90.0


class Limits(Struct, frozen=True):
    """The operator's limits: altitudes, how far a sync may move the sky, how near the Sun and how far past the
    meridian the tube may come. ``sun`` is 0 where it does not count, ``hour_angle`` None.
    """

    lowest: float = 0.0
    highest: float = 90.0
    sync: float = 15.0
    sun: float = 20.0
    hour_angle: float | None = None

    def narrowed(self, lowest: float | None, highest: float | None) -> Limits:
        """These limits made tighter for one client, never wider."""
        return replace(
            self,
            lowest=self.lowest if lowest is None else max(self.lowest, lowest),
            highest=self.highest if highest is None else min(self.highest, highest),
        )


def check_altitude(limits: Limits, altitude: float) -> None:
    """Raises BelowHorizon or TooHigh for a target outside the limits."""
    if altitude < limits.lowest - _AT_LIMIT:
        raise BelowHorizon("Object Below Horizon." if limits.lowest <= 0 else "Object Below Lower Limit.")
    if altitude > limits.highest + _AT_LIMIT:
        raise TooHigh("Object Above Higher Limit.")


def check_sync(limits: Limits, present: Equatorial, wanted: Equatorial) -> None:
    """Raises SyncTooFar for a sync that would move the sky by more than the limit."""
    distance = separation(present.ra, present.dec, wanted.ra, wanted.dec)
    if distance > limits.sync:
        raise SyncTooFar(f"Sync refused: {distance:.0f} degrees from the present position.")


def check_hour_angle(limits: Limits, hour_angle: float) -> None:
    """Raises PastMeridian for a target too far from the meridian for a mount that cannot change sides."""
    if limits.hour_angle is not None and abs(wrap180(hour_angle)) > limits.hour_angle + _AT_LIMIT:
        raise PastMeridian


def check_shaft(limits: Limits, first: float) -> None:
    """The same by the first axis of a German mount, which reads 90 degrees with the counterweight shaft down.

    Past the meridian the shaft stands above level. Raises PastMeridian.
    """
    if limits.hour_angle is not None and abs(wrap180(first - 90.0)) - 90.0 > limits.hour_angle + _AT_LIMIT:
        raise PastMeridian


def leaving(limits: Limits, before: float, now: float, margin: float) -> bool:
    """Whether an altitude is outside the limits, or will be within ``margin`` degrees, and is getting worse.

    There is nothing below -90 and above 90: those limits are none.
    """
    sinking = limits.lowest > -90.0 and now < limits.lowest + margin and now < before
    rising = limits.highest < 90.0 and now > limits.highest - margin and now > before
    return sinking or rising


def past_meridian(hour_angle: float, side: str | None) -> float:
    """How many degrees a tube stands beyond the meridian, towards the pier; negative where it is free.

    ``side`` is the side of the pier that the tube of a German mount is on. On the west side it looks east and has the
    pier before it once the hour angle is positive; on the east side it is the other way round. Without a side it is a
    fork on a wedge, whose hour angle counts in both directions.
    """
    hour_angle = wrap180(hour_angle)
    past = abs(hour_angle) if side is None else hour_angle if side == "W" else -hour_angle
    return past if side is None or past <= _AROUND_THE_POLE else past - 360.0
