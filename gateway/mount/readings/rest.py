"""Checks that the mount is at rest: two position samples differ by no more than tracking explains.

With tracking on, right ascension and declination stay the same; with tracking off, right ascension grows at the
sidereal rate. Near the pole or the zenith the position hardly shows a turn of the first axis, so that axis is compared
as well. The coarser the mount's position, the farther apart the samples, to notice slow motion.
"""

from __future__ import annotations

import asyncio
from collections import deque
from math import cos, radians
from typing import NamedTuple

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Asleep, Fault
from gateway.mount.context import Context
from gateway.mount.motion.run_on import ARCSECOND, SKY_SPEED, unexplained_motion
from gateway.mount.readings.reader import Reader

#: The longest time in seconds from the acknowledgement of a stop to rest; mounts move on for up to two seconds.
MAX_TIME_TO_REST = 8.0
#: The shortest time in seconds between two samples that are compared, and the time between successive samples.
MIN_COMPARED_GAP, SAMPLE_GAP = 0.7, 0.2
#: Degrees a second: the slowest motion that the check must notice.
MIN_NOTICED_SPEED = 30.0 * ARCSECOND
#: Slow turns of the azimuth axis count as tracking: up to ZENITH_SPEED_FACTOR times the speed at which tracking turns
#: that axis, but at least up to MIN_TRACKING_SPEED and at most up to MAX_AZ_SPEED, degrees a second.
MIN_TRACKING_SPEED, ZENITH_SPEED_FACTOR, MAX_AZ_SPEED = 0.1, 3.0, 2.5


class RestSample(NamedTuple):
    """A position and its loop time. For an alt-azimuth mount also its azimuth, degrees, and ``max_tracking_speed``: up
    to this speed, degrees a second, a turn of the azimuth axis counts as tracking.
    """

    sampled_at: float
    position: op.Equatorial
    azimuth: float | None = None
    max_tracking_speed: float = 0.0


async def wait_for_rest(context: Context, reader: Reader, timeout: float = MAX_TIME_TO_REST) -> None:
    """Sample the position until the mount is at rest. Raises Fault if it still moves after ``timeout`` seconds, or if
    that cannot be determined. A mount that hibernates is at rest and is not asked.
    """
    samples: deque[RestSample] = deque()
    rate, trouble, begun = None, Fault("the mount has not reported its position"), _count_motions(context)
    apart = max(MIN_COMPARED_GAP, context.driver.rest_tolerance / MIN_NOTICED_SPEED)
    try:
        async with asyncio.timeout(timeout):
            while True:
                try:
                    samples.append(await _take_sample(context, reader))
                except Asleep:
                    return
                except Fault as fault:
                    trouble = fault
                while len(samples) > 1 and samples[-1].sampled_at - samples[1].sampled_at >= apart:
                    samples.popleft()
                if len(samples) > 1 and samples[-1].sampled_at - samples[0].sampled_at >= apart:
                    rate = _unexplained_speed(samples[0], samples[-1], 1.25 * context.driver.rest_tolerance)
                    if rate == 0.0 and not context.movement.any_motion:
                        return
                await asyncio.sleep(SAMPLE_GAP)
    except TimeoutError:
        pass
    if context.movement.any_motion or _count_motions(context) != begun:
        raise Fault("a program has set the mount moving again; prevent that with: mount-gateway stop --hold")
    if rate is None:
        raise Fault(f"the stop was sent, but the gateway cannot see whether the mount is at rest: {trouble}")
    raise Fault(f"the stop was acknowledged, but the mount still moves after {timeout:.0f} s: {rate:.3f} degrees/s")


def _count_motions(context: Context) -> tuple[int, tuple[int, int]]:
    """Return how many gotos, and how many motions of each axis (gotos included), the mount has acknowledged."""
    return context.wanted.value.gotos_begun, context.wanted.value.motions_begun


async def _take_sample(context: Context, reader: Reader) -> RestSample:
    """Ask the mount for its position now and return it as a sample. Raises Fault."""
    status: op.Status = await reader.read(op.GetStatus())
    position: op.Equatorial = await reader.read_now(op.Position())
    at = context.now()
    if status.equatorial:
        return RestSample(at, position)
    reading: op.Horizontal = await reader.read_now(op.HorizontalPosition())
    tracking_speed = MIN_TRACKING_SPEED
    if status.tracking is not op.Tracking.OFF:
        tracking_speed = min(
            MAX_AZ_SPEED,
            max(MIN_TRACKING_SPEED, ZENITH_SPEED_FACTOR * SKY_SPEED / max(abs(cos(radians(reading.alt))), 1e-6)),
        )
    return RestSample(at, position, reading.az, tracking_speed)


def _unexplained_speed(before: RestSample, after: RestSample, min_motion: float) -> float:
    """Return the speed that tracking does not explain, degrees a second; 0 below ``min_motion`` degrees."""
    elapsed, equatorial = after.sampled_at - before.sampled_at, after.azimuth is None
    moved = unexplained_motion(before.position, after.position, elapsed, equatorial)
    if before.azimuth is not None and after.azimuth is not None:
        tracking = max(before.max_tracking_speed, after.max_tracking_speed) * elapsed
        moved = max(moved, abs(wrap180(after.azimuth - before.azimuth)) - tracking)
    return moved / elapsed if moved > min_motion else 0.0
