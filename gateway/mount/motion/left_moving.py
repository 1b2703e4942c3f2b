"""Motion that went on without the gateway: motion that it had begun when its line was lost, or when it was killed.

Meanwhile a person at the hand control may have ended that motion and begun another motion, which is left alone. A
recent motion is stopped at once. After that time, a goto is stopped if the marker names a goto, and two positions
decide whether an axis still turns as the marker says. If they cannot decide, the motion is stopped as well.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.motion_kinds import MOVERS
from gateway.mount.motion.ends import MIN_PART, SLOW, AxisSample
from gateway.mount.motion.wanted import Slew, Wanted

#: Seconds for which a mark counts without a look at the mount.
MAX_AGE = 10.0
#: Seconds between the two positions, and for both together.
SAMPLE_GAP, SAMPLES_TIMEOUT = 0.7, 1.5
#: How many times faster than marked an axis may turn and still be taken for the marked motion.
FASTER = 2.5


class LeftMotion(Struct, frozen=True, omit_defaults=True):
    """The motion left behind: ``speeds`` of motions by hand, by axis, degrees a second; or a ``goto``.

    ``direction``: whether the reading of the first axis grew (1) or fell (-1), 0 if positions have not shown it. The
    reading of the second axis has no such direction, because it turns back over the pole or the zenith.
    """

    speeds: dict[int, float] = {}
    direction: int = 0
    goto: bool = False


def left_motion(wanted: Wanted, speed: Callable[[op.Rate], float], samples: list[AxisSample]) -> LeftMotion | None:
    """Return what the gateway has set moving; None if positions could not show whether that goes on."""
    begun = [
        *wanted.by_hand.values(),
        *(order.operation for order in wanted.pending if isinstance(order.operation, MOVERS)),
    ]
    if isinstance(wanted.motion, Slew):
        begun.insert(0, wanted.motion.operation)
    if not begun:
        return None
    if isinstance(begun[-1], op.Goto):
        return LeftMotion(goto=True)
    speeds: dict[int, float] = {}
    for operation in begun:
        if not isinstance(operation, op.Move | op.MoveAxis) or speed(operation.rate) < 2.0 * SLOW:
            return None
        speeds[operation.axis] = speed(operation.rate)
    rate = turning(samples[-2], samples[-1])[0] if 1 in speeds and len(samples) > 1 else 0.0
    shown = abs(rate) >= MIN_PART * speeds.get(1, 0.0)
    return LeftMotion(speeds, (rate > 0.0) - (rate < 0.0) if shown else 0)


def turning(before: AxisSample, after: AxisSample) -> Pair:
    """Return the speeds of both axes between two samples, degrees a second."""
    elapsed = max(after.at - before.at, 1e-6)
    return wrap180(after.axes[0] - before.axes[0]) / elapsed, wrap180(after.axes[1] - before.axes[1]) / elapsed


def still_left(left: LeftMotion, rates: Pair) -> frozenset[int]:
    """Return the axes that still turn as marked, by the speeds of both, degrees a second."""
    axes = {axis for axis, speed in left.speeds.items() if MIN_PART * speed <= abs(rates[axis - 1]) <= FASTER * speed}
    return frozenset(axes - ({1} if rates[0] * left.direction < 0.0 else set()))


def rests(rates: Pair) -> bool:
    """Whether nothing moves but by tracking, by the speeds of both axes."""
    return max(map(abs, rates)) < SLOW
