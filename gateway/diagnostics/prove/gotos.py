"""The goto stages. One goes to a position with room for small motions; one goes 5° and back, and cancels a goto.

The gateway's limits must allow each goto. By day the goals chosen here are at least 40° from the Sun.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, inf, radians

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, SAME, Finding, StageReporter
from gateway.diagnostics.prove.telescope import CheckedMount, StageEnded
from gateway.mount.motion.run_on import TimedPosition

#: Seconds: the timeout of a goto; how long after its start the last goto is cancelled.
GOTO_TIMEOUT, CANCEL_DELAY = 300.0, 2.0
#: Degrees: length of the goto, allowed error, allowed motion at rest, and the error from which on the stage ends.
GOTO_DISTANCE, GOAL_TOLERANCE, REST_TOLERANCE, MAX_GOAL_ERROR = 5.0, 0.1, 0.1, 1.0
#: Degrees, for enough room: least distance from lowest and highest altitude, greatest declination, and the least
#: distance from the Sun beyond the gateway's limit.
ALT_MARGIN, MAX_DECLINATION, SUN_MARGIN = 20.0, 75.0, 7.0
#: A German mount's least distance from the meridian, degrees: for small motions, and for the goal of a goto.
ROOMY_MERIDIAN_DISTANCE, MIN_MERIDIAN_DISTANCE = 15.0, 3.0
#: Where to look for a better position: hour angles, degrees; the declination is the latitude times this factor.
HOUR_ANGLES, LATITUDE_FACTOR = (30.0, -30.0, 50.0, -50.0, 10.0, -10.0), 0.5
#: How many gotos the stage has: there, back, a goto that is cancelled, and back again.
GOTO_COUNT = 4


def why_no_room(telescope: CheckedMount, position: op.Equatorial | None = None) -> str:
    """Return why a position (None: the present one) has no room for small motions; empty if it has or is unknown."""
    if position is None and telescope.position is not None:
        position = telescope.position.position
    if position is None:
        return ""
    altitude, hour_angle = telescope.controller.astrometry.alt_and_ha(position)
    limits, suns = telescope.controller.policy.limits, telescope.controller.suns
    if abs(position.dec) > MAX_DECLINATION:
        return "it points near the pole"
    if (sun := min(suns.distances(position), default=inf)) < suns.min_dist + SUN_MARGIN:
        return f"it points {sun:.0f}° from the Sun"
    if altitude is not None and not limits.lowest + ALT_MARGIN <= altitude <= min(90.0, limits.highest) - ALT_MARGIN:
        return f"its altitude is {altitude:.0f}°"
    if telescope.driver.german and hour_angle is not None and abs(wrap180(hour_angle)) < ROOMY_MERIDIAN_DISTANCE:
        return "it points near the meridian, where it would change the side of its pier"
    return ""


async def go_to_roomy_position(telescope: CheckedMount, report: StageReporter) -> None:
    """Go to a position with room for small motions. Raises StageEnded."""
    why = why_no_room(telescope)
    site = telescope.controller.sources.site()
    if site is None:
        raise StageEnded("the site is not known, so that no place can be chosen")
    sidereal = telescope.controller.astrometry.sidereal_time()
    hour_angle = sidereal - telescope.position.position.ra if telescope.position is not None else 0.0
    goals = [op.Equatorial((sidereal - away) % 360.0, LATITUDE_FACTOR * site.latitude) for away in HOUR_ANGLES]
    if telescope.driver.german:  # on this side of the pier first
        goals.sort(key=lambda goal: abs(wrap180(goal.ra - sidereal + hour_angle)))
    goals = [goal for goal in goals if not why_no_room(telescope, goal)] or goals
    goal, refused = await _pick_goal(telescope, goals)
    if goal is None:
        raise StageEnded(f"{why}, and no better place is allowed: {refused}")
    report.progress(0, 1, "on its way to a better place")
    if refused := await telescope.goto(goal, GOTO_TIMEOUT):
        raise StageEnded(f"{why}, and the goto was refused: {refused}")
    check_arrival(await telescope.settle(), goal)
    if why := why_no_room(telescope):
        raise StageEnded(f"{why} still")
    report.add(Finding("goto to a better place", SAME))


async def _pick_goal(telescope: CheckedMount, goals: Iterable[op.Equatorial]) -> tuple[op.Equatorial | None, str]:
    """Return the first goal that the gateway allows and an empty text, or None and why the last goal was refused."""
    refusal: Fault | None = None
    for goal in goals:
        refusal = await telescope.controller.preview_goto(goal)
        if refusal is None:
            return goal, ""
    return None, str(refusal or "all are too near to the meridian or the pole")


async def nearby_goal(telescope: CheckedMount, position: op.Equatorial) -> tuple[op.Equatorial | None, str]:
    """Return an allowed goal 5° away and an empty text, or None and the reason."""
    aside = GOTO_DISTANCE / max(0.2, cos(radians(position.dec)))
    ways = ((0.0, GOTO_DISTANCE), (0.0, -GOTO_DISTANCE), (aside, 0.0), (-aside, 0.0))
    hour_angle = telescope.controller.astrometry.alt_and_ha(position)[1] if telescope.driver.german else None

    def keeps_pier_side(goal: op.Equatorial) -> bool:
        """Whether a goal is over 1° from the poles and, on a German mount, reached without a change of pier side."""
        before = 90.0 if hour_angle is None else wrap180(hour_angle)
        after = 90.0 if hour_angle is None else wrap180(before + position.ra - goal.ra)
        return abs(goal.dec) < 89.0 and before * after > 0.0 and abs(after) > MIN_MERIDIAN_DISTANCE

    goals = (op.Equatorial((position.ra + ra) % 360.0, position.dec + dec) for ra, dec in ways)
    return await _pick_goal(telescope, filter(keeps_pier_side, goals))


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Go 5° and back, begin the first goto again and cancel it on its way, and go back. Raises StageEnded."""
    places = await _goto_and_back(telescope, report)
    if places is None:
        return
    start, goal = places
    report.progress(2, GOTO_COUNT, "goto, cancelled on the way")
    if refused := await telescope.goto(goal, CANCEL_DELAY):
        report.add(Finding("cancelled goto", NOT_TRIED, refused))
        return
    position = (await telescope.settle()).position
    if (left := sky_distance(position, goal)) > GOAL_TOLERANCE:
        report.add(Finding("cancelled goto", SAME, f"it rests {left:.1f}° before its goal"))
    else:
        means = "A stop may not end a goto: keep a hand at the mount's switch."
        report.add(Finding("cancelled goto", DIFFERS, "it went on to its goal", means=means))
    report.progress(3, GOTO_COUNT, "back to where it was")
    if sky_distance(position, start) > REST_TOLERANCE:
        await telescope.goto(start, inf)
        await telescope.settle()


async def _goto_and_back(telescope: CheckedMount, report: StageReporter) -> tuple[op.Equatorial, op.Equatorial] | None:
    """Go 5° and back, and return the start and the goal; None if no goto is allowed. Raises StageEnded."""
    start = (await telescope.settle()).position
    goal, refused = await nearby_goal(telescope, start)
    if goal is None:
        report.add(Finding("goto of 5°", NOT_TRIED, refused))
        return None
    for number, (what, to) in enumerate((("goto of 5°", goal), ("goto back", start))):
        report.progress(number, GOTO_COUNT, what)
        began = telescope.now()
        if refused := await telescope.goto(to, GOTO_TIMEOUT):
            report.add(Finding(what, NOT_TRIED, refused))
            return None
        reported = await telescope.read_position()
        took, arrived = telescope.now() - began, await telescope.settle()
        off = sky_distance(arrived.position, to)
        measured = f"{took:.0f} s, {off * 60.0:.1f}' from its goal"
        if off > GOAL_TOLERANCE + max(telescope.angle_steps):
            report.add(
                Finding(what, DIFFERS, measured, "at its goal", "Gotos of your mount end elsewhere than they should.")
            )
        elif telescope.drift(reported, arrived) > REST_TOLERANCE:
            early = "It tells the end of a goto before it rests: the gateway waits until the position shows that."
            report.add(Finding(what, DIFFERS, f"{measured}; it reported its end too early", "at rest", early))
        else:
            report.add(Finding(what, SAME, measured))
        check_arrival(arrived, to)
    return start, goal


def check_arrival(end_position: TimedPosition, goal: op.Equatorial) -> None:
    """Raise StageEnded if a goto has ended far from its goal."""
    if (off := sky_distance(end_position.position, goal)) > MAX_GOAL_ERROR:
        raise StageEnded(f"the goto ended {off:.0f}° from its goal: somebody used its keys, or it cannot go there")


def sky_distance(position: op.Equatorial, other: op.Equatorial) -> float:
    """Return the angle between two positions, degrees."""
    return separation(position.ra, position.dec, other.ra, other.dec)
