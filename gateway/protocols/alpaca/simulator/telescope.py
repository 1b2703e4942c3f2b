"""The state and the mechanics of a simulated Alpaca telescope.

The parameters of ``AlpacaTelescope`` imitate the differences between real servers.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import cache
from typing import Any, NamedTuple

from gateway.astro.axes import Build, Observer, Pair
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import (
    SIDEREAL_RATE,
    fold_declination,
    horizon_to_hour_angle,
    hour_angle_to_horizon,
    wrap180,
    wrap360,
)
from gateway.core.errors import UserError
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.wireformat.command_set import load

#: ASCOM's error numbers.
NOT_IMPLEMENTED, INVALID_VALUE, NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
PARKED, INVALID_OPERATION, NO_ACTION = 0x408, 0x40B, 0x40C
#: Seconds that ``connect`` takes.
CONNECT_DURATION = 0.5
#: The fastest rate of each axis, degrees a second.
MAX_RATE = 4.0


class AlpacaError(Exception):
    """An error with ASCOM's number, which the server sends in JSON with HTTP status 200."""

    def __init__(self, number: int, text: str) -> None:
        super().__init__(text)
        self.number = number


class SimulatedKind(NamedTuple):
    """The properties of a kind of simulated mount."""

    build: Build  # of the mounting: alt-az, wedge or German
    alignment_mode: int  # ASCOM's AlignmentMode
    power_on_axes: Pair  # the positions of the axes at power-on on the northern hemisphere, degrees
    rate_ranges: tuple[Pair, ...]  # AxisRates: least and greatest rate of each range, degrees a second


KINDS = {
    "german": SimulatedKind(Build.GERMAN, 2, (90.0, 90.0), ((0.001, MAX_RATE),)),
    "altaz": SimulatedKind(Build.ALTAZ, 0, (180.0, 45.0), ((0.001, 0.5), (1.0, MAX_RATE))),
    "polar": SimulatedKind(
        Build.WEDGE, 1, (180.0, 0.0), tuple((rate, rate) for rate in (0.0042, 0.067, 0.5, 2.0, MAX_RATE))
    ),
}


def check_range(value: float, low: float, high: float, name: str) -> float:
    """Return the value. Raises AlpacaError if it is out of range."""
    if not low <= value <= high:
        raise AlpacaError(INVALID_VALUE, f"{name} {value:g} is out of range, {low:g} to {high:g}")
    return value


@cache
def members() -> dict[str, Any]:
    """Return the tables of ``simulator.toml``: parameters and conditions of the telescope's members."""
    return load("alpaca").extra_table("simulator.toml")


class AlpacaTelescope(Simulated):
    """A simulated Alpaca telescope without its server. ``site`` is latitude and longitude east, degrees; ``clock``
    returns Unix seconds. Raises UserError for an unknown model.
    """

    def __init__(
        self,
        model: str = "german",
        *,
        clock: Callable[[], float],
        site: Pair = (45.0, 10.0),
        aligned: bool = True,  # it tracks at the start
        speed: float = 1.0,  # how many times faster than a real mount it slews
        ramps: bool = True,  # motors accelerate gradually
        platform: int = 7,  # version of ASCOM's platform: 6 has no DeviceState and no ``connect``
        lacks: frozenset[str] = frozenset(),  # missing members, by their names in paths; ``Can…`` report them missing
        answers: Mapping[str, Any] | None = None,  # member -> value that it reports instead of the real one
        senses: tuple[int, int] = (1, 1),  # the signs of MoveAxis for the two axes
        adds_tracking: bool = False,  # rates of MoveAxis are added to tracking instead of replacing it
        lowest_altitude: float = -90.0,  # it refuses slews below this altitude, degrees
        parked: bool = False,
        blocks: bool = False,  # a request to slew is answered when the slew has ended
        quiet_axes: bool = False,  # Slewing is false while an axis is moved by MoveAxis
        sends_j2000: bool = False,  # all coordinates are J2000, and it declares so
        keeps_clock: bool = False,  # it accepts a time and ignores it
    ) -> None:
        if model not in KINDS:
            raise UserError(f"no simulated Alpaca telescope is called {model!r}; there are {', '.join(KINDS)}")
        self.model, self.kind, self.unique_id = model, KINDS[model], str(uuid.uuid4())
        self.clock, self.now = clock, clock()
        self.platform, self.answers, self.senses = platform, dict(answers or {}), senses
        self.lacks = lacks | set(members()["which"]["absent"]) | set(members()["lacks"][model])
        self.lowest_altitude, self.blocks, self.quiet_axes = lowest_altitude, blocks, quiet_axes
        self.sends_j2000, self.keeps_clock, self._ephemeris = sends_j2000, keeps_clock, Sky()
        first, second = self.kind.power_on_axes
        if site[0] < 0.0 and self.kind.build is not Build.GERMAN:
            first = 0.0
        self.power_on_axes: Pair = (first, second)
        self.park_at = self.power_on_axes
        self.mechanics = Mechanics(self.kind.build, Observer(*site), self.now, self.power_on_axes)
        self.mechanics.max_rate, self.mechanics.speedup = MAX_RATE, speed
        self.mechanics.acceleration = MAX_RATE / RAMP_SECONDS if ramps else math.inf
        self.connected_since, self.elevation = math.inf, 100.0
        self.target: list[float | None] = [None, None]
        self.drive_rate, self.guides = 0, [SIDEREAL_RATE / 2.0, SIDEREAL_RATE / 2.0]
        self.adds_tracking = adds_tracking
        self.moving_axes: set[int] = set()
        #: Axis moved by MoveAxis -> the speed at which it tracked before, degrees a second.
        self.tracking_speeds: dict[int, float] = {}
        #: The position that it slews to, and the one at which it rests: ``park``, ``home``, or empty for any other.
        self.destination, self.at = "", "park" if parked else ""
        self.tracks = False
        self.track(aligned and not parked)

    def advance_to_now(self) -> None:
        """Advance the simulation to the present time, and note the arrival at the park or home position."""
        self.now = self.clock()
        self.mechanics.advance(self.now)
        if self.destination and not self.mechanics.slewing(self.now):
            self.at, self.destination = self.destination, ""

    # --- what it says of itself ---------------------------------------------------------------------------------------

    @property
    def connected(self) -> bool:
        return self.now >= self.connected_since

    @property
    def sky(self) -> Observer:
        """The site and the clock with which the mount calculates."""
        return self.mechanics.sky

    @property
    def reports_slewing(self) -> bool:
        """Slewing: true in a slew; unless ``quiet_axes``, also in MoveAxis and while speeds change (not in pulses)."""
        if self.mechanics.slewing(self.now):
            return True
        ramps = self.mechanics.is_ramping(self.now) and not self.is_pulsing
        return not self.quiet_axes and (bool(self.moving_axes) or ramps)

    @property
    def is_pulsing(self) -> bool:
        return any(self.mechanics.pulsing(self.now, axis) for axis in (1, 2))

    def reported_position(self) -> Pair:
        """Return right ascension and declination in the equinox that the server uses, degrees."""
        position = fold_declination(*self.mechanics.believed_position(self.now))
        return self._ephemeris.to_j2000(*position, self.utc()) if self.sends_j2000 else position

    def azimuth_altitude(self) -> Pair:
        """Return azimuth and altitude, degrees."""
        ra, dec = fold_declination(*self.mechanics.believed_position(self.now))
        return hour_angle_to_horizon(wrap180(self.sky.lst(self.now) - ra), dec, self.sky.latitude)

    def utc(self) -> float:
        """Return the time of the mount's clock, Unix seconds."""
        return self.now + self.sky.clock_ahead

    # --- what it does -------------------------------------------------------------------------------------------------

    def track(self, on: bool) -> None:
        self.tracks = on
        self.tracking_speeds.clear()
        self.mechanics.track(self.now, on, self.mechanics.geometry.pole_sign)

    def to_jnow(self, ra: float, dec: float) -> Pair:
        """Convert coordinates of a program to the equinox of date."""
        return self._ephemeris.from_j2000(ra, dec, self.utc()) if self.sends_j2000 else (ra, dec)

    def slew(self, ra: float, dec: float) -> None:
        """Slew to a position in degrees. Raises AlpacaError if tracking is off or the position too low."""
        if not self.tracks:
            raise AlpacaError(INVALID_OPERATION, "SlewToCoordinates is not allowed when tracking is False")
        ra, dec = self.to_jnow(ra, dec)
        self._check_alt(hour_angle_to_horizon(wrap180(self.sky.lst(self.now) - ra), dec, self.sky.latitude)[1])
        self.end_moves()
        self.mechanics.goto_sky(self.now, ra, dec)

    def slew_altaz(self, azimuth: float, altitude: float) -> None:
        """Slew to an azimuth and altitude, then rest. Raises AlpacaError if tracking is on or the altitude too low."""
        if self.tracks:
            raise AlpacaError(INVALID_OPERATION, "SlewToAltAz is not allowed when tracking is True")
        check_range(azimuth, 0.0, 360.0, "Azimuth")
        self._check_alt(check_range(altitude, -90.0, 90.0, "Altitude"))
        goal = horizon_to_hour_angle(azimuth, altitude, self.sky.latitude)
        geometry, correction = self.mechanics.geometry, self.mechanics.sync_correction
        first, second = geometry.to_axes(*goal, geometry.is_flipped(goal[0]))
        self.slew_to_axes((wrap360(first - correction[0]), second - correction[1]))

    def _check_alt(self, altitude: float) -> None:
        if altitude < self.lowest_altitude:
            raise AlpacaError(INVALID_OPERATION, f"The target is below the limit of {self.lowest_altitude:g} degrees")

    def slew_to_axes(self, axes: Pair, target: str = "") -> None:
        """Slew to axis positions. ``target`` is ``park`` or ``home`` if they are that position; tracking then ends."""
        self.end_moves()
        if target:
            self.track(False)
        self.mechanics.goto_axes(self.now, *axes)
        self.destination = target

    def park(self) -> None:
        if self.at != "park":
            self.slew_to_axes(self.park_at, "park")

    def set_clock(self, text: str) -> None:
        """Set the mount's clock to an ISO date and time. Raises AlpacaError if the text is no date."""
        try:
            unix = datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()
        except ValueError:
            raise AlpacaError(INVALID_VALUE, f"{text!r} is no date") from None
        if not self.keeps_clock:
            self.mechanics.relocate(self.now, self.sky._replace(clock_ahead=unix - self.now))

    def move_at_rate(self, axis: int, rate: float) -> None:
        """Carry out MoveAxis for axis 0 or 1. Raises AlpacaError for another axis, or for a rate not in AxisRates."""
        if check_range(axis, 0, 2, "Axis") == 2:
            raise AlpacaError(NOT_IMPLEMENTED, "There is no third axis")
        if rate and not any(low <= abs(rate) <= high for low, high in self.kind.rate_ranges):
            raise AlpacaError(INVALID_VALUE, f"Rate {rate:g} is not in AxisRates")
        self.move_axis(axis + 1, rate)

    def move_axis(self, axis: int, rate: float) -> None:
        """Move axis 1 or 2 by hand, at a rate in degrees a second; rate 0 ends this and resumes tracking."""
        self.mechanics.stop_goto(self.now)
        self.at = self.destination = ""
        if rate:
            tracking_speed = (
                self.mechanics.speeds(self.now)[axis - 1]
                if axis not in self.moving_axes
                else self.tracking_speeds.get(axis, 0.0)
            )
            self.tracking_speeds[axis] = tracking_speed if self.adds_tracking and self.tracks else 0.0
            self.moving_axes.add(axis)
            self.mechanics.move(self.now, axis, self.senses[axis - 1] * rate + self.tracking_speeds[axis])
        elif axis in self.moving_axes:
            self.moving_axes.discard(axis)
            self.mechanics.resume_axis(self.now, axis)
            if not self.moving_axes:
                self.mechanics.resume_tracking(self.now)

    def end_moves(self) -> None:
        """End motion by hand. The mount is then not parked, not at its home position, and on the way to neither."""
        for axis in tuple(self.moving_axes):
            self.move_axis(axis, 0.0)
        self.at = self.destination = ""

    def abort(self) -> None:
        """End every motion, including slews to the park and home positions."""
        self.end_moves()
        self.mechanics.stop_goto(self.now)

    def pulse(self, direction: int, seconds: float) -> None:
        """Carry out a guide pulse in an ASCOM direction: 0 raises the declination, 1 lowers it, 2 is east, 3 west."""
        axis = 2 if direction < 2 else 1
        sense = self.mechanics.geometry.pole_sign * (1.0 if direction in (0, 3) else -1.0)
        if axis == 2 and self.mechanics.flipped:
            sense = -sense
        self.mechanics.pulse(self.now, axis, sense * self.guides[axis - 1], seconds)
