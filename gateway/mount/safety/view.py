"""What a safety rule gets and returns. Nothing here acts.

A rule is a pure function from a ``View`` (what was seen, what is wanted, the limits in force) to a ``Verdict``.
"""

from __future__ import annotations

from msgspec import Struct

from gateway.core import operations as op
from gateway.mount.motion.seen import Seen
from gateway.mount.motion.wanted import Moving
from gateway.mount.policy import Limits
from gateway.mount.safety.hour_angle import PastNow
from gateway.mount.safety.stop_timing import StopTiming, ahead

#: Degrees a second, faster than any tracking: the mount is moved, or a coarse position changed by a digit.
FASTER_THAN_TRACKING = 0.1
#: Degrees by which a goto that brakes before a limit stays behind what its last speed lets expect.
BRAKED = 0.75


class Verdict(Struct, frozen=True):
    """``reason`` says why the motion must end; empty if it may continue.

    It may continue for ``within`` seconds (None: without limit). If no new position arrives in that time, it must stop,
    because it may have reached ``limit``.
    """

    reason: str = ""
    within: float | None = None
    limit: str = ""


ALLOWED = Verdict()


class CheckedPath:
    """The path of the goto that is about to begin: whether it leads beyond an altitude limit, and whether it is known
    to stay within all limits.
    """

    leaves_limits = clear = False


class View(Struct, frozen=True):
    """The state of a mount that the rules judge.

    ``sun`` is the smallest allowed distance from the Sun, degrees. The first ``own_suns`` of those seen are shown by
    the mount's own coordinates or axes, the others by other sources of site and time. ``past`` tells how far the tube
    is past the meridian, None if unknown or during a goto. ``astray``: the goto may pass a limit on its path.
    """

    seen: Seen
    limits: Limits
    timing: StopTiming
    moving: Moving
    sun: float = 0.0
    status: op.Status | None = None
    past: PastNow | None = None
    astray: bool = False
    own_suns: int = 1

    @property
    def on_checked_path(self) -> bool:
        """Whether only a checked goto moves the mount: no motion by hand took over, and none of its axes was stopped.

        A goto whose path leads beyond a limit does not count: it is watched like a motion by hand.
        """
        return self.moving.slewing and self.moving.ordered and not self.moving.by_hand and not self.astray

    @property
    def _second_axis_alone(self) -> float:
        """How far one of two axes moves the tube after the other has stopped, degrees."""
        return self.seen.across * self.timing.between_axes(len(self.moving.by_hand))

    def ahead(self, rate: float, earlier: float | None) -> float:
        """How fast the mount may approach a limit from now on, after the rates ``earlier`` and ``rate``."""
        seen = self.seen
        if self.moving.slews_by_itself:
            return rate
        assert seen.before is not None
        assert seen.last is not None
        return ahead(rate, earlier, seen.ordered_speed, seen.before.at - seen.began, seen.last.at - seen.began)

    def margin(self, rate: float) -> float:
        """How far a motion gets before a stop at the next position can end it, degrees; 0 for a goto, which brakes."""
        if self.on_checked_path or self.moving.slews_by_itself:
            return 0.0
        return rate * self.timing.overdue(self.seen.elapsed) + self._second_axis_alone

    def allowed_within(self, room: float, rate: float, limit: str) -> Verdict:
        """Return a verdict that allows the motion while a stop can still end it within ``room`` degrees.

        A goto of the mount's own may brake and end just before the limit: it is stopped only when it gets there.
        """
        if rate <= FASTER_THAN_TRACKING or self.on_checked_path:
            return ALLOWED
        if self.moving.slews_by_itself:
            return Verdict(within=(room + BRAKED) / rate - self.timing.exchange, limit=limit)
        return Verdict(within=(room - self._second_axis_alone) / rate - self.timing.to_stop, limit=limit)
