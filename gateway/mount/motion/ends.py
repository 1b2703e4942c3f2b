"""Repeats the command that ends a motion until positions show the end: some mounts do not acknowledge it.

A motion has ended when its speed has fallen below ``MIN_SPEED_RATIO`` of the ordered speed. Until then the command
is repeated at growing intervals. After ``TRIES_BEFORE_WARNING`` attempts the log warns the user. After ``MAX_TRIES``
the gateway gives up, because a person at the hand control may be moving the mount. Pure functions over frozen values
decide; angles are degrees, times seconds of a monotonic clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from enum import Enum, auto
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.signals import Signal
from gateway.mount.motion.wanted import WantedState

#: Seconds between retries; a mount runs on for up to two seconds after a stop, which must not look like a lost stop.
RETRY_DELAYS = (1.5, 2.0, 3.0, 5.0)
#: How often the command is sent before the log warns the user, and the seconds between further retries.
TRIES_BEFORE_WARNING, LATER_RETRY_PERIOD = 5, 10.0
#: How many of the last positions are kept.
MAX_SAMPLES = 6
#: After this many attempts the gateway gives up: perhaps a person moves the mount. The limits still apply.
MAX_TRIES = TRIES_BEFORE_WARNING + 3
#: A speed is measured over at least this many units of the position's resolution.
MIN_STEP_UNITS = 3
#: The fraction of the ordered speed that still counts as motion: some mounts reach only half of the ordered speed.
MIN_SPEED_RATIO = 0.4
#: Degrees a second below which positions cannot distinguish motion by hand from tracking.
MIN_VISIBLE_SPEED = 0.05


class AxisSample(Struct, frozen=True):
    """The readings of both axes at a time: right ascension and declination, or azimuth and altitude, degrees."""

    time: float
    angles: tuple[float, float]
    resolution: float = 1.0 / 3600.0


class MotionEnd(Struct, frozen=True):
    """A motion that was ended: its axes (1, 2), its speed in degrees a second, and the times at which the command to
    end it was sent.

    ``motions_begun`` is ``Wanted.motions_begun`` at its end: if it has grown since, the axis was set moving again,
    and need not come to rest.
    """

    axes: frozenset[int]
    speed: float
    sent_times: tuple[float, ...]
    motions_begun: tuple[int, int] = (0, 0)

    def with_retry(self, now: float) -> MotionEnd:
        return replace(self, sent_times=(*self.sent_times, now))


class EndStep(Enum):
    """What to do next to end a motion: nothing, a position read, the end command again, or that and a warning."""

    DONE = auto()
    READ_POSITION = auto()
    SEND_AGAIN = auto()
    SEND_AND_WARN = auto()


def is_end_visible(ending: MotionEnd) -> bool:
    """Whether the motion is fast enough for positions to show that it has not ended."""
    return ending.speed >= 2.0 * MIN_VISIBLE_SPEED


def speed_since_end(ending: MotionEnd, samples: Sequence[AxisSample]) -> float | None:
    """Return the speed since the motion was ended, degrees a second; None if the samples do not show it yet.

    Only the last two samples that are far enough apart count, to leave out the run-on before them.
    """
    since = [sample for sample in samples if sample.time >= ending.sent_times[-1]]
    for before, after in reversed(list(pairwise(since))):
        elapsed = after.time - before.time
        if elapsed * ending.speed / 2.0 >= MIN_STEP_UNITS * max(before.resolution, after.resolution):
            turned = (abs(wrap180(after.angles[axis - 1] - before.angles[axis - 1])) for axis in ending.axes)
            return max(turned, default=0.0) / elapsed
    return None


def next_step(ending: MotionEnd, samples: Sequence[AxisSample], now: float) -> EndStep:
    """Return what to do now so that a motion ends."""
    if not is_end_visible(ending):
        return EndStep.DONE
    measured = speed_since_end(ending, samples)
    if measured is not None and measured < max(MIN_VISIBLE_SPEED, ending.speed * MIN_SPEED_RATIO):
        return EndStep.DONE
    times = len(ending.sent_times)
    pause = RETRY_DELAYS[times - 1] if times <= len(RETRY_DELAYS) else LATER_RETRY_PERIOD
    if measured is None or now - ending.sent_times[-1] < pause:
        return EndStep.READ_POSITION
    return EndStep.SEND_AGAIN if times < TRIES_BEFORE_WARNING else EndStep.SEND_AND_WARN


class EndWatch:
    """Watches until positions confirm that a motion has ended, or a new motion of the same axes begins.

    ``resend_needed`` is emitted with the axes that must be stopped once more; ``warn`` receives the log lines.
    """

    def __init__(self, clock: Callable[[], float], warn: Callable[[str], None], wanted: WantedState) -> None:
        self._clock, self._warn, self._wanted = clock, warn, wanted
        self.resend_needed: Signal[frozenset[int]] = Signal()
        self.samples: list[AxisSample] = []
        self._ending: MotionEnd | None = None

    @property
    def ending(self) -> MotionEnd | None:
        """The motion whose end no positions show yet, without axes that were set moving again; None if none."""
        ending, begun = self._ending, self._wanted.value.motions_begun
        if ending is not None and ending.motions_begun != begun:
            axes = frozenset(axis for axis in ending.axes if ending.motions_begun[axis - 1] == begun[axis - 1])
            self._ending = replace(ending, axes=axes, motions_begun=begun) if axes else None
        return self._ending

    @property
    def is_watching(self) -> bool:
        """Whether positions are needed, because they have not shown yet that a motion has ended."""
        return self.ending is not None

    def watch_end(self, axes: Iterable[int], speed: float) -> None:
        """Watch axes for which a stop was sent, and which moved at up to this speed until then, degrees a second."""
        stopped, before, begun = frozenset(axes), self.ending, self._wanted.value.motions_begun
        if before is not None and before.axes == stopped:
            self._ending = MotionEnd(stopped, max(speed, before.speed), (*before.sent_times[:-1], self._clock()), begun)
        elif speed > 0.0:
            other = (before.axes, before.speed) if before is not None else (frozenset[int](), 0.0)
            self._ending = MotionEnd(stopped | other[0], max(speed, other[1]), (self._clock(),), begun)

    def add_sample(self, sample: AxisSample) -> None:
        """Take the readings of a position, and emit ``resend_needed`` if the axes must be stopped once more."""
        self.samples = [*self.samples[1 - MAX_SAMPLES :], sample]
        ending = self.ending
        if ending is None:
            return
        step = next_step(ending, self.samples, self._clock())
        if step is EndStep.DONE:
            self._ending = None
        elif step is not EndStep.READ_POSITION:
            again = ending.with_retry(self._clock())
            self._ending = again if len(again.sent_times) < MAX_TRIES else None
            self._warn(
                f"WARNING: the mount keeps moving after {TRIES_BEFORE_WARNING} stop commands: switch it off"
                if step is EndStep.SEND_AND_WARN
                else "the mount has not stopped: the stop is sent again"
            )
            self.resend_needed.emit(ending.axes)
