"""What the rules may know of a mount, and nothing more, and what they say. Nothing here acts.

A rule is a pure function of a ``View``: what was seen, what is wanted and the limits in force -> a ``Verdict``.
"""

from __future__ import annotations

from msgspec import Struct

from gateway.core import operations as op
from gateway.mount.motion.seen import Seen
from gateway.mount.motion.wanted import Moving
from gateway.mount.policy import Limits
from gateway.mount.safety.stop_timing import StopTiming, ahead

#: Degrees a second that no tracking reaches, though one digit of a coarse position may: somebody moves the mount.
RESTLESS = 0.1


class Verdict(Struct, frozen=True):
    """``reason`` says what forbids that it goes on, if anything does.

    Else it may go on for ``within`` seconds (None: as long as it likes) and must then stop at ``limit``, unless it has
    been seen again.
    """

    reason: str = ""
    within: float | None = None
    limit: str = ""


ALLOWED = Verdict()


class View(Struct, frozen=True):
    """``sun`` is how near to it the tube may come; ``side`` the side of the pier (E, W) that the tube is on.

    ``german`` and ``side`` are None where nobody knows. ``astray`` is a goto that does not go the way that was checked.
    """

    seen: Seen
    limits: Limits
    timing: StopTiming
    moving: Moving
    sun: float = 0.0
    status: op.Status | None = None
    german: bool | None = None
    side: str | None = None
    astray: bool = False

    @property
    def going(self) -> bool:
        """Whether it is a goto that moves the mount, and no hand that took over from it or ended one of its axes.

        One whose way leads beyond a limit is none that knows where it ends, either.
        """
        return self.moving.slewing and not self.moving.by_hand and not self.astray

    @property
    def _alone(self) -> float:
        """How far one of two axes leads while the other has been ended already, degrees."""
        return self.seen.across * self.timing.between(len(self.moving.by_hand))

    def ahead(self, rate: float, earlier: float | None) -> float:
        """How fast it may come nearer from now on, where ``rate`` was seen and ``earlier`` before that."""
        seen = self.seen
        assert seen.before is not None
        assert seen.last is not None
        return ahead(rate, earlier, seen.told, seen.before.at - seen.began, seen.last.at - seen.began)

    def margin(self, rate: float) -> float:
        """How far a motion gets before the next look and a stop can end it, degrees; a goto knows where it ends."""
        return 0.0 if self.going else rate * self.timing.overdue(self.seen.elapsed) + self._alone

    def until(self, room: float, rate: float, limit: str) -> Verdict:
        """It may go on for as long as a stop still helps, with so many degrees left."""
        if rate <= RESTLESS or self.going:
            return ALLOWED
        return Verdict(within=(room - self._alone) / rate - self.timing.to_stop, limit=limit)
