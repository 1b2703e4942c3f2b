"""A motion by hand of which the position shows nothing: the motor stalls, or the mount tells an old position.

Either way nobody knows any more where the tube is, and no limit can be watched: the motion is ended and told of. Judged
only for rates that a position shows without doubt, and only after the mount has had its time to begin.
"""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from gateway.astro.spherical import wrap180
from gateway.mount.motion.ends import Sample

#: Degrees a second from which on a motion is judged; seconds that it has gone on at least, and to begin; and the part
#: of its way that must be seen.
FROM, AFTER, PART = 0.1, 3.0, 0.1


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
    """``look`` is called with every position of a mount."""

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
