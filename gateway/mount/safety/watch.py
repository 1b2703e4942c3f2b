"""Looks at every position the mount tells, and has what leads beyond a limit ended.

Whoever moves the mount is watched: programs, somebody at the keypad, tracking. Every position is folded into what was
seen (``seen.py``), the rules are asked (``allow.py``), and what will be beyond a limit before the next look and a stop
can come in time is stopped now. Motion is stopped; tracking that carries the tube there is switched off.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.motion import seen as fold
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.seen import NEVER, PositionSample, Seen
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.allow import allow, farthest, first_stretch
from gateway.mount.safety.altitude_axis import AltitudeAxis
from gateway.mount.safety.positions import MeantSky, StallWatch, blind
from gateway.mount.safety.stop_timing import SHORTEST, StopDeadline
from gateway.mount.safety.view import RESTLESS, Verdict, View

#: A position that changes so many times faster than the mount can move was told anew: an alignment, at its keys.
ANEW = 3.0
#: How long a mount that somebody moves at its keys is watched closely.
CLOSELY = 3.0
#: How long a mount may run on after it was told to end a motion: what it does meanwhile is not held against it.
COASTING = 1.0
#: How old the word of the mount may grow that it is not aligned, or does not track; and that on its pier side.
STATUS_AGE = 5.0
SIDE_AGE = 5.0
UNWATCHED = "not aligned: positions mean nothing yet, so no limit can be watched"


class LimitWatch:
    """``look`` is called with every position, ``began`` with every motion that the mount has acknowledged.

    ``must_stop`` is emitted in the call in which that is found, ``carried_to_limit`` (which one) when nobody moves the
    mount and it comes to a limit all the same. The other signals: a motion has begun, another sky is meant from now on,
    the mount was looked at and had said this of itself.
    """

    def __init__(self, mount: Context, reader: Reader, ends: EndWatch, being_set: Callable[[], bool]) -> None:
        self._mount, self._reader, self._ends = mount, reader, ends
        self.must_stop: Signal[None] = Signal()
        self.carried_to_limit: Signal[str] = Signal()
        self.motion_began: Signal[None] = Signal()
        self.looked: Signal[op.Status | None] = Signal()
        self._deadline, self._stalls = StopDeadline(asyncio.get_running_loop(), self._late), StallWatch()
        self.seen = Seen()
        self._limits = mount.policy.limits
        self._restless_until = self._coasts_until = self._stopped_at = NEVER
        #: Whether it was sent to a place at any altitude, and was seen to rest there.
        self._own_place = self._parked = False
        self._astray = False
        self._sky = MeantSky(mount, being_set)
        self.sky_changed = self._sky.changed
        self.altitude_axis = AltitudeAxis(mount)
        #: When the last motion was ended.
        self.rests_since = NEVER
        #: Whether the way of the goto that is being begun leads beyond an altitude limit.
        self.dips = False

    @property
    def restless(self) -> bool:
        """Whether the mount moves though nobody here has told it to."""
        return self._mount.now() < self._restless_until

    @property
    def axes_every(self) -> float | None:
        """How often the axes are to be read for the altitude that they tell, seconds; None where that is not needed."""
        return self.altitude_axis.every(self._mount.movement.anything or self.restless)

    @property
    def fastest(self) -> float:
        """How fast the mount may be moving now because it was told to, degrees a second; 0 where nothing moves."""
        moving = self._mount.movement.now()
        if moving.slewing:
            return self.seen.across or self._mount.fastest
        return max((self._mount.speed(one) for one in moving.by_hand.values()), default=0.0)

    # --- what is told to it -----------------------------------------------------------------------------------------

    def began(self, operation: op.Operation) -> None:
        """A motion has begun; what was seen last is where it began, unless the mount moved already."""
        mount, moving = self._mount, self._mount.movement.now()
        limits = mount.policy.limits
        self._own_place = False
        if isinstance(operation, op.Goto | op.GotoHorizontal | op.Move):
            limits = limits.narrowed(operation.lowest, operation.highest)
        elif isinstance(operation, op.Park) and (mount.policy.own_park or mount.driver.destination(operation) is None):
            limits, self._own_place = limits.at_any_altitude(), True
        self._limits, self._coasts_until, self._astray = limits, NEVER, self.dips
        self._parked = False
        self.motion_began.emit(None)
        told = mount.speed(operation) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        if isinstance(operation, op.Sync):
            self.seen = replace(self.seen, before=None, last=None, farthest=())
            self.altitude_axis.forget(synced=True)
        self.seen = fold.begin(self.seen, mount.now(), told, at_rest=not (moving.anything or self.restless))
        if not isinstance(operation, op.Move | op.MoveAxis):
            self._deadline.disarm()
        elif moving.by_hand.get(operation.axis) != operation:  # else where it leads was seen, or is reckoned with
            speed = sum(mount.speed(one) for one in {**moving.by_hand, operation.axis: operation}.values())
            self._heed(first_stretch(self._view(), mount.now(), speed))

    def arrived(self, _: None = None) -> None:
        """A goto is over. One that was stopped on its way has not brought the tube upright."""
        moving = self._mount.movement.now()
        if not (moving.ending or moving.by_hand):
            self.seen = replace(self.seen, upright=True)

    def halted(self) -> None:
        """One axis was ended: if it is a goto that goes on, its way is not the one that was checked."""
        self._astray = True

    def ended(self) -> None:
        """A motion by hand was ended, or all were."""
        self._deadline.disarm()
        self.rests_since = self._mount.now()
        self._coasts_until = self._mount.now() + COASTING

    def unseen(self, _: None = None) -> None:
        """The mount did not tell where it is."""
        mount, now = self._mount, self._mount.now()
        reason = blind(mount.movement.now(), mount.cache.age(op.Position, now), now - self._stopped_at)
        if reason:
            self._stopped_at = now
            self._stop(f"stopped: {reason}")

    # --- looking ----------------------------------------------------------------------------------------------------

    def look(self, place: op.Equatorial) -> None:
        """Compare a position with the one before, and act."""
        now, last = self._mount.now(), self.seen.last
        if last is not None and now - last.at < SHORTEST:
            return
        self._deadline.disarm()
        self._look_at_axes(now, place)
        if not self.altitude_axis.tells:
            self.altitude_axis.forget()
        if self._sky.is_another(now, self.restless):
            last = None
            self.altitude_axis.forget()
        elif last is not None and last.altitude is None:  # the site may have become known since
            last = self._measured(last.at, last.place)
            self.seen = fold.first(self.seen, last)
        sample = self._measured(now, place, last)
        if last is None or now < self._coasts_until or len(last.suns) != len(sample.suns):
            self.seen = fold.first(self.seen, sample)
            return
        status = self._mount.cache.value(op.GetStatus)
        if status is not None and not status.aligned:
            self.seen = replace(self.seen, before=None, last=sample)
            self._mount.note_once(UNWATCHED)
            if self._status_age > STATUS_AGE:
                self._reader.shared(op.GetStatus())
            return
        self.seen = fold.see(self.seen, sample)
        self._notice(now, status)
        view = self._view()
        verdict = allow(view)
        self.seen = replace(self.seen, farthest=farthest(view))
        self._heed(verdict)

    def look_at_altitude(self, axes: op.Horizontal) -> None:
        """The mount has told where its axes stand; of an alt-az one that is its altitude."""
        now, last = self._mount.now(), self.seen.last
        if last is None or last.altitude is None or now < self._coasts_until:
            return
        change = self.altitude_axis.read(axes, self.seen, now, self._mount.movement.anything or self.restless)
        if change is None:
            self._reader.shared(op.GetStatus())
        elif change:
            tilt = self.altitude_axis.tilt
            self._mount.note(
                f"the altitude axis stands {tilt:+.1f} degrees from what position, "
                "site and clock tell; the altitude limits go by the axis"
            )
            self.seen = replace(self.seen, before=None, last=replace(last, altitude=last.altitude + change))

    def _measured(self, now: float, place: op.Equatorial, before: PositionSample | None = None) -> PositionSample:
        """What a position means that is told now."""
        mount, astrometry = self._mount, self._mount.astrometry
        here = place if before is None else fold.at_once(now, place, before, mount.timing.lag)
        altitude, hour_angle = astrometry.altitude(here.ra, here.dec), None
        if altitude is not None:
            altitude += self.altitude_axis.tilt or 0.0
            hour_angle = astrometry.sidereal_time() - here.ra
        suns = tuple(mount.suns.distances(here))
        return PositionSample(now, place, altitude, hour_angle, suns, mount.wanted.by_hand.get(2))

    def _notice(self, now: float, status: op.Status | None) -> None:
        """Whether somebody else moves the mount, it was aligned anew, or the tube is beyond the pole or the zenith."""
        mount, moving, last = self._mount, self._mount.movement.now(), self.seen.last
        self.looked.emit(status)
        if self.seen.across > RESTLESS and not moving.anything:
            self._restless_until = now + CLOSELY
        if self.seen.across > ANEW * mount.fastest:
            mount.synced.forget()
            self.altitude_axis.forget()
        if status is not None and last is not None and last.lifting is not None:
            self.seen = fold.lifted(self.seen, status.equatorial, mount.speed(last.lifting))
        if not moving.anything and (not self._own_place or self._left_park(status)):
            self._limits, self._own_place = mount.policy.limits, False

    def _left_park(self, status: op.Status | None) -> bool:
        """Whether it tracks again where the owner has parked it: from then on the limits hold there, too."""
        if status is None or not (self._parked or self._status_age <= STATUS_AGE):
            self._reader.shared(op.GetStatus())
            return False
        tracks = status.tracking is not op.Tracking.OFF
        self._parked = self._parked or not tracks
        return self._parked and tracks

    @property
    def _status_age(self) -> float:
        return self._mount.cache.age(op.GetStatus, self._mount.now())

    def _view(self) -> View:
        mount, moving = self._mount, self._mount.movement.now()
        status = mount.cache.value(op.GetStatus)
        watches = self._limits.hour_angle is not None and status is not None and status.equatorial
        side = self._side() if watches and mount.driver.german and not moving.slewing else None
        german, limit = mount.driver.german, mount.suns.limit
        return View(self.seen, self._limits, mount.timing, moving, limit, status, german, side, self._astray)

    def _side(self) -> str | None:
        """The side of the pier by the last word on it, which is asked for anew when it grows old."""
        mount = self._mount
        if mount.cache.age(op.PierSide, mount.now()) > SIDE_AGE:
            mount.tasks.spawn(self._reader.tube_side())
        return mount.driver.tube_side(mount.cache.value(op.PierSide) or "")

    def _look_at_axes(self, now: float, place: op.Equatorial) -> None:
        """Whether what was ended rests, and whether what was begun by hand moves."""
        mount, by_hand = self._mount, self._mount.wanted.by_hand
        if not (self._ends.pending or by_hand):
            self._stalls.clear()
            return
        status = mount.cache.value(op.GetStatus)
        here = fold.axis_sample(mount.astrometry, status, getattr(mount.driver, "low", False), now, place)
        self._ends.look(here)
        judged = status is not None and status.aligned and not mount.driver.moves_by_gotos
        ordered = {axis: mount.speed(one) for axis, one in by_hand.items()} if judged else {}
        stalled = self._stalls.look(here, ordered, mount.link.typical * mount.timing.reads)
        if stalled is not None:
            self._stop(
                f"stopped: axis {stalled} was told to move, but its position does not change; check the "
                "mount (a stalled motor, a cable?)"
            )

    # --- acting -----------------------------------------------------------------------------------------------------

    def _heed(self, verdict: Verdict) -> None:
        if verdict.reason:
            self._act(verdict.reason)
        elif verdict.within is not None:
            self._deadline.arm(verdict.within, verdict.limit)

    def _late(self, limit: str) -> None:
        """By its last known speed the mount is about to reach a limit, and it has not been seen since."""
        if self._mount.movement.anything or self.restless:
            self._act(f"{limit}, estimated from its speed")

    def _act(self, reason: str) -> None:
        """Stop what moves; where nobody moves the mount, it is tracking, and that goes off."""
        if self._mount.movement.anything or self.restless:
            self._stop(f"stopped at {reason}")
        else:
            self.carried_to_limit.emit(reason)

    def _stop(self, words: str) -> None:
        self._mount.note(words)
        self.must_stop.emit(None)
