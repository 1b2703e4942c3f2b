"""Positions that the user names or taps: where they are, when they rise and set, whether the mount may go there.

Whether it may is what a goto would be told now, by the same rules, without asking the mount. Catalogues are searched on
a thread.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from typing import Any

from gateway.app.control import objects
from gateway.app.control.refusals import explain
from gateway.app.control.requests import of_date
from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.console.shown.view import COARSE, coordinates
from gateway.core import operations as op
from gateway.core.requests import Named, Target
from gateway.mount.controller import MountController

#: How many names are suggested while the user types; the length of a night and of its steps, seconds.
SUGGESTED, NIGHT, STEP = 12, 57600.0, 7200.0


async def look_up(controller: MountController, where: Target) -> dict[str, Any]:
    """Return the coordinates of a target, when it rises and sets (Unix seconds or None), ``may`` the mount go, ``why``.

    Of an object also its name, kind and magnitude. Raises UserError, Fault.
    """
    about: dict[str, Any] = {}
    if isinstance(where, Named):
        entry = await asyncio.to_thread(objects.describe, where.name)
        about = {key: value for key, value in entry._asdict().items() if key != "where"}
        where = entry.where
    goal = await of_date(controller, where)
    fault = await controller.preview(goal)
    why = "" if fault is None else explain(fault, controller.policy.limits)
    rises, sets = _rises_and_sets(controller, goal)
    return {
        **about, **coordinates(controller, goal), "rises": rises, "sets": sets, "may": fault is None, "why": why
    }  # fmt: skip


async def suggestions(text: str) -> list[dict[str, str]]:
    """Return objects whose names begin with the text typed so far."""
    names = await asyncio.to_thread(objects.completions, text, SUGGESTED) if text.strip() else []
    return [{"name": name} for name in names]


def night(controller: MountController) -> dict[str, Any]:
    """Return the positions of date of Sun and Moon from eight hours before midnight by the Sun to eight after it.

    It is the midnight that is nearest to four hours from now: until the morning this night, then the next.
    ``begins`` is by the gateway's clock, None while the site is unknown.
    """
    derived = controller.astrometry
    site, sky, unix = derived.site_clock.site(), derived.sky, derived.site_clock.unix()
    if site is None:
        return {"begins": None}
    until = (180.0 - wrap180(derived.sidereal_time() - sky.sun(unix)[0])) / 15.0 * 3600.0
    begins = (until - 86400.0 if until > 57600.0 else until) - NIGHT / 2
    times = [unix + begins + part * STEP for part in range(round(NIGHT / STEP) + 1)]
    moon = (sky.moon(time, site.latitude, site.longitude) for time in times)
    return {"begins": round(controller.wire_log.clock() + begins), "step": STEP,
            "sun": [_short(sky.sun(time)) for time in times], "moon": [_short(place) for place in moon]}  # fmt: skip


def _short(place: Sequence[float]) -> tuple[float, float]:
    return round(place[0], COARSE), round(place[1], COARSE)


def _rises_and_sets(controller: MountController, goal: op.Equatorial) -> tuple[float | None, float | None]:
    """Return when it next crosses the lowest allowed altitude, upwards and downwards; None if it does not."""
    derived = controller.astrometry
    site = derived.site_clock.site()
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
    half, now = math.degrees(math.acos(cosine)), controller.wire_log.clock()
    angle = wrap180(derived.sidereal_time() - goal.ra)
    rises, sets = (round(now + ((turn - angle) % 360.0) / SIDEREAL_RATE) for turn in (-half, half))
    return rises, sets
