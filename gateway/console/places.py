"""Positions that the user names or taps: where they are, and whether the mount may go there.

Whether it may is what a goto would be told now, by the same rules, without asking the mount. Catalogues are searched on
a thread.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

from gateway.app.control import objects
from gateway.app.control.refusals import explain
from gateway.app.control.requests import of_date
from gateway.astro.spherical import wrap180
from gateway.console.shown.view import COARSE, coordinates, on_page
from gateway.core.requests import Named, Target
from gateway.mount.controller import MountController

#: How many names are suggested while the user types; the length of a night and of its steps, seconds.
SUGGESTED, NIGHT, STEP = 12, 57600.0, 7200.0


async def look_up(controller: MountController, where: Target) -> dict[str, Any]:
    """Return the coordinates of a target, and ``may`` the mount go, and if not, ``why``.

    Of an object also its name, kind and magnitude. Raises UserError, Fault.
    """
    about: dict[str, Any] = {}
    if isinstance(where, Named):
        entry = await asyncio.to_thread(objects.describe, where.name)
        about = {key: value for key, value in entry._asdict().items() if key != "where"}
        where = entry.where
    goal = await of_date(controller, where)
    fault = await controller.preview(goal)
    why = "" if fault is None else on_page(explain(fault, controller.policy.limits))
    return {**about, **coordinates(controller, goal), "may": fault is None, "why": why}


async def suggestions(text: str) -> list[str]:
    """Return names of objects that begin with the text typed so far."""
    return await asyncio.to_thread(objects.completions, text, SUGGESTED) if text.strip() else []


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
