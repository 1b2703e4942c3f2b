"""The gotos: to a place where the small motions have room, if there is none here; then 5° and back, and one cancelled.

Every goal is one that the gateway's rules allow, which are asked before; by day they keep 40° from the Sun here.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, inf, radians

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, SAME, Finding, Report
from gateway.diagnostics.prove.telescope import Ended, Telescope
from gateway.mount.motion.run_on import Place

#: Seconds that a goto may take, and after which one is cancelled.
LONGEST, CANCELLED = 300.0, 2.0
#: Degrees: how far the goto goes, how near to its goal it must end, what is at rest; so far from it nothing goes on.
FAR, NEAR, RESTS, ELSEWHERE = 5.0, 0.1, 0.1, 1.0
#: Degrees from the horizon, the zenith and the pole at which the small motions have room.
ROOM, POLE = 20.0, 75.0
#: Degrees from the meridian at which a German mount has room, and within which none of its gotos here leads.
MERIDIAN, BESIDE = 15.0, 3.0
#: Hour angles that are tried for a better place, and the part of the rounded latitude that its declination is.
HOUR_ANGLES, PART, ROUND = (30.0, -30.0, 50.0, -50.0, 10.0, -10.0), 0.5, 5.0


def cramped(telescope: Telescope) -> str:
    """Return why the small motions have no room where the mount points; empty if they have."""
    return "" if telescope.latest is None else _cramped_at(telescope, telescope.latest.sky)


def _cramped_at(telescope: Telescope, sky: op.Equatorial) -> str:
    altitude, hour_angle = telescope.controller.astrometry.overhead(sky)
    limits = telescope.controller.policy.limits
    if abs(sky.dec) > POLE:
        return "it points near the pole"
    if altitude is not None and not limits.lowest + ROOM <= altitude <= min(90.0, limits.highest) - ROOM:
        return f"its altitude is {altitude:.0f}°"
    if telescope.driver.german and hour_angle is not None and abs(wrap180(hour_angle)) < MERIDIAN:
        return "it points near the meridian, where it would change the side of its pier"
    return ""


async def to_place(telescope: Telescope, report: Report) -> None:
    """Go to a place with room. Raises Ended."""
    why = cramped(telescope)
    site = telescope.controller.sources.site()
    if site is None:
        raise Ended("the site is not known, so that no place can be chosen")
    sidereal = telescope.controller.astrometry.sidereal_time()
    now = sidereal - telescope.latest.sky.ra if telescope.latest is not None else 0.0
    dec = PART * ROUND * round(site.latitude / ROUND)  # which must not tell the latitude to who reads a bundle
    goals = [op.Equatorial((sidereal - away) % 360.0, dec) for away in HOUR_ANGLES]
    if telescope.driver.german:  # on this side of the pier first
        goals.sort(key=lambda goal: abs(wrap180(goal.ra - sidereal + now)))
    goals = [goal for goal in goals if not _cramped_at(telescope, goal)] or goals
    goal, refused = await _allowed(telescope, goals)
    if goal is None:
        raise Ended(f"{why}, and no better place is allowed: {refused}")
    report.progress(0, 1, "on its way to a better place")
    if refused := await telescope.goto(goal, LONGEST):
        raise Ended(f"{why}, and the goto was refused: {refused}")
    stay_if_elsewhere(await telescope.rest(), goal)
    if why := cramped(telescope):
        raise Ended(f"{why} still")
    report.found(Finding("goto to a better place", SAME))


async def _allowed(telescope: Telescope, goals: Iterable[op.Equatorial]) -> tuple[op.Equatorial | None, str]:
    """Return the first goal that the rules allow, or None and why the last was refused."""
    refusal: Fault | None = None
    for goal in goals:
        refusal = await telescope.controller.preview(goal)
        if refusal is None:
            return goal, ""
    return None, str(refusal or "all are too near to the meridian or the pole")


async def near(telescope: Telescope, here: op.Equatorial) -> tuple[op.Equatorial | None, str]:
    """Return a goal 5° from here that the rules allow, or None and why there is none."""
    aside = FAR / max(0.2, cos(radians(here.dec)))
    ways = ((0.0, FAR), (0.0, -FAR), (aside, 0.0), (-aside, 0.0))
    west = telescope.controller.astrometry.overhead(here)[1] if telescope.driver.german else None

    def stays(goal: op.Equatorial) -> bool:
        """Whether a German mount goes there without changing the side of its pier."""
        before = 90.0 if west is None else wrap180(west)
        after = 90.0 if west is None else wrap180(before + here.ra - goal.ra)
        return abs(goal.dec) < 89.0 and before * after > 0.0 and abs(after) > BESIDE

    goals = (op.Equatorial((here.ra + ra) % 360.0, here.dec + dec) for ra, dec in ways)
    return await _allowed(telescope, filter(stays, goals))


async def run(telescope: Telescope, report: Report) -> None:
    """Go 5° and back, and go again and cancel it. Raises Ended."""
    start = await telescope.rest()
    goal, refused = await near(telescope, start.sky)
    if goal is None:
        report.found(Finding("goto of 5°", NOT_TRIED, refused))
        return
    for number, (what, to) in enumerate((("goto of 5°", goal), ("goto back", start.sky))):
        report.progress(number, 4, what)
        began = telescope.now()
        if refused := await telescope.goto(to, LONGEST):
            report.found(Finding(what, NOT_TRIED, refused))
            return
        said = await telescope.look()
        took, here = telescope.now() - began, await telescope.rest()
        early = telescope.drift(said, here) > RESTS
        report.found(arrived(telescope, what, to, here, f"{took:.0f} s, ", early))
        stay_if_elsewhere(here, to)
    report.progress(2, 4, "goto, cancelled on the way")
    if refused := await telescope.goto(goal, CANCELLED):
        report.found(Finding("cancelled goto", NOT_TRIED, refused))
        return
    here = await telescope.rest()
    left = separation(here.sky.ra, here.sky.dec, goal.ra, goal.dec)
    stopped = left > NEAR
    report.found(
        Finding(
            "cancelled goto",
            SAME if stopped else DIFFERS,
            f"it rests {left:.1f}° before its goal" if stopped else "it went on to its goal",
            means="" if stopped else "A stop may not end a goto: keep a hand at the mount's switch.",
        )
    )
    report.progress(3, 4, "back to where it was")
    if separation(here.sky.ra, here.sky.dec, start.sky.ra, start.sky.dec) > RESTS:
        await telescope.goto(start.sky, inf)
        await telescope.rest()


def stay_if_elsewhere(here: Place, goal: op.Equatorial) -> None:
    """Raise Ended if a goto has ended far from its goal."""
    if (off := separation(here.sky.ra, here.sky.dec, goal.ra, goal.dec)) > ELSEWHERE:
        raise Ended(f"the goto ended {off:.0f}° from its goal: somebody used its keys, or it cannot go there")


def arrived(
    telescope: Telescope, what: str, goal: op.Equatorial, here: Place, took: str = "", early: bool = False
) -> Finding:
    """Return the finding on a goto that has ended here; ``early``: it moved on after it had told its end."""
    off = separation(here.sky.ra, here.sky.dec, goal.ra, goal.dec)
    measured = f"{took}{off * 60.0:.1f}' from its goal"
    if off > NEAR + max(telescope.ticks):
        return Finding(what, DIFFERS, measured, "at its goal", "Gotos of your mount end elsewhere than they should.")
    if early:
        means = "It tells the end of a goto before it rests: the gateway waits until the position shows that."
        return Finding(what, DIFFERS, f"{measured}; it told its end too early", "at rest", means)
    return Finding(what, SAME, measured)
