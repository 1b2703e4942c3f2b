"""The end of a motion is owed until the position shows it: an acknowledgement can be lost, and some mounts give none.

An end is done when the speed has fallen below a ``PART`` of what was ordered; until then its command is sent again, at
growing intervals, and after ``TIMES`` in vain somebody is told. Then it is left: nothing is known of who moves a mount,
and an end is not fought for without end. What is to be done is decided by pure functions over frozen values. Angles are
degrees, times are seconds of any clock that never goes back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from enum import Enum, auto
from itertools import pairwise

from msgspec import Struct

from gateway.astro.spherical import wrap180
from gateway.core.signals import Signal

#: Seconds from one sending to the next; a mount runs on for up to two seconds, and that must not look like a lost stop.
AGAIN = (1.5, 2.0, 3.0, 5.0)
#: How often an end is sent before somebody is told, and every how many seconds after that.
TIMES, THEN_EVERY = 5, 10.0
#: How many of the last positions are remembered.
REMEMBERED = 6
#: After so many times it is left alone: perhaps somebody at the hand control moves it. Limits hold all the same.
AT_MOST = TIMES + 3
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


class EndWatch:
    """Looks after an end that was sent; a motion that is begun meanwhile takes its place: what moves then is wanted.

    ``again`` is emitted with the axes whose end is to be sent once more; ``warn`` is told what must be known.
    """

    def __init__(self, now: Callable[[], float], warn: Callable[[str], None]) -> None:
        self._now, self._warn = now, warn
        self.again: Signal[frozenset[int]] = Signal()
        self._samples: list[Sample] = []
        self.ending: Ending | None = None

    @property
    def pending(self) -> bool:
        """Whether an end is not proven yet: positions are wanted."""
        return self.ending is not None

    def sent(self, axes: Iterable[int], speed: float) -> None:
        """An end went out for axes that were ordered, or seen, to go at up to so many degrees a second."""
        both, before = frozenset(axes), self.ending
        if before is not None and before.axes == both:
            self.ending = Ending(both, max(speed, before.speed), (*before.sent[:-1], self._now()))
        elif speed > 0.0:
            rest = (before.axes, before.speed) if before is not None else (frozenset[int](), 0.0)
            self.ending = Ending(both | rest[0], max(speed, rest[1]), (self._now(),))

    def moves(self, axes: Iterable[int]) -> None:
        """These axes were set moving anew: their end is over."""
        if self.ending is not None:
            left = self.ending.axes - frozenset(axes)
            self.ending = Ending(left, self.ending.speed, self.ending.sent) if left else None

    def look(self, sample: Sample) -> None:
        self._samples = [*self._samples[1 - REMEMBERED :], sample]
        ending = self.ending
        if ending is None:
            return
        step = next_step(ending, self._samples, self._now())
        if step is Step.DONE:
            self.ending = None
        elif step is not Step.LOOK:
            again = ending.again(self._now())
            self.ending = again if len(again.sent) < AT_MOST else None
            self._warn(
                f"WARNING: the mount keeps moving although it was told {TIMES} times to stop: switch it off"
                if step is Step.ALARM
                else "the mount has not stopped: the stop is sent again"
            )
            self.again.emit(ending.axes)
