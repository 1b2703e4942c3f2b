"""What is known of a place on the sky before anybody goes there: how high it stands, when it sets, may the mount go.

It is the owner's limits put as a question; the mount itself is not asked. A goto is judged again, by all the rules,
when it is really asked for.
"""

from __future__ import annotations

import math
from typing import Any

from gateway.app.control.refusals import no
from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.console.view import place
from gateway.core import operations as op
from gateway.core.errors import Asleep, Fault, Held, NearSun, NoAnswer, NotAligned
from gateway.mount.controller import MountController


def verdict(controller: MountController, goal: op.Equatorial) -> dict[str, Any]:
    """Of a place of date: its places, rising and setting (Unix seconds; None: it does not), ``may`` and ``why``."""
    told = place(controller, goal)
    fault = _forbidden(controller, goal, told["alt"])
    why = "" if fault is None else no(fault, controller.policy.limits)
    rises, sets = _rises_and_sets(controller, goal)
    return {**told, "rises": rises, "sets": sets, "may": fault is None, "why": why}


def _forbidden(controller: MountController, goal: op.Equatorial, altitude: float | None) -> Fault | None:
    if controller.line.state in ("down", "opening"):
        return NoAnswer()
    if controller.hold.on:
        return Held()
    if controller.driver.asleep:
        return Asleep()
    status: op.Status | None = controller.cache.value(op.GetStatus)
    if status is not None and not status.aligned and controller.policy.unaligned == "refuse":
        return NotAligned()
    if altitude is not None:
        try:
            controller.policy.limits.check_altitude(altitude)
        except Fault as fault:
            return fault
    if any(distance < controller.suns.limit for distance in controller.suns.distances(goal)):
        return NearSun()
    return None


def _rises_and_sets(controller: MountController, goal: op.Equatorial) -> tuple[float | None, float | None]:
    """When it next comes to the lowest altitude that is allowed, on its way up and on its way down."""
    derived = controller.astrometry
    site = derived.observatory.site()
    if site is None:
        return None, None
    low = math.radians(max(controller.policy.limits.lowest, 0.0))
    latitude, dec = math.radians(site.latitude), math.radians(goal.dec)
    below = math.cos(latitude) * math.cos(dec)
    if abs(below) < 1e-9:
        return None, None
    cosine = (math.sin(low) - math.sin(latitude) * math.sin(dec)) / below
    if not -1.0 < cosine < 1.0:
        return None, None
    half, now = math.degrees(math.acos(cosine)), controller.transcript.clock()
    angle = wrap180(derived.sidereal_time() - goal.ra)
    rises, sets = (round(now + ((turn - angle) % 360.0) / SIDEREAL_RATE) for turn in (-half, half))
    return rises, sets
