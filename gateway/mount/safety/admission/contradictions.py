"""Where sources of site or time contradict each other, what one of them forbids is not begun.

What is under way already is ended by the best source alone: whoever is wrong must not stop a mount that is right.
"""

from __future__ import annotations

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core.errors import Fault, NearSun
from gateway.core.operations import Equatorial
from gateway.mount.safety.limits import Limits
from gateway.mount.safety.rules.sun import SUN_IS_UP
from gateway.mount.site.sources import BestSources

#: Without the date nobody knows where the Sun is.
UNKNOWN_TIME = (
    "The time is unknown: this computer's clock is lost, and neither the mount nor a program tells it. "
    "Set the time, or sun = 0 at night."
)


def check_contradictions(sources: BestSources, sky: Sky, limits: Limits, goal: Equatorial) -> None:
    """A goto to ``goal`` by every source that contradicts the best one.

    Raises BelowHorizon, TooHigh or NearSun, with who says what; NearSun also where nobody knows the time.
    """
    if limits.sun > 0.0 and sources.time_unknown:
        raise NearSun(UNKNOWN_TIME)
    for place, unix, words in sources.contradictions():
        if place is None:
            continue
        altitude = sky.horizon(goal.ra, goal.dec, place.latitude, place.longitude, unix)[1]
        sun = sky.sun(unix)
        risen = sky.horizon(*sun, place.latitude, place.longitude, unix)[1] >= SUN_IS_UP
        try:
            limits.check_altitude(altitude)
            if risen and separation(goal.ra, goal.dec, *sun) < limits.sun:
                raise NearSun
        except Fault as fault:
            raise type(fault)(f"{fault} {words[0].upper()}{words[1:]}.") from None
