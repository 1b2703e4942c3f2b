"""Motion that the gateway began and that went on without it: its line was lost, or its process was killed.

A marker file records the motion. If the file is recent, the mount is stopped at once. Later, a person at the hand
control may have begun another motion, which the gateway leaves alone. So a goto is stopped only if the marker names a
goto, and a motion by hand only if the axis turns as the marker says, or if positions cannot show it.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.motion_kinds import MOVERS
from gateway.mount.motion.ends import MIN_SPEED_RATIO, MIN_VISIBLE_SPEED, AxisSample
from gateway.mount.motion.wanted import Slew, Wanted

#: Age of the marker in seconds up to which the mount is stopped without reading its position.
MAX_MARK_AGE = 10.0
#: Seconds between the two positions that are compared, and within which both must arrive.
SAMPLE_GAP, SAMPLES_TIMEOUT = 0.7, 1.5
#: How many times faster than recorded an axis may turn and still be taken for the recorded motion.
MAX_SPEEDUP = 2.5


class Leftover(Struct, frozen=True, omit_defaults=True):
    """The motion that a marker records: ``speeds`` of motions by hand, by axis, degrees a second; or a ``goto``.

    ``direction`` is that of the first axis: 1 if its reading grew, -1 if it fell, 0 if positions have not shown it. The
    second axis has none, because its reading reverses at the pole or the zenith.
    """

    speeds: dict[int, float] = {}
    direction: int = 0
    goto: bool = False


def find_leftover(wanted: Wanted, speed_of: Callable[[op.Rate], float], samples: list[AxisSample]) -> Leftover | None:
    """Return the motion of pending and begun orders; None without one, or if positions could not show its end later."""
    begun = [
        *wanted.hand_moves.values(),
        *(order.operation for order in wanted.pending if isinstance(order.operation, MOVERS)),
    ]
    if isinstance(wanted.motion, Slew):
        begun.insert(0, wanted.motion.operation)
    if not begun:
        return None
    if isinstance(begun[-1], op.Goto):
        return Leftover(goto=True)
    speeds: dict[int, float] = {}
    for operation in begun:
        if not isinstance(operation, op.Move | op.MoveAxis) or speed_of(operation.rate) < 2.0 * MIN_VISIBLE_SPEED:
            return None
        speeds[operation.axis] = speed_of(operation.rate)
    rate = axis_speeds(samples[-2], samples[-1])[0] if 1 in speeds and len(samples) > 1 else 0.0
    shown = abs(rate) >= MIN_SPEED_RATIO * speeds.get(1, 0.0)
    return Leftover(speeds, (rate > 0.0) - (rate < 0.0) if shown else 0)


def axis_speeds(before: AxisSample, after: AxisSample) -> Pair:
    """Return the speeds of both axes between two samples, degrees a second."""
    elapsed = max(after.time - before.time, 1e-6)
    return wrap180(after.angles[0] - before.angles[0]) / elapsed, wrap180(after.angles[1] - before.angles[1]) / elapsed


def axes_still_moving(leftover: Leftover, speeds: Pair) -> frozenset[int]:
    """Return the axes that still turn as recorded. ``speeds``: the present speeds, degrees a second."""
    axes = {
        axis
        for axis, speed in leftover.speeds.items()
        if MIN_SPEED_RATIO * speed <= abs(speeds[axis - 1]) <= MAX_SPEEDUP * speed
    }
    return frozenset(axes - ({1} if speeds[0] * leftover.direction < 0.0 else set()))


def is_at_rest(axis_rates: Pair) -> bool:
    """Whether the mount rests or only tracks. ``axis_rates``: the speeds of both axes, degrees a second."""
    return max(map(abs, axis_rates)) < MIN_VISIBLE_SPEED
