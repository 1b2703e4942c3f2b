"""When positions tell nothing of a motion: they do not come, they do not change, or they are of another sky.

Then nobody knows any more where the tube is, and no limit can be watched: motion by hand that is not seen is ended and
told of. What only seems to move because site or clock were set is no motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from msgspec import Struct

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.motion.ends import Sample
from gateway.mount.motion.seen import NEVER
from gateway.mount.motion.wanted import Moving

#: How old the last position may be when the next one is not told, seconds; and from one stop for that to the next.
BLIND = 1.0
#: Degrees a second from which on it is judged whether a motion is seen; seconds that it has gone on at least, and to
#: begin; and the part of its way that must be seen.
FROM, AFTER, PART = 0.1, 3.0, 0.1
#: A clock that is set by more than that means another sky, seconds.
SET_ANEW = 30.0
#: For so many seconds after that a mount at rest may tell of the old sky, of the new one, and of half of each.
SETTLES = 3.0


def blind(moving: Moving, age: float, since_stop: float) -> str:
    """Why a mount must stop that moves by hand and does not tell where it is; nothing where it need not.

    ``age`` is that of the last position. An LX200GPS that seeks its home is busy and tells nothing; it is not moved by
    hand meanwhile.
    """
    if moving.by_hand and age > BLIND and since_stop > BLIND:
        return "it moves and does not tell where it is"
    return ""


class Course(Struct, frozen=True):
    """One axis: how fast it was told to go, when it was seen first since, and the degrees seen of it since then."""

    speed: float
    began: float
    last: Sample
    seen: float = 0.0

    def after(self, axis: int, sample: Sample) -> Course:
        """One position more; the way counts in pieces, for over a pole it turns back."""
        step = abs(wrap180(sample.axes[axis - 1] - self.last.axes[axis - 1]))
        return Course(self.speed, self.began, sample, self.seen + step)


class StallWatch:
    """``look`` is called with every position of a mount: is the motion seen in it that it was told to make?

    Else the motor stalls, or the mount tells an old position. Judged are only rates that a position shows without
    doubt, and only after the mount has had its time to begin.
    """

    def __init__(self) -> None:
        self._courses: dict[int, Course] = {}

    def clear(self) -> None:
        """Nothing moves by hand."""
        self._courses.clear()

    def look(self, sample: Sample, ordered: Mapping[int, float], round_trip: float) -> int | None:
        """-> the axis of which too little is seen, or None. ``ordered``: degrees a second of each axis by hand."""
        courses: dict[int, Course] = {}
        for axis, speed in ordered.items():
            if speed < FROM:
                continue
            before = self._courses.get(axis)
            same = before is not None and before.speed == speed
            courses[axis] = (
                before.after(axis, sample) if before is not None and same else Course(speed, sample.at, sample)
            )
        self._courses = courses
        for axis, course in courses.items():
            elapsed = sample.at - course.began
            if elapsed >= max(AFTER, 3.0 * round_trip) and course.seen < PART * course.speed * elapsed:
                return axis
        return None


class MeantSky:
    """Of which sky the positions are: when site or clock were set, those before and after mean other altitudes.

    The mount hears of them bit by bit (``being_set``: it has still to): while nobody moves it, what changes meanwhile
    is no motion. ``changed`` is emitted when another one is meant from now on and the mount rests.
    """

    def __init__(self, mount: Context, being_set: Callable[[], bool]) -> None:
        self._mount, self._being_set = mount, being_set
        self._frame: tuple[op.Place | None, float] = None, 0.0
        self._settles_until = NEVER
        self.changed: Signal[None] = Signal()

    def is_another(self, now: float, restless: bool) -> bool:
        """Whether a position of now cannot be compared with the one before."""
        mount, (place, ahead) = self._mount, self._frame
        known = mount.astrometry.site_clock
        self._frame = known.site(), known.unix() - now
        changed = place is not None and (place != self._frame[0] or abs(ahead - self._frame[1]) > SET_ANEW)
        if changed or self._being_set():
            self._settles_until = now + SETTLES
        moves = mount.movement.anything
        if changed and not moves:
            self.changed.emit(None)
        return changed or (now < self._settles_until and not moves and not restless)
