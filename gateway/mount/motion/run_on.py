"""The run-on: after the end of a motion the mount counts as moving until its position shows it at rest.

Motors take up to two seconds to slow down, which would spoil an exposure, a sync or a guide pulse. Two positions that
were requested after the end and agree show rest. After ``MAX_SILENCE`` seconds without a position the motion counts as
unknown. The run-on changes what clients read and when guide pulses begin, never whether the gateway sends a stop.
Angles are degrees, times seconds of the event loop's clock.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.signals import Signal
from gateway.mount.motion.wanted import HandMove, Slew, Wanted

ARCSECOND = 1.0 / 3600.0
#: Degrees a second: the motion of the sky, and the greatest difference between the sidereal and other tracking rates.
SKY_SPEED, MAX_RATE_DIFF = 15.041 * ARCSECOND, 3.0 * ARCSECOND
#: Seconds: the least time between two positions that are compared; the age up to which a position from before the end
#: of a goto counts; and the time without a position after which the motion is unknown.
MIN_POSITION_GAP, MAX_EARLY_POSITION_AGE, MAX_SILENCE = 0.25, 1.5, 3.0
#: Seconds that a guide pulse waits for rest at most.
MAX_PULSE_WAIT = 1.5
#: Two positions agree if they differ by no more than this many units of the position's resolution.
REST_UNITS = 1.25


class TimedPosition(Struct, frozen=True):
    """A position, and the loop times of its arrival (``at``) and of its request (``requested_at``)."""

    at: float
    requested_at: float
    position: op.Equatorial


class RunOn(Struct, frozen=True):
    """The time after the end of a motion. ``goto``: it was a goto, park or home, else a motion by hand. ``positions``
    are those that can show rest; ``last_position_at`` is when the mount last reported any position.
    """

    ended_at: float
    goto: bool
    last_position_at: float
    positions: tuple[TimedPosition, ...] = ()


def unexplained_motion(before: op.Equatorial, after: op.Equatorial, elapsed: float, equatorial: bool = False) -> float:
    """Return the motion between two positions that tracking, on or off, does not explain, degrees. On an
    ``equatorial`` mount a turn in right ascension counts in full, because near the pole it hardly moves the tube.
    """
    distance = separation(before.ra, before.dec, after.ra, after.dec)
    passed = separation(before.ra + SKY_SPEED * elapsed, before.dec, after.ra, after.dec)
    turned = wrap180(after.ra - before.ra) * equatorial
    return max(min(distance, passed), min(abs(turned), abs(turned - SKY_SPEED * elapsed))) - MAX_RATE_DIFF * elapsed


def after_position(run_on: RunOn, position: TimedPosition, equatorial: bool, resolution: float) -> RunOn | None:
    """Return the run-on after a position with this ``resolution`` (degrees); None if the mount is at rest."""
    if position.requested_at < run_on.ended_at:
        return replace(run_on, last_position_at=position.at)
    older = [place for place in run_on.positions if position.at - place.at >= MIN_POSITION_GAP]
    if older:
        before, elapsed = older[-1], position.at - older[-1].at
        if unexplained_motion(before.position, position.position, elapsed, equatorial) <= REST_UNITS * resolution:
            return None
    places = (*older[-1:], *run_on.positions[len(older) :], position)
    return replace(run_on, last_position_at=position.at, positions=places)


class RunOnWatch:
    """Holds ``current``: the run-on, in which the mount may still move after the end of a motion; else None.
    ``changed`` is emitted with the loop time until which guide pulses wait.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        #: Emitted before each command that may move the mount; and its ``count`` at the last rest, -1 if unknown.
        self.may_move: Signal[None] = Signal()
        self._commands_at_rest = 0
        #: When the mount was last seen at rest after the end of a motion.
        self.rested_at = -inf
        self.current: RunOn | None = None
        self.changed: Signal[float] = Signal()

    @property
    def is_after_goto(self) -> bool:
        """Whether the mount runs on after a goto, park or home."""
        return self.current is not None and self.current.goto

    @property
    def motion_unknown(self) -> bool:
        """Whether the mount may run on and has not reported its position for more than ``MAX_SILENCE`` seconds."""
        return self.current is not None and self._clock() - self.current.last_position_at > MAX_SILENCE

    def activity(self, wanted: Wanted, parked: bool, reply_age: float) -> op.Activity:
        """Return the motion by orders of this gateway, with the run-on. ``reply_age``: seconds since the last reply."""
        slews, waiting = isinstance(wanted.motion, Slew), [order for order in wanted.pending if not order.follow_up]
        # The last step of a park: the tube has arrived, and tracking is not off yet.
        parks = any(getattr(order.operation, "then", "") == "park" for order in wanted.pending if order.follow_up)
        return op.Activity(
            goto=slews or bool(wanted.waiting_gotos) or (parks and not parked) or self.is_after_goto,
            by_hand=isinstance(wanted.motion, HandMove)
            or any(isinstance(order.operation, op.Move | op.MoveAxis) for order in waiting),
            ends=wanted.stop_owed or self.current is not None,
            unknown=self.motion_unknown or (wanted.stop_owed and reply_age > MAX_SILENCE),
            pulse=any(pulse.ends_at > self._clock() for pulse in wanted.pulses)
            or any(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending),
            parked=parked,
            homed=wanted.homed and not slews,
            short=wanted.goto_failure,
        )

    def note_may_move(self) -> None:
        """Note that the mount may be moving by a command of an earlier run of the gateway."""
        self._commands_at_rest = -1

    def begin(self, after_goto: bool, position: TimedPosition | None = None, moved_by_others: bool = False) -> None:
        """Note that the mount has acknowledged the end of a motion, or that a goto has ended by itself. ``position``,
        the last one, may be the first to show rest. Nothing changes if the mount was at rest, unless others moved it.
        """
        now = self._clock()
        if self.current is not None or not (self.may_move.count != self._commands_at_rest or moved_by_others):
            self.current = None if self.current is None else replace(self.current, goto=after_goto or self.current.goto)
            return
        counts = position is not None and now - position.requested_at < MAX_EARLY_POSITION_AGE
        self.current = RunOn(now, after_goto, now, (position,) if counts and position is not None else ())
        self.changed.emit(now + MAX_PULSE_WAIT)

    def forget(self) -> None:
        """End the run-on: a motion has begun, or the mount hibernates. This does not change how long pulses wait."""
        self.current = None

    def add_position(self, position: TimedPosition, equatorial: bool, resolution: float) -> None:
        """Take a position that the mount has reported."""
        if self.current is not None:
            self.current = after_position(self.current, position, equatorial, resolution)
            if self.current is None:
                self._commands_at_rest, self.rested_at = self.may_move.count, position.at
                self.changed.emit(0.0)
