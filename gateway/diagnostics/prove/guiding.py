"""The guiding stage: sends series of short pulses, as a guiding program does, and measures the guide rates."""

from __future__ import annotations

import asyncio

from gateway.astro.spherical import SIDEREAL_RATE
from gateway.core import operations as op
from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME, Finding, StageReporter
from gateway.diagnostics.prove.small_motions import DIRECTION_PAIRS, MIN_READING_STEPS, rate_text
from gateway.diagnostics.prove.telescope import MAX_CROSS_MOTION, CheckedMount, StageEnded

#: Pulses in each direction, the length of a pulse, and the interval between two, seconds.
PULSE_COUNT, PULSE_SECONDS, PULSE_PERIOD = 20, 0.2, 0.5
#: The most exchanges that one pulse takes (on an alt-az mount); no pulse is sent if an exchange takes longer (seconds).
EXCHANGES_PER_PULSE, QUICK_EXCHANGE_TIME = 16, 0.15
#: The greatest tolerated average delay of this computer, seconds: such a delay makes a pulse longer or shorter.
MAX_DELAY = PULSE_SECONDS / 8.0
#: The tolerance of the guide rate, as a fraction of it.
RATE_TOLERANCE = 0.25


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Report the guide rate of each axis, or one finding with the reason why none is measured. Raises StageEnded."""
    abilities = telescope.driver.abilities(telescope.status.equatorial)
    if not {"Pulse", "PulseAxis"} & abilities.can or telescope.status.tracking is op.Tracking.OFF:
        report.add(Finding("guiding", NOT_TRIED, "it is not guided while it does not track, or not at all"))
        return
    telescope.axis_angles(await telescope.settle())  # before anything moves: without a site nothing could be measured
    if (exchange := telescope.controller.line.times.typical_rtt) > QUICK_EXCHANGE_TIME:
        reason = f"its line takes {exchange:.1f} s for an exchange, longer than a pulse"
        report.add(Finding("guiding", NOT_MEASURABLE, reason))
        return
    telescope.is_moving = True
    for axis, pair in enumerate(DIRECTION_PAIRS, 1):
        turns, mean_delay = list[float](), 0.0
        for direction in pair:
            before = await telescope.settle()
            for number in range(PULSE_COUNT):
                done = 2 * PULSE_COUNT * (axis - 1) + PULSE_COUNT * len(turns) + number
                report.progress(done, 4 * PULSE_COUNT, f"pulses {direction.label}")
                due = telescope.now() + max(PULSE_PERIOD, EXCHANGES_PER_PULSE * exchange)
                await telescope.pulse(direction, int(PULSE_SECONDS * 1000.0))
                await asyncio.sleep(due - telescope.now())
                mean_delay += (telescope.now() - due) / PULSE_COUNT / len(pair)
                telescope.raise_if_stage_ends()
            after = await telescope.settle()
            if telescope.distance_moved(before, after, tracks=True) > MAX_CROSS_MOTION:
                raise StageEnded("it turned much farther than by pulses: somebody pressed its keys")
            turns.append(telescope.axis_turns(before, after)[axis - 1])
        rate = (turns[0] - turns[1]) / 2.0 / (PULSE_COUNT * PULSE_SECONDS)
        if axis == 2 and telescope.driver.german:  # a pulse means a sense of the motor, on both sides of the pier
            rate = abs(rate)
        assumed, tick = abilities.guides[axis - 1] * SIDEREAL_RATE, telescope.angle_steps[axis - 1]
        finding = guide_rate_finding(f"guiding {pair[0].label}/{pair[1].label}", rate, assumed, exchange, tick)
        if finding.verdict == DIFFERS and (
            mean_delay > MAX_DELAY or telescope.controller.line.times.typical_rtt > QUICK_EXCHANGE_TIME
        ):
            reason = "this computer or its line was too busy for such short pulses"
            finding = Finding(finding.what, NOT_MEASURABLE, reason, finding.assumed)
        report.add(finding)


def guide_rate_finding(title: str, rate: float, assumed: float, exchange_time: float, reading_step: float) -> Finding:
    """Return the finding on the guide rate of an axis, degrees a second. The measurement is uncertain by two steps of
    the reading (``reading_step``, degrees) for all pulses together, and by half an exchange (seconds) for each pulse.
    """
    rates = rate_text(rate), rate_text(assumed)
    if max(abs(rate), assumed) * PULSE_COUNT * PULSE_SECONDS < MIN_READING_STEPS * reading_step:
        return Finding(title, NOT_MEASURABLE, "too few steps of its reading", rates[1])
    uncertainty = exchange_time / 2.0 / PULSE_SECONDS * assumed + 2.0 * reading_step / (PULSE_COUNT * PULSE_SECONDS)
    measured = f"{rates[0]} ± {rate_text(uncertainty)}"
    if (off := abs(rate - assumed)) <= RATE_TOLERANCE * assumed:
        return Finding(title, SAME, measured, rates[1])
    if off <= RATE_TOLERANCE * assumed + uncertainty:
        return Finding(title, NOT_MEASURABLE, f"{measured}, too rough to judge", rates[1])
    means = "A guiding program calibrates itself to that; guide-rate in gateway.toml sets it where it can be set."
    return Finding(title, DIFFERS, ("reversed, " if rate < 0.0 else "") + measured, rates[1], means)
