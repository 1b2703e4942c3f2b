"""The decisions of the mount's owner: limits, parking, whether the mount is held, how long clients may be silent.

Hand controls do not report their limits, so the gateway has its own. Angles are degrees. A position exactly at a limit
is allowed, and a motion that leads out of a forbidden region is never forbidden. Altitude limits that somebody has
written hold by every source of site and time, and on the way of a goto. The default limits, 0 and 90 degrees, only
judge goals by the mount's own site and clock, and end arrows and tracking.
"""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Held, Invalid, Refused, TooHigh

#: Degrees that rounding may explain at a limit.
LIMIT_TOLERANCE = 0.1
#: The motion orders that are allowed while a mount is held; all others are refused.
HOLD_ALLOWS = (op.AbortSlew, op.Choose, op.Focus, op.StopAxis, op.Hibernate, op.Sync, op.TrackRate)
CHOOSE = "Write park = [AZ, ALT] under [mount] for a place of your own choice, which may lie beyond lowest and highest."


class Limits(Struct, frozen=True):
    """The owner's limits: altitudes, the largest sync, the smallest distance from the Sun (``sun``, 0 for none), the
    largest hour angle past the meridian (None for none). All in degrees. ``at_keys`` are the altitudes for motion at
    the hand control's keys: only limits that the owner has written end that. ``by_page``: a page has narrowed them.
    """

    lowest: float = 0.0
    highest: float = 90.0
    sync: float = 15.0
    sun: float = 20.0
    hour_angle: float | None = None
    at_keys: tuple[float, float] = (-90.0, 90.0)
    by_page: bool = False

    def narrowed(
        self,
        lowest: float | None = None,
        highest: float | None = None,
        sun: float | None = None,
        hour_angle: float | None = None,
    ) -> Limits:
        """Return these limits, made tighter, never wider."""
        angles = [angle for angle in (self.hour_angle, hour_angle) if angle is not None]
        return replace(
            self,
            lowest=self.lowest if lowest is None else max(self.lowest, lowest),
            highest=self.highest if highest is None else min(self.highest, highest),
            sun=max(self.sun, sun or 0.0),
            hour_angle=min(angles, default=None),
        )

    def narrowed_by_page(self, **limits_asked: float | None) -> Limits:
        """Return these limits, made tighter by a page for all clients. Raises Invalid."""
        limits = self.narrowed(**limits_asked)
        if any(value not in (None, getattr(limits, name)) for name, value in limits_asked.items()):
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
        """Check an altitude. Raises BelowHorizon or TooHigh."""
        if altitude < self.lowest - LIMIT_TOLERANCE:
            raise BelowHorizon("Object Below Horizon." if self.lowest <= 0 else "Object Below Lower Limit.")
        if altitude > self.highest + LIMIT_TOLERANCE:
            raise TooHigh("Object Above Higher Limit.")

    def for_keys(self) -> Limits:
        """Return these limits for motion at the mount's own keys."""
        return replace(self, lowest=min(self.lowest, self.at_keys[0]), highest=max(self.highest, self.at_keys[1]))

    def written(self) -> Limits:
        """Return these limits with the altitudes that somebody has written: the owner, or a page or a program if they
        are tighter than the horizon and the zenith. The others are off."""
        return replace(
            self,
            lowest=self.lowest if self.lowest > 0.0 or self.at_keys[0] > -90.0 else -90.0,
            highest=self.highest if self.highest < 90.0 else 90.0,
        )

    def at_any_altitude(self) -> Limits:
        """Return these limits without the altitudes, for a position that the owner has chosen."""
        return replace(self, lowest=-90.0, highest=90.0)


class Policy(Struct, frozen=True):
    """The owner's settings; a field with the name of a key of ``[mount]`` has its value.

    ``own_park``: the owner has chosen the park position. ``unaligned``: whether a mount that is not aligned may be sent
    to axis readings (``allow`` or ``refuse``). ``dead_man`` and ``dead_man_closed``: for how
    many seconds a client that moves the mount by hand may be silent while connected, and after it has disconnected.
    ``run_on``: for how many seconds at full speed the mount runs on after a stop.
    """

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str | None = None
    own_park: bool = False
    unaligned: str = "refuse"
    dead_man: float = 30.0
    dead_man_closed: float = 5.0
    run_on: float = 0.5


def check_own_park(operation: op.Park | op.Home, limits: Limits) -> None:
    """Check whether a mount may park at a position that only the mount knows. Raises Refused.

    A Meade parks at the position set at its keypad, which no command reads; the default is the horizon. So it may park
    if the limits are no narrower than the horizon, or if the owner allows it with park = "mount".
    """
    if isinstance(operation, op.Park) and (limits.lowest > 0.0 or limits.highest < 90.0):
        raise Refused(
            "Only the mount knows its park position, which may lie beyond lowest or highest. "
            'Write park = "mount" under [mount] to allow it, or send the mount to a position that you choose.'
        )


class Hold:
    """While it is ``on``, no order may move the mount or turn its tracking on (``mount-gateway stop --hold``).

    Orders that end a motion or tracking are allowed, and orders that move nothing: reads, settings, syncs, the rate of
    a drive that is on, and the focuser, which does not turn the mount.
    """

    def __init__(self) -> None:
        self.on = False

    def admit(self, operation: op.Operation) -> None:
        """Check a motion order. Raises Held."""
        stays = isinstance(operation, HOLD_ALLOWS) or (isinstance(operation, op.SetTracking) and not operation.on)
        if self.on and not stays:
            raise Held
