"""Conversion between the positions of two mount axes and hour angle and declination, for a site and a time.

Three builds: an alt-az fork, a fork on a wedge, a German mount. Angles are degrees, longitude is positive
east, hour angles are positive west. No function raises for finite arguments.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import fold_declination, horizon_to_hour_angle, hour_angle_to_horizon, wrap180

#: Two angles in degrees: two axis positions, or an hour angle and a declination.
Pair = tuple[float, float]


class Build(Enum):
    ALTAZ = "alt-az"
    WEDGE = "wedge"
    GERMAN = "german"


class Observer(NamedTuple):
    """The site in degrees (longitude east positive), and how many seconds the mount's UTC is ahead of true UTC."""

    latitude: float
    longitude: float
    clock_ahead: float = 0.0

    def lst(self, now: float) -> float:
        """Return the local apparent sidereal time in degrees; ``now`` is Unix time by the mount's clock."""
        return sidereal_time(now + self.clock_ahead, self.longitude)


class Geometry(NamedTuple):
    """Converts axis positions to hour angle and declination, and back.

    A fork on a wedge is an alt-az mount whose zenith is the elevated pole. Both axes of a German mount read 90 degrees
    when its counterweight is down and its tube points at that pole. On an alt-az fork they read azimuth and altitude.
    On a polar mount, positive on axis 1 is west in the northern hemisphere and east in the southern one; positive on
    axis 2 is towards the elevated pole. ``flipped`` is the second way to a direction, past the pole or the zenith.
    """

    build: Build
    latitude: float

    @property
    def pole_sign(self) -> int:
        """+1 if the north pole is above the horizon, -1 if the south pole is."""
        return 1 if self.latitude >= 0 else -1

    @property
    def _meridian_reading(self) -> float:
        """The reading of the first axis on the meridian, where the hour angle is 0."""
        return 180.0 if self.build is Build.WEDGE and self.pole_sign > 0 else 0.0

    def ha_dec_of_axes(self, axis1: float, axis2: float) -> Pair:
        """Return the hour angle (-180 to 180) and the declination (-90 to 90) to which these axis positions point."""
        if self.build is Build.ALTAZ:
            return horizon_to_hour_angle(axis1, axis2, self.latitude)
        hour_angle, dec = fold_declination(self.pole_sign * (axis1 - self._meridian_reading), self.pole_sign * axis2)
        return wrap180(hour_angle), dec

    def unfolded_ha_dec(self, axis1: float, axis2: float, flipped: bool) -> Pair:
        """Like ``ha_dec_of_axes``, but do not fold a polar mount's declination beyond ±90; ``flipped``: its side."""
        if self.build is Build.ALTAZ:
            return self.ha_dec_of_axes(axis1, axis2)
        if flipped:
            axis1, axis2 = axis1 + 180.0, 180.0 - axis2
        return wrap180(self.pole_sign * (axis1 - self._meridian_reading)), wrap180(self.pole_sign * axis2)

    def to_axes(self, hour_angle: float, dec: float, flipped: bool) -> Pair:
        """Return the axis positions for a direction, on either side of the pier (``flipped``)."""
        if self.build is Build.ALTAZ:
            first, second = hour_angle_to_horizon(hour_angle, dec, self.latitude)
        else:
            first, second = self.pole_sign * hour_angle + self._meridian_reading, self.pole_sign * dec
        return (first + 180.0, 180.0 - second) if flipped else (first, second)

    def axis_readings(self, ha_dec: Pair, readings: Pair, goal: Pair) -> Pair:
        """Return what the axes will read at ``goal``, on the side of the pier where the counterweight is low.

        ``ha_dec``, the present position, and ``goal`` are hour angle and declination. The present ``readings`` show the
        unknown offset between readings and axis positions.
        """
        ways = [self.to_axes(*ha_dec, flipped) for flipped in (False, True)]
        offsets = [(wrap180(readings[0] - first), wrap180(readings[1] - second)) for first, second in ways]
        offset = min(offsets, key=lambda pair: abs(pair[0]) + abs(pair[1]))
        first, second = self.to_axes(*goal, self.is_flipped(goal[0]))
        return first + offset[0], second + offset[1]

    def is_flipped(self, hour_angle: float) -> bool:
        """Whether the mount is a German one, and ``flipped`` at this hour angle so that its counterweight stays low."""
        return self.build is Build.GERMAN and wrap180(self.pole_sign * hour_angle) < 0.0

    def axis_travel(self, axis: int, start: float, end: float) -> float:
        """Return the degrees by which an axis turns from ``start`` to ``end``: axis 1 by the shorter way, axis 2
        without passing 180. On a German mount neither axis passes -90, where axis 1 has its counterweight high.
        """
        if self.build is Build.GERMAN:
            return wrap180(end - 90.0) - wrap180(start - 90.0)
        return wrap180(end - start) if axis == 1 else wrap180(end) - wrap180(start)
