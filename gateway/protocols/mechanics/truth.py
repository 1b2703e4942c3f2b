"""The physical state of a simulated mount, as an independent measurement for tests of a gateway.

It is calculated from the positions of the motor axes, and the site and clock with which the simulator was made. Clients
cannot change these: a site, date or time that a client sets, or a sync, changes only what the mount reports. So tests
read this state instead of replies of the gateway or the mount.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from math import cos, radians, sin

from msgspec import Struct
from msgspec.structs import asdict

from gateway.astro.axes import Build, Geometry
from gateway.astro.spherical import UNIX_AT_J2000, from_vector, hour_angle_to_horizon, separation, wrap180
from gateway.protocols.mechanics.simulated import Simulated

#: Seconds of the simulator's time between two samples.
SAMPLE_PERIOD = 0.1
#: Decimals in a file: of the time, and of all other fields (0.004 arcseconds for angles).
_DIGITS = {"t": 3}
_OTHER_DIGITS = 6


class Truth(Struct, frozen=True):
    """The true state of a simulated mount at one moment.

    Axis positions are azimuth and altitude on an alt-az fork; on a polar mount they are those of the hour angle and
    declination axes as ``astro.axes.Geometry`` counts them. Angles are degrees, without refraction.
    """

    t: float  # Unix seconds by the simulator's clock
    axis1: float  # position of the first motor axis, in [0, 360)
    axis2: float  # position of the second motor axis, in [-180, 180)
    altitude: float  # of the tube, above the true horizon
    azimuth: float  # of the tube, from north through east
    hour_angle: float  # of the tube, in [-180, 180), positive west of the meridian
    #: Degrees by which the tube of a German mount is past the meridian, towards the pier; negative before it. This is
    #: the angle of the counterweight shaft above horizontal: -90 if it points straight down. None on a fork.
    past_meridian: float | None
    sun_distance: float  # of the centre of the field of view from that of the Sun; accurate to 0.02 degrees
    rate1: float  # present speed of the first axis, degrees a second, positive if ``axis1`` increases
    rate2: float  # present speed of the second axis, degrees a second, positive if ``axis2`` increases
    moving: bool  # a motor turns for anything but tracking: a goto, hand motion, guiding, or running on
    tracking: bool  # the motors follow the sky, by the mount's site and clock

    def json_line(self) -> str:
        """Return the state as a line of JSON: an object with the names of the fields, and a line end."""
        shown = {
            name: round(value, _DIGITS.get(name, _OTHER_DIGITS)) if type(value) is float else value
            for name, value in asdict(self).items()
        }
        return json.dumps(shown) + "\n"


def truth_of(simulator: Simulated) -> Truth:
    """Return the present Truth of a simulated mount of any protocol; reading it changes nothing."""
    simulator.advance_to_now()
    now, mechanics = simulator.now, simulator.mechanics
    first, second = mechanics.axes(now)
    rates, moving = mechanics.speeds(now), mechanics.is_moving(now)
    hour_angle, dec = Geometry(mechanics.build, mechanics.true_sky.latitude).ha_dec_of_axes(first, second)
    azimuth, altitude = hour_angle_to_horizon(hour_angle, dec, mechanics.true_sky.latitude)
    sun_ra, sun_dec = sun_position(now)
    return Truth(
        t=now, axis1=first, axis2=second, altitude=altitude, azimuth=azimuth, hour_angle=hour_angle,
        past_meridian=abs(wrap180(first - 90.0)) - 90.0 if mechanics.build is Build.GERMAN else None,
        sun_distance=separation(hour_angle, dec, mechanics.true_sky.lst(now) - sun_ra, sun_dec),
        rate1=rates[0], rate2=rates[1], moving=moving,
        tracking=mechanics.tracking(now) and not mechanics.is_ramping(now),
    )  # fmt: skip


def sun_position(unix: float) -> tuple[float, float]:
    """Return the Sun's right ascension and declination of date, degrees, to 0.01 (Astronomical Almanac, section C).

    This does not use the gateway's ephemeris, so that tests can find mistakes in that ephemeris.
    """
    days = (unix - UNIX_AT_J2000) / 86400.0
    anomaly = radians(357.528 + 0.9856003 * days)
    longitude = radians(280.460 + 0.9856474 * days + 1.915 * sin(anomaly) + 0.020 * sin(2.0 * anomaly))
    tilt = radians(23.439 - 0.0000004 * days)
    return from_vector((cos(longitude), cos(tilt) * sin(longitude), sin(tilt) * sin(longitude)))


async def sample(simulator: Simulated, record: Callable[[Truth], object], period: float = SAMPLE_PERIOD) -> None:
    """Call ``record`` with the Truth every ``period`` seconds of simulator time, until ``record`` raises."""
    due: float = simulator.clock()
    while True:
        truth = truth_of(simulator)
        record(truth)
        # samples that were missed while the computer slept are skipped
        due = due + period if due + period > truth.t else truth.t + period
        await asyncio.sleep(max(0.0, due - truth.t))
