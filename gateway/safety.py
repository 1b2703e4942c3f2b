"""Limits that no hand control gives over a wire: is this goto, this sync, this altitude allowed?

Pure functions. A target exactly at a limit is allowed (an arcsecond of rounding counts as at the limit).
"""

from __future__ import annotations

from msgspec import Struct

from gateway.errors import BelowHorizon, SyncTooFar, TooHigh
from gateway.operations import Equatorial
from gateway.spherical import separation

_AT_LIMIT = 1.0 / 3600.0


class Limits(Struct, frozen=True):
    """The operator's limits: altitudes in degrees, and how far a sync may move the sky."""

    lowest: float = 0.0
    highest: float = 90.0
    sync: float = 15.0

    def narrowed(self, lowest: float | None, highest: float | None) -> Limits:
        """These limits made tighter for one client, never wider."""
        return Limits(
            lowest=self.lowest if lowest is None else max(self.lowest, lowest),
            highest=self.highest if highest is None else min(self.highest, highest),
            sync=self.sync,
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


def leaving(limits: Limits, before: float, now: float, margin: float) -> bool:
    """Whether an altitude is outside the limits, or will be within ``margin`` degrees, and is getting worse."""
    return (now < limits.lowest + margin and now < before) or (now > limits.highest - margin and now > before)
