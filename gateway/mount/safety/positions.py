"""Positions that do not show a motion: they do not arrive, do not change, or refer to another sky.

Then the direction of the tube is unknown and no limit can be watched, so a motion by hand that cannot be seen is ended
and reported. Coordinates that change only because site or clock were set are not a motion.
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

#: Seconds: the age of the last position at which a mount counts as silent, and the least time between two stops for it.
BLIND = 1.0
#: A motion is judged if it is at least this fast, degrees a second, and has lasted this many seconds, including its
#: start; at least this part of the commanded way must be seen.
FROM, AFTER, PART = 0.1, 3.0, 0.1
#: Seconds for which a mount that was moved at the hand control is watched closely.
WATCH_CLOSELY = 3.0
#: Seconds; setting the clock by more than this changes the sky.
CLOCK_JUMP = 30.0
#: Seconds after that during which a resting mount may report the old sky, the new one, or half of each.
SETTLE_TIME = 3.0


def blind(moving: Moving, age: float, since_stop: float) -> str:
    """Return why a mount that moves by hand and reports no position must stop; empty if it need not.

    ``age`` is that of the last position, seconds. An LX200GPS that seeks its home position is busy and reports nothing,
    but it is not moved by hand meanwhile.
    """
    if moving.by_hand and age > BLIND and since_stop > BLIND:
        return "it moves but does not report its position"
    return ""


class Course(Struct, frozen=True):
    """The motion of one axis: commanded speed, time of the first position, last position, and degrees seen since."""

    speed: float
    began: float
    last: Sample
    seen: float = 0.0

    def after(self, axis: int, sample: Sample) -> Course:
        """Add one position. The distance is summed step by step, because the reading turns back over a pole."""
        step = abs(wrap180(sample.axes[axis - 1] - self.last.axes[axis - 1]))
        return Course(self.speed, self.began, sample, self.seen + step)


class StallWatch:
    """Finds axes that do not move although they were told to; call ``find_stalled`` with every position.

    Such a motor is stalled, or the mount reports an old position. Only speeds that a position shows clearly are judged,
    and only after the mount has had time to start.
    """

    def __init__(self) -> None:
        self._courses: dict[int, Course] = {}

    def clear(self) -> None:
        """Forget all motions: nothing moves by hand."""
        self._courses.clear()

    def find_stalled(self, sample: Sample, ordered: Mapping[int, float], round_trip: float) -> int | None:
        """Return an axis that moved too little, or None. ``ordered``: commanded speed per axis, degrees a second."""
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


class OthersWatch:
    """Notices motion that no client ordered: at the mount's own keys, or by the mount itself.

    ``since`` is the time of the first position that showed it, ``seen_at`` that of the last one, and ``begins`` whether
    the first is the last position; until the time ``until`` the mount is watched closely.
    """

    def __init__(self) -> None:
        self.since = self.seen_at = self.until = NEVER
        self.begins = self._moves = False

    def see(self, now: float, moves: bool) -> None:
        """Take whether the last two positions show such a motion."""
        self.begins, self._moves = moves and not self._moves, moves
        if self.begins or not moves:
            self.since = now
        if moves:
            self.seen_at, self.until = now, now + WATCH_CLOSELY


class SkyChange:
    """Notices that site or clock were set: positions before and after then mean different altitudes.

    The mount receives the settings one by one (``being_set``: some are still to be sent), so changes at rest during
    that time are not a motion. ``changed`` is emitted when site or clock have changed and the mount is at rest.
    """

    def __init__(self, mount: Context, being_set: Callable[[], bool]) -> None:
        self._mount, self._being_set = mount, being_set
        self._frame: tuple[op.Place | None, float] = None, 0.0
        self._settles_until = NEVER
        self.changed: Signal[None] = Signal()

    def has_changed(self, now: float, moved_by_others: bool) -> bool:
        """Whether the position read now cannot be compared with the one before."""
        mount, (place, ahead) = self._mount, self._frame
        known = mount.astrometry.site_clock
        self._frame = known.site(), known.unix() - now
        changed = place is not None and (place != self._frame[0] or abs(ahead - self._frame[1]) > CLOCK_JUMP)
        if changed or self._being_set():
            self._settles_until = now + SETTLE_TIME
        moves = mount.movement.anything
        if changed and not moves:
            self.changed.emit(None)
        return changed or (now < self._settles_until and not moves and not moved_by_others)
