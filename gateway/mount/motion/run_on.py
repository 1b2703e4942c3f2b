"""The run-on: after the end of a motion the mount counts as moving until its position shows it at rest.

Motors take up to two seconds to slow down, and whoever exposes, syncs or guides meanwhile does so on a mount that turns
at degrees a second. Two positions that were requested after the end and agree show rest. Without a position for
``MAX_SILENCE`` seconds nobody knows whether the mount moves. The run-on changes what clients read and when guide
pulses begin, never whether the gateway sends a stop. Angles are degrees, times seconds of the event loop's clock.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.signals import Signal
from gateway.mount.motion.wanted import ByHand, Slew, Wanted

ARCSECOND = 1.0 / 3600.0
#: Degrees a second: the sky over a drive that is off, and the difference between the sidereal and other drive rates.
SKY, DRIVES = 15.041 * ARCSECOND, 3.0 * ARCSECOND
#: Seconds between two positions that are compared, at least; the age up to which one from before a goto's own end
#: counts; and the time without a position after which nothing is known.
MIN_POSITION_GAP, MAX_POSITION_GAP, MAX_SILENCE = 0.25, 1.5, 3.0
#: Seconds that a guide pulse waits for rest at most.
MAX_PULSE_WAIT = 1.5
#: Two positions agree if they differ by no more than this many units of the position's resolution.
REST_UNITS = 1.25


class TimedPosition(Struct, frozen=True):
    """A position, the loop time of its request, and that of its arrival."""

    at: float
    asked: float
    sky: op.Equatorial


class RunOn(Struct, frozen=True):
    """A motion that was ended at ``since``; of a ``goto``, park or home, or by hand. ``positions`` are the positions
    that count; ``last_position_at`` is the time of the mount's last report of a position.
    """

    since: float
    goto: bool
    last_position_at: float
    positions: tuple[TimedPosition, ...] = ()


def unexplained_motion(before: op.Equatorial, after: op.Equatorial, elapsed: float, equatorial: bool = False) -> float:
    """Return the motion between two positions that tracking, on or off, does not explain, degrees.

    On an ``equatorial`` mount the first axis also counts alone, because near the pole its turning hardly shows.
    """
    distance = separation(before.ra, before.dec, after.ra, after.dec)
    passed = separation(before.ra + SKY * elapsed, before.dec, after.ra, after.dec)
    turned = wrap180(after.ra - before.ra) * equatorial
    return max(min(distance, passed), min(abs(turned), abs(turned - SKY * elapsed))) - DRIVES * elapsed


def after_position(run_on: RunOn, position: TimedPosition, equatorial: bool, resolution: float) -> RunOn | None:
    """Return the run-on after a position; None if the mount is at rest. ``resolution`` is that of the position,
    degrees.
    """
    if position.asked < run_on.since:
        return replace(run_on, last_position_at=position.at)
    older = [place for place in run_on.positions if position.at - place.at >= MIN_POSITION_GAP]
    if older:
        before, elapsed = older[-1], position.at - older[-1].at
        if unexplained_motion(before.sky, position.sky, elapsed, equatorial) <= REST_UNITS * resolution:
            return None
    places = (*older[-1:], *run_on.positions[len(older) :], position)
    return replace(run_on, last_position_at=position.at, positions=places)


class RunOnWatch:
    """Holds the run-on under way, None at rest. ``changed`` is emitted with the time until which pulses wait."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        #: Emitted with each command that may set the mount moving, and how often until it was last seen at rest.
        self.sent: Signal[None] = Signal()
        self._rested_at = 0
        #: When the mount was last seen at rest after the end of a motion.
        self.rested = -inf
        self.value: RunOn | None = None
        self.changed: Signal[float] = Signal()

    @property
    def of_goto(self) -> bool:
        """Whether the mount runs on after a goto, park or home."""
        return self.value is not None and self.value.goto

    @property
    def unknown(self) -> bool:
        """Whether the mount has not reported its position for so long that nothing is known of its motion."""
        return self.value is not None and self._clock() - self.value.last_position_at > MAX_SILENCE

    def activity(self, wanted: Wanted, parked: bool, heard: float) -> op.Activity:
        """Return the motion by orders of this gateway, including the run-on. ``parked``: the mount is parked;
        ``last_position_at``: seconds since its last reply.
        """
        slews, waiting = isinstance(wanted.motion, Slew), [order for order in wanted.pending if not order.follow_up]
        # The last step of a park: the tube has arrived, and tracking is not off yet.
        parks = any(getattr(order.operation, "then", "") == "park" for order in wanted.pending if order.follow_up)
        return op.Activity(
            goto=slews or bool(wanted.waiting_gotos) or (parks and not parked) or self.of_goto,
            by_hand=isinstance(wanted.motion, ByHand)
            or any(isinstance(order.operation, op.Move | op.MoveAxis) for order in waiting),
            ends=wanted.owed or self.value is not None,
            unknown=self.unknown or (wanted.owed and heard > MAX_SILENCE),
            pulse=any(pulse.until > self._clock() for pulse in wanted.pulses)
            or any(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending),
            parked=parked,
            homed=wanted.homed and not slews,
            short=wanted.short,
        )

    def may_move(self) -> None:
        """Note that the mount may be moving by a command of an earlier run of the gateway."""
        self._rested_at = -1

    def ended(self, goto: bool, latest: TimedPosition | None = None, by_others: bool = False) -> None:
        """Note an end that the mount has acknowledged, or a goto that has ended by itself. The ``latest`` position,
        from shortly before, may already show rest. ``by_others``: somebody else moves the mount. A repeated end, and
        the end of a mount that was at rest since its last motion, change nothing.
        """
        now = self._clock()
        if self.value is not None or not (self.sent.count != self._rested_at or by_others):
            self.value = None if self.value is None else replace(self.value, goto=goto or self.value.goto)
            return
        counts = latest is not None and now - latest.asked < MAX_POSITION_GAP
        self.value = RunOn(now, goto, now, (latest,) if counts and latest is not None else ())
        self.changed.emit(now + MAX_PULSE_WAIT)

    def forget(self) -> None:
        """Note that a motion has begun, or that the mount hibernates: nothing runs on. Pulses wait as before."""
        self.value = None

    def position(self, position: TimedPosition, equatorial: bool, resolution: float) -> None:
        """Take a position that the mount has reported."""
        if self.value is not None:
            self.value = after_position(self.value, position, equatorial, resolution)
            if self.value is None:
                self._rested_at, self.rested = self.sent.count, position.at
                self.changed.emit(0.0)
