"""The end of a motion is owed until the position shows it: an acknowledgement can be lost, and some mounts give none.

Pure functions over frozen values; angles are degrees, times are seconds of any clock that never goes back. An end is
done when the speed has fallen below a ``PART`` of what was ordered; until then its command is sent again, at growing
intervals, and after ``TIMES`` in vain somebody must be told. A position that moves by less than ``DIGITS`` of what it
can show says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto
from itertools import pairwise

from msgspec import Struct

from gateway.astro.spherical import wrap180

#: Seconds from one sending to the next; a mount runs on for up to two seconds, and that must not look like a lost stop.
AGAIN = (1.5, 2.0, 3.0, 5.0)
#: How often an end is sent before somebody is told, and every how many seconds after that.
TIMES, THEN_EVERY = 5, 10.0
#: How many digits of the position a motion must be large enough to change.
DIGITS = 3
#: The part of the speed ordered that is no rest: a mount may be able to do no more than half of what it was ordered.
PART = 0.4
#: Degrees a second below which no motion by hand can be told from tracking by looking.
SLOW = 0.05


class Sample(Struct, frozen=True):
    """Where the axes were seen, in a frame in which an axis at rest stands still; ``digit`` is the least difference."""

    at: float
    axes: tuple[float, float]
    digit: float = 1.0 / 3600.0


class Ending(Struct, frozen=True):
    """Something is to stand still: which axes (1, 2), how fast they went, and when the command for it was sent."""

    axes: frozenset[int]
    speed: float
    sent: tuple[float, ...]

    def again(self, now: float) -> Ending:
        """The same, sent once more."""
        return Ending(self.axes, self.speed, (*self.sent, now))


class Step(Enum):
    """What is to be done about an end: nothing more, look again, send it again, or send it and say so."""

    DONE = auto()
    LOOK = auto()
    SEND = auto()
    ALARM = auto()


def visible(ending: Ending) -> bool:
    """Whether looking can tell at all that it was not heard."""
    return ending.speed >= 2.0 * SLOW


def speed(ending: Ending, samples: Sequence[Sample]) -> float | None:
    """How fast the axes that are to rest went since the end was sent, degrees a second; None while nobody can say.

    Of the looks since then the last two that are far enough apart count, so that a run-on before them does not.
    """
    since = [sample for sample in samples if sample.at >= ending.sent[-1]]
    for before, after in reversed(list(pairwise(since))):
        elapsed = after.at - before.at
        if elapsed * ending.speed / 2.0 >= DIGITS * max(before.digit, after.digit):
            turned = (abs(wrap180(after.axes[axis - 1] - before.axes[axis - 1])) for axis in ending.axes)
            return max(turned, default=0.0) / elapsed
    return None


def next_step(ending: Ending, samples: Sequence[Sample], now: float) -> Step:
    """What is to be done now."""
    if not visible(ending):
        return Step.DONE
    seen = speed(ending, samples)
    if seen is not None and seen < max(SLOW, ending.speed * PART):
        return Step.DONE
    times = len(ending.sent)
    pause = AGAIN[times - 1] if times <= len(AGAIN) else THEN_EVERY
    if seen is None or now - ending.sent[-1] < pause:
        return Step.LOOK
    return Step.SEND if times < TIMES else Step.ALARM
