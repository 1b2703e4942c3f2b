"""The stage of small motions: moves the mount in all directions at all rates; measures rate, direction and run-on.

The two directions of an axis are judged together: half of the difference of their velocities over the ground is the
rate, whatever tracking adds to both. A motion of a few seconds is hardly longer than the run-up of the motors, so it
shows a rate only roughly. Run-on is motion after a stop. Angles are degrees, rates degrees a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, inf, radians
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.spherical import SIDEREAL_RATE
from gateway.core import operations as op
from gateway.core.operations import Direction
from gateway.diagnostics.prove.findings import (
    DIFFERS,
    NOT_MEASURABLE,
    NOT_TRIED,
    SAME,
    Finding,
    MeasuredRate,
    StageReporter,
)
from gateway.diagnostics.prove.telescope import FAST_RATE, MAX_DURATION, MAX_TRAVEL, CheckedMount, Motion
from gateway.mount.safety.allow import RUN_ON, RUN_UP_SECONDS

#: The rate keys of the hand control, fastest first. If several have the same speed, only the lowest is tried.
RATE_KEYS: Sequence[int] = range(9, 0, -1)
#: Tolerances of a rate, as fractions of it: sampled, that is, measured between two readings on the way; of a stepped
#: motion, which is a series of small gotos; of a short motion, by its whole distance.
SAMPLED_TOLERANCE, STEPPED_TOLERANCE, SHORT_TOLERANCE = 0.08, 0.25, 0.35
#: Seconds: the least time between two readings that show a rate, and how long tracking is observed.
MIN_RATE_SPAN, TRACKING_TIME = 1.5, 10.0
#: A distance is only measured if it is longer than so many steps of the mount's reading.
MIN_READING_STEPS = 10.0
#: Degrees by which the run-on may exceed the assumed one.
RUN_ON_TOLERANCE = 0.3
#: The tolerance of tracking, degrees a second.
TRACKING_TOLERANCE = 3.0 / 3600.0
#: The greatest believable ratio of two rates, measured and assumed; the range of the run-on setting, seconds.
MAX_RATE_RATIO, RUN_ON_RANGE = 4.0, (0.5, 10.0)
RATE_EFFECT = "Arrows of programs move your mount at another speed than they show; rates in gateway.toml corrects that."
DIRECTION_PAIRS = ((Direction.WEST, Direction.EAST), (Direction.NORTH, Direction.SOUTH))


class Velocity(NamedTuple):
    """The measured rate of an axis and its error (degrees a second), and the distance and run-on (degrees)."""

    rate: float
    error: float
    distance: float
    run_on: float
    is_short: bool  # too short a motion for an exact rate


def velocity(telescope: CheckedMount, motion: Motion, axis: int, speed: float) -> Velocity | None:
    """Return how an axis moved when ordered to turn at ``speed``; None if the start or end position is unknown."""
    if motion.start_position is None or motion.end_position is None:
        return None
    number, tick, lasted = axis - 1, telescope.angle_steps[axis - 1], motion.ended_at - motion.began_at
    distance = telescope.axis_turns(motion.start_position, motion.end_position)[number]
    even = [place for place in motion.positions if place.at > motion.began_at + RUN_UP_SECONDS]
    span = even[-1].at - even[0].at if even else 0.0
    last = motion.positions[-1] if motion.positions else motion.start_position
    end_turn, end_time = abs(telescope.axis_turns(last, motion.end_position)[number]), motion.ended_at - last.at
    long = end_turn > (end_time + 2.0 * RUN_ON) * speed + RUN_ON_TOLERANCE  # the whole distance does not show the rate
    if (short := span < MIN_RATE_SPAN) and not long:
        rate = distance / lasted
        error = SHORT_TOLERANCE * abs(rate) + 2.0 * tick / lasted
    elif len(two := even[:1] + even[-1:] if not short else list(motion.positions[-2:])) == 2:
        span = two[1].at - two[0].at
        rate = telescope.axis_turns(*two)[number] / span
        part = SHORT_TOLERANCE if short else STEPPED_TOLERANCE if telescope.driver.moves_by_gotos else SAMPLED_TOLERANCE
        error = part * abs(rate) + 2.0 * tick / span
    else:
        rate, error = copysign(speed, distance), inf
    return Velocity(rate, error, abs(distance), end_turn - abs(rate) * end_time, short)


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Carry out all motions and report the findings. Raises StageEnded."""
    telescope.axis_angles(await telescope.settle())  # before anything moves: without a site nothing could be measured
    speeds = {telescope.speed_of_key(key): key for key in RATE_KEYS}
    tried = [(speed, key, pair) for speed, key in sorted(speeds.items()) for pair in DIRECTION_PAIRS]
    if getattr(telescope.driver, "tracking", None) is None:  # its driver learns the mode from the first motion
        await telescope.move_by_key(Direction.WEST, 1, 1.0)
    before = {item.what: item for item in report.old_findings if item.rate is not None}
    findings = list[Finding]()
    for number, (speed, key, pair) in enumerate(tried):
        what = f"rate {key} {pair[0].label}/{pair[1].label}"
        report.progress(number, len(tried), what)
        finding = before.get(what)
        if finding is None or finding.rate is None or finding.rate.assumed != speed:
            finding = await _measure_rate(telescope, what, speed, key, pair)
        report.add(finding)
        findings.append(finding)
    moved = [(item, item.rate) for item in findings if item.rate is not None and item.rate.run_ons]
    for axis, pair in enumerate(DIRECTION_PAIRS, 1):
        report.add(direction_finding(pair, [rate.real < 0.0 for _, rate in moved if rate.axis == axis]))
    run_ons = [
        (abs(rate.real), distance) for _, rate in moved if abs(rate.real) >= FAST_RATE for distance in rate.run_ons
    ]
    report.add(run_on_finding(run_ons, telescope.controller.line.times.typical_rtt, telescope.controller.policy.run_on))
    report.add(await check_tracking(telescope))
    even = [(rate.assumed, abs(rate.real)) for item, rate in moved if item.verdict == DIFFERS and rate.evenly]
    if real := {assumed: rate for assumed, rate in even if 1.0 / MAX_RATE_RATIO < rate / assumed < MAX_RATE_RATIO}:
        speeds_of = [telescope.speed_of_key(key) for key in range(1, 10)]
        rates = [round(real.get(speed, speed), 5) for speed in speeds_of]
        report.add(Finding("rates of all keys", DIFFERS, "measured", "its maker's", RATE_EFFECT, {"rates": rates}))


async def _measure_rate(
    telescope: CheckedMount, name: str, speed: float, key: int, directions: tuple[Direction, ...]
) -> Finding:
    """Turn an axis both ways at a rate, and return the finding on that rate. Raises StageEnded."""
    axis = directions[0].axis
    motions = [
        await telescope.move_by_key(direction, key, min(MAX_DURATION, MAX_TRAVEL / speed)) for direction in directions
    ]
    onwards, back = (velocity(telescope, motion, axis, speed) for motion in motions)
    if onwards is None or back is None:
        return Finding(name, NOT_TRIED, motions[0].refusal or motions[1].refusal)
    rate, error = (onwards.rate - back.rate) / 2.0, (onwards.error + back.error) / 2.0
    distance, least = max(onwards.distance, back.distance), MIN_READING_STEPS * telescope.angle_steps[axis - 1]
    run_ons = (onwards.run_on, back.run_on) if distance > least else ()
    finding = rate_finding(name, abs(rate), error, speed, onwards, distance, least)
    return replace(finding, rate=MeasuredRate(axis, speed, rate, run_ons, not onwards.is_short))


def rate_finding(
    title: str, rate: float, error: float, nominal: float, measured_velocity: Velocity, distance: float, min_arc: float
) -> Finding:
    """Return the finding on a rate. A measured ``distance`` of at most ``min_arc`` degrees does not show any rate."""
    measured, assumed = rate_text(rate), rate_text(nominal)
    if distance <= min_arc:
        if nominal * MAX_DURATION > 2.0 * min_arc:
            return Finding(title, DIFFERS, "it does not move", assumed, "This arrow key does nothing on your mount.")
        return Finding(title, NOT_MEASURABLE, "too few steps of its reading", assumed)
    if error == inf:
        return Finding(title, NOT_MEASURABLE, "it runs on for too long", assumed)
    off = abs(rate - nominal)
    if off <= max(SAMPLED_TOLERANCE * nominal, 0.0 if measured_velocity.is_short else error):
        return Finding(title, SAME, measured, assumed)
    if measured_velocity.is_short and (off <= error or rate < nominal):
        return Finding(title, NOT_MEASURABLE, f"{measured} on average, still speeding up", assumed)
    return Finding(title, DIFFERS, measured, assumed, RATE_EFFECT)


def rate_text(rate: float) -> str:
    return f"{abs(rate):.2f}°/s" if abs(rate) >= 0.1 else f'{abs(rate) * 3600.0:.1f}"/s'


def direction_finding(directions: tuple[Direction, Direction], reversals: list[bool]) -> Finding:
    """Return the finding on the direction of an axis. ``reversals``: whether it turned the wrong way at each rate."""
    what = f"direction of {directions[0].label} and {directions[1].label}"
    if not reversals:
        return Finding(what, NOT_TRIED)
    if not any(reversals):
        return Finding(what, SAME)
    means = "Arrows go the other way. A setting of the hand control may reverse them: look for 'direction' there."
    return Finding(what, DIFFERS, "reversed" if all(reversals) else "reversed at some rates", "", means)


def run_on_finding(run_ons: list[tuple[float, float]], exchange_time: float, run_on_time: float) -> Finding:
    """Return the finding on the run-on, from pairs of rate and run-on; ``run_on_time`` is the assumed time, seconds."""
    what = "run-on after a stop"
    if not run_ons:
        return Finding(what, NOT_TRIED)
    rate, most = max(run_ons, key=lambda pair: (max(0.0, pair[1] - pair[0] * run_on_time), pair[0]))
    allowed = rate * (run_on_time + 2.0 * exchange_time)
    measured, assumed = f"{max(0.0, most):.1f}° from {rate_text(rate)}", f"{rate * run_on_time:.1f}°"
    if most <= 1.5 * allowed + RUN_ON_TOLERANCE:
        return Finding(what, SAME, measured, assumed)
    means = "Limits must stop the mount that much earlier: set run-on in gateway.toml."
    seconds = round(most / rate + 0.05, 1)
    keys: dict[str, object] = {"run-on": seconds} if RUN_ON_RANGE[0] <= seconds <= RUN_ON_RANGE[1] else {}
    return Finding(what, DIFFERS, measured, assumed, means, keys)


async def check_tracking(telescope: CheckedMount) -> Finding:
    """Check that the mount tracks if it reports tracking, and rests if it does not. Raises StageEnded."""
    tracks = telescope.status.tracking is not op.Tracking.OFF
    before = await telescope.settle()
    sky, least = abs(SIDEREAL_RATE) * cos(radians(before.position.dec)), 2.0 * max(telescope.angle_steps)
    seconds = min(6.0 * TRACKING_TIME, max(TRACKING_TIME, 2.0 * least / max(sky, TRACKING_TOLERANCE)))
    await telescope.wait_until(lambda: False, seconds)
    after = await telescope.read_position()
    off = telescope.distance_moved(before, after, tracks) - least
    what, rate = f"tracking is {'on' if tracks else 'off'} afterwards", max(0.0, off) / (after.at - before.at)
    if rate <= TRACKING_TOLERANCE:
        shows = sky * seconds - least > TRACKING_TOLERANCE * seconds
        return Finding(what, SAME) if shows else Finding(what, NOT_MEASURABLE, "too few steps of its reading")
    explanation = "It reports tracking, but does not track." if tracks else "It reports rest, but follows the sky."
    return Finding(what, DIFFERS, f"it drifts {rate_text(rate)}", "", explanation)
