"""Looks after an end that was sent until the positions prove it, and has it sent again while they do not.

A motion that is begun meanwhile takes its place: what moves then is wanted. Nothing is known of who moves a mount, so
an end is sent a few times, told of, and then left: it is not fought for without end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gateway.core.signals import Signal
from gateway.mount.motion.ends import TIMES, Ending, Sample, Step, next_step

#: How many of the last positions are remembered.
REMEMBERED = 6
#: After so many times it is left alone: perhaps somebody at the hand control moves it. Limits hold all the same.
AT_MOST = TIMES + 3


class EndWatch:
    """``again`` is emitted with the axes whose end is to be sent once more; ``warn`` is told what must be known."""

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
        """A position has come."""
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
