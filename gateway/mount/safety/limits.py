"""The owner's limits. No hand control gives them over a wire, so the gateway keeps them.

Angles are degrees. What is exactly at a limit is allowed (an arcsecond of rounding counts as at the limit), and a
motion that leads out of a forbidden place is never forbidden.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from gateway.core.errors import BelowHorizon, TooHigh

AT_LIMIT = 1.0 / 3600.0


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

    def check_altitude(self, altitude: float) -> None:
        """Raises BelowHorizon or TooHigh for an altitude outside of them."""
        if altitude < self.lowest - AT_LIMIT:
            raise BelowHorizon("Object Below Horizon." if self.lowest <= 0 else "Object Below Lower Limit.")
        if altitude > self.highest + AT_LIMIT:
            raise TooHigh("Object Above Higher Limit.")

    def at_any_altitude(self) -> Limits:
        """The same for a place whose altitude is the owner's own decision."""
        return replace(self, lowest=-90.0, highest=90.0)
