"""What the owner of a mount has decided: its limits, where it may park, whether it is held, and how it is treated.

No hand control gives limits over a wire, so the gateway keeps them. Angles are degrees. What is exactly at a limit is
allowed (an arcsecond of rounding counts as at the limit), and a motion that leads out of a forbidden place is never
forbidden.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Held, Refused, TooHigh

AT_LIMIT = 1.0 / 3600.0
#: What is allowed while a mount is held, of all that takes its turn among the motions; whatever is new is refused until
#: it is written here.
STILL = (op.AbortSlew, op.Choose, op.Focus, op.StopAxis, op.Hibernate, op.Sync, op.TrackRate)
CHOOSE = "Write park = [AZ, ALT] under [mount] for a place of your own choice, which may lie beyond lowest and highest."


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


class Policy(Struct, frozen=True):
    """``own_park``: the park position is his own choice. ``unaligned``: whether a mount that is not aligned may be sent
    to axis readings (``allow`` or ``refuse``). ``silence`` and ``silence_closed`` are for how many seconds a client
    that moves the mount by hand may be silent, on an open connection and after it was closed.
    """

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str = "jnow"
    own_park: bool = False
    unaligned: str = "refuse"
    silence: float = 30.0
    silence_closed: float = 5.0


def check_own_park(operation: op.Park | op.Home, limits: Limits) -> None:
    """Parking at a place that only the mount itself knows. Raises Refused.

    A Meade parks where it was told at its keypad, which nobody can ask it for; its own default is the horizon. So it
    parks by itself where the limits are no narrower than the horizon, or where the owner allows it with park = "mount".
    """
    if isinstance(operation, op.Park) and (limits.lowest > 0.0 or limits.highest < 90.0):
        raise Refused(
            "Where this mount parks is known to itself alone, and may lie beyond lowest or highest. "
            'Write park = "mount" under [mount] to allow it, or send it to a place that you choose.'
        )


class Hold:
    """While it is ``on`` nothing moves the mount or switches its tracking on (``mount-gateway stop --hold``).

    What ends a motion or tracking goes on, and so does what moves nothing: reads, settings, syncs, the rate at which a
    drive that is on follows the sky, and the focuser, which hangs on the mount and does not turn it.
    """

    def __init__(self) -> None:
        self.on = False

    def admit(self, operation: op.Operation) -> None:
        """Asked for everything that takes its turn among the motions. Raises Held."""
        stays = isinstance(operation, STILL) or (isinstance(operation, op.SetTracking) and not operation.on)
        if self.on and not stays:
            raise Held
