"""The decisions of the mount's owner: limits, parking, a hold on motion, how long clients may be silent.

Hand controls do not report their limits, so the gateway has its own. Angles are degrees. A position exactly at a limit
is allowed, and a motion that leads out of a forbidden region is never forbidden. The default altitude limits, 0 and 90
degrees, apply to the goals of gotos, by the mount's own site and clock. They also end tracking and manual motion.
Altitude limits that the owner has set apply also along the path of a goto, and by every known site and clock.
"""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Held, Invalid, Refused, TooHigh

#: Degrees by which a position may exceed a limit because of rounding.
LIMIT_TOLERANCE = 0.1
#: The motion orders that are allowed during a `Hold`; all others are refused.
ALLOWED_IN_HOLD = (op.AbortSlew, op.Choose, op.Focus, op.StopAxis, op.Hibernate, op.Sync, op.TrackRate)
#: The advice in the refusal of a park or home: how to choose a park position.
PARK_TIP = (
    "Write park = [AZ, ALT] under [mount] for a place of your own choice, which may lie beyond lowest and highest."
)


class Limits(Struct, frozen=True):
    """The owner's limits in degrees: lowest and highest altitude, largest sum of syncs, smallest distance from the Sun
    (0 for none), largest hour angle past the meridian (None: any). ``key_limits``: altitude limits for motion by the
    hand control's keys, -90 and 90 unless the owner has set them. ``by_page``: a web page has narrowed the limits.
    """

    lowest: float = 0.0
    highest: float = 90.0
    sync: float = 15.0
    sun: float = 20.0
    hour_angle: float | None = None
    key_limits: tuple[float, float] = (-90.0, 90.0)
    by_page: bool = False

    def narrowed(
        self,
        lowest: float | None = None,
        highest: float | None = None,
        sun: float | None = None,
        hour_angle: float | None = None,
    ) -> Limits:
        """Return these limits, narrowed to the arguments where these are tighter; None leaves a limit as it is."""
        angles = [angle for angle in (self.hour_angle, hour_angle) if angle is not None]
        return replace(
            self,
            lowest=self.lowest if lowest is None else max(self.lowest, lowest),
            highest=self.highest if highest is None else min(self.highest, highest),
            sun=max(self.sun, sun or 0.0),
            hour_angle=min(angles, default=None),
        )

    def narrowed_by_page(self, **requested_limits: float | None) -> Limits:
        """Return these limits, narrowed for all clients by a web page. Raises Invalid for a wider limit or no range."""
        limits = self.narrowed(**requested_limits)
        if any(value not in (None, getattr(limits, name)) for name, value in requested_limits.items()):
            raise Invalid(f"The configuration allows {self}; a page can only narrow that.")
        if limits.lowest >= limits.highest:
            raise Invalid("Nothing would be allowed: the lowest altitude must be below the highest.")
        return replace(limits, by_page=limits != self)

    def as_text(self) -> Iterator[str]:
        """Yield the limits, as text for the user."""
        yield f"altitude {self.lowest:g}° to {self.highest:g}°"
        if self.sun > 0.0:
            yield f"no nearer to the Sun than {self.sun:g}°"
        if self.hour_angle is not None:
            yield f"no more than {self.hour_angle / 15.0:g} h past the meridian"

    def __str__(self) -> str:
        return ", ".join(self.as_text())

    def check_altitude(self, altitude: float) -> None:
        """Check that an altitude, degrees, is within the limits. Raises BelowHorizon or TooHigh."""
        if altitude < self.lowest - LIMIT_TOLERANCE:
            raise BelowHorizon("Object Below Horizon." if self.lowest <= 0 else "Object Below Lower Limit.")
        if altitude > self.highest + LIMIT_TOLERANCE:
            raise TooHigh("Object Above Higher Limit.")

    def for_keypad(self) -> Limits:
        """Return these limits for motion by the hand control's keys."""
        return replace(self, lowest=min(self.lowest, self.key_limits[0]), highest=max(self.highest, self.key_limits[1]))

    def without_default_altitudes(self) -> Limits:
        """Return these limits without default altitudes: a limit that nobody has set becomes -90 or 90 degrees."""
        return replace(
            self,
            lowest=self.lowest if self.lowest > 0.0 or self.key_limits[0] > -90.0 else -90.0,
            highest=self.highest if self.highest < 90.0 else 90.0,
        )

    def without_altitudes(self) -> Limits:
        """Return these limits without altitude limits, for a park position that the owner has chosen."""
        return replace(self, lowest=-90.0, highest=90.0)


class Policy(Struct, frozen=True):
    """The owner's settings. A field with the name of a key of ``[mount]`` in gateway.toml has the value of that key.

    ``own_park``: the owner has chosen the park position. ``unaligned``: whether a mount that is not aligned may be sent
    to axis readings (``allow`` or ``refuse``). ``dead_man`` and ``dead_man_closed``: for how many seconds the client of
    a manual motion may be silent while it is connected, and after it has disconnected. ``run_on``: for how many seconds
    after a stop the mount continues at its previous speed.
    """

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str | None = None
    own_park: bool = False
    unaligned: str = "refuse"
    dead_man: float = 30.0
    dead_man_closed: float = 5.0
    run_on: float = 0.5


def check_unknown_park(operation: op.Park | op.Home, limits: Limits) -> None:
    """Check that a mount may park at a position that the gateway cannot read. Raises Refused if it may not.

    A Meade parks at the position set at its keypad, which no command reads; the default is the horizon. So it may park
    if the limits are no narrower than the horizon, or if the owner allows it with park = "mount".
    """
    if isinstance(operation, op.Park) and (limits.lowest > 0.0 or limits.highest < 90.0):
        raise Refused(
            "Only the mount knows its park position, which may lie beyond lowest or highest. "
            'Write park = "mount" under [mount] to allow it, or send the mount to a position that you choose.'
        )


class Hold:
    """While ``is_on`` is set, no order may move the mount or turn its tracking on (``mount-gateway stop --hold``).

    Orders that end a motion or tracking are allowed, and orders that move nothing: reads, settings, syncs, the rate of
    a drive that already runs, and the focuser, which does not turn the mount.
    """

    def __init__(self) -> None:
        self.is_on = False

    def check_allowed(self, operation: op.Operation) -> None:
        """Check whether this motion order is allowed now. Raises Held if not."""
        stays = isinstance(operation, ALLOWED_IN_HOLD) or (isinstance(operation, op.SetTracking) and not operation.on)
        if self.is_on and not stays:
            raise Held
