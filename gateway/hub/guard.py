"""The guard: looks at every position the mount tells, and ends what leads beyond a limit.

Whoever moves the mount is watched: programs, somebody at the keypad, tracking. Each look compares with the one before
it; what will be beyond a limit before the next look and a stop can come in time is stopped now, and what leads out of a
forbidden place goes on. A look that does not come in time is an alarm (``alarm.py``). Motion is stopped; tracking that
carries the tube there is switched off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec.structs import replace

from gateway import operations as op
from gateway.errors import Fault, Unsupported
from gateway.hub.alarm import Alarm
from gateway.hub.looks import Look, measured, sample
from gateway.hub.rates import Rates
from gateway.hub.reaction import SHORTEST, between, interval, overdue, to_stop
from gateway.mount.motion.ends import Sample
from gateway.mount.safety.stalled import StallWatch
from gateway.mount.safety.sync_sum import SyncSum
from gateway.safety import leaving, past_meridian
from gateway.spherical import separation

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: Degrees a second that no tracking reaches, though one digit of a coarse position may: somebody moves the mount.
RESTLESS = 0.1
#: A position that changes so many times faster than the mount can move was told anew: an alignment, at its keys.
JUMP = 3.0
#: How long it is watched closely after that.
CLOSELY = 3.0
#: Degrees between two looks that tell which way a motor turns the tube.
RISEN = 0.2
#: A goto that ends at a limit may overshoot by so much; so much nearer to the Sun is no jitter.
OVERSHOOT, NEARER = 0.05, 0.05
#: How long a mount may run on after it was told to end a motion: what it does meanwhile is not held against it.
COASTING = 1.0
#: How old the last position may be when a mount that moves by hand does not tell the next one, seconds.
BLIND = 1.0
#: How old the pier side may grow, and the word of the mount that it is not aligned.
SIDE_AGE = STATUS_AGE = 5.0


class Guard:
    """``look`` is called with every position, ``began`` with every motion that the mount has acknowledged."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._alarm, self._stalls = Alarm(hub.loop, self._late), StallWatch()
        self._before: Look | None = None
        self._rates, self._across = Rates(), 0.0
        self._limits = hub.policy.limits
        self._farthest: list[float] = []
        self._restless_until = self._coasts_until = self._stopped_at = -1e9
        self._switching = self._helpless = self._astray = False
        #: When the last motion was ended.
        self.rests_since = -1e9
        #: Whether the way of the goto that is being begun leads beyond an altitude limit.
        self.dips = False
        #: False from when the tube was seen to sink when it was lifted (it is beyond the pole or the zenith) to the end
        #: of the next goto.
        self.upright = True

    @property
    def restless(self) -> bool:
        """Whether the mount moves though nobody here has told it to."""
        return self._hub.now() < self._restless_until

    def began(self, operation: op.Operation) -> None:
        """A motion has begun; what was seen last is where it began, unless the mount moved already."""
        limits = self._hub.policy.limits
        if isinstance(operation, op.Goto | op.GotoHorizontal | op.Move):
            limits = limits.narrowed(operation.lowest, operation.highest)
        elif isinstance(operation, op.Park) and (self._hub.policy.own_park or not self._destined(operation)):
            limits = replace(limits, lowest=-90.0, highest=90.0)
        self._limits, self._helpless, self._coasts_until = limits, False, -1e9
        self._astray = self.dips
        told = self._hub.driver.speed(operation.rate) if isinstance(operation, op.Move | op.MoveAxis) else 0.0
        self._rates.began(self._hub.now(), told)
        if isinstance(operation, op.Sync):
            self._before, self._farthest = None, []
        elif self._before is not None and not (self._hub.moving or self.restless):
            self._before = replace(self._before, at=self._hub.now())
        if isinstance(operation, op.Move | op.MoveAxis):
            by_hand = self._hub.motions.by_hand
            if by_hand.get(operation.axis) != operation:  # else where it leads has been seen, or is feared already
                self._fear_all({**by_hand, operation.axis: operation})
        else:
            self._alarm.off()

    def arrived(self) -> None:
        """A goto is over. One that was stopped on its way has not brought the tube upright."""
        if not (self._hub.motions.ending or self._hub.motions.axes):
            self.upright = True

    def halted(self) -> None:
        """One axis was ended: if it is a goto that goes on, its way is not the one that was checked."""
        self._astray = True

    def ended(self) -> None:
        """A motion by hand was ended, or all were."""
        self._alarm.off()
        self.rests_since = self._hub.now()
        self._coasts_until = self._hub.now() + COASTING

    def _destined(self, operation: op.Operation) -> bool:
        """Whether it is known here where this goto ends."""
        return self._hub.driver.destination(operation) is not None

    # --- looking ----------------------------------------------------------------------------------------------------

    def look(self, seen: op.Equatorial) -> None:
        """Compare a position with the one before, and act."""
        hub = self._hub
        now, before = hub.now(), self._before
        if before is not None and now - before.at < SHORTEST:
            return
        self._alarm.off()
        if hub.ends.pending or hub.motions.by_hand:
            self._look_at_axes(sample(hub, now, seen))
        else:
            self._stalls.clear()
        if before is not None and before.altitude is None:  # the site may have become known since
            before = measured(hub, before.at, before.seen)
            self._farthest = list(before.suns)
        self._before = after = measured(hub, now, seen, before)
        if before is None or now < self._coasts_until or len(before.suns) != len(after.suns):
            self._farthest = list(after.suns)
            return
        status = hub.snapshot.value(op.GetStatus)
        if status is not None and not status.aligned:
            hub.transcript.note_once("mount", "not aligned: positions mean nothing yet, so no limit can be watched")
            if hub.snapshot.age(op.GetStatus, now) > STATUS_AGE:
                hub.shared(op.GetStatus())
            return
        elapsed = now - before.at
        self._across = separation(before.seen.ra, before.seen.dec, seen.ra, seen.dec) / elapsed
        if self._across > RESTLESS and not hub.moving:
            self._restless_until = now + CLOSELY
        if self._across > JUMP * hub.driver.speed(op.Rate(name="max")):
            hub.synced = SyncSum()
        self._learn(before, after, status)
        if not hub.moving and self._limits.lowest > -90.0:
            self._limits = hub.policy.limits
        reason = (
            self._altitude(before, after, elapsed)
            or self._suns(before, after, elapsed)
            or self._meridian(before, after, elapsed, status)
        )
        if reason:
            self._act(reason)

    def _look_at_axes(self, here: Sample) -> None:
        """Whether what was ended rests, and whether what was begun by hand moves."""
        hub = self._hub
        hub.ends.look(here)
        status = hub.snapshot.value(op.GetStatus)
        judged = status is not None and status.aligned and not hub.driver.stepping
        moving = hub.motions.by_hand if judged else {}
        ordered = {axis: hub.driver.speed(one.rate) for axis, one in moving.items()}
        stalled = self._stalls.look(here, ordered, hub.line.typical * hub.driver.position_reads)
        if stalled is not None:
            hub.transcript.note("mount", f"stopped: axis {stalled} was told to move, and its position shows nothing of "
                                         "it; look at the mount (a stalled motor, a cable?)")
            hub.begin_stop()

    def unseen(self) -> None:
        """The mount did not tell where it is (an LX200GPS seeking home is busy): a motion by hand ends, seen or not."""
        hub, now = self._hub, self._hub.now()
        if hub.motions.axes and hub.snapshot.age(op.Position, now) > BLIND and now - self._stopped_at > BLIND:
            hub.transcript.note("mount", "stopped: it moves and does not tell where it is")
            self._stopped_at = now
            hub.begin_stop()

    def _learn(self, before: Look, after: Look, status: op.Status | None) -> None:
        """Whether the second motor lifts the tube as it should; what tells no axis may be over the pole or zenith."""
        if after.lifting is None or after.lifting is not before.lifting or status is None:
            return
        if status.equatorial:
            rose = after.seen.dec - before.seen.dec
        else:
            rose = (after.altitude or 0.0) - (before.altitude or 0.0)
        expected = self._hub.driver.speed(after.lifting.rate) * (after.at - before.at)
        if abs(rose) > RISEN and 0.4 < abs(rose) / expected < 2.0:  # else it is something else that moved it
            self.upright = rose * after.lifting.sense > 0

    @property
    def fastest(self) -> float:
        """How fast the mount may be moving now because it was told to, degrees a second; 0 where nothing moves."""
        hub = self._hub
        if hub.slewing:
            return self._across or hub.driver.speed(op.Rate(name="max"))
        return max((hub.driver.speed(moving.rate) for moving in hub.motions.by_hand.values()), default=0.0)

    @property
    def _going(self) -> bool:
        """Whether it is a goto that moves the mount, and no hand that took over from it or ended one of its axes.

        One whose way leads beyond a limit is none that knows where it ends, either.
        """
        return self._hub.slewing and not self._hub.motions.axes and not self._astray

    @property
    def _alone(self) -> float:
        """How far one of two axes leads while the other has been ended already, degrees."""
        return self._across * between(self._hub)

    def _margin(self, rate: float, elapsed: float) -> float:
        """How far a motion gets before the next look and a stop can end it, degrees; a goto knows where it ends."""
        if self._going:
            return 0.0
        return rate * overdue(self._hub, elapsed) + self._alone

    def _fear(self, room: float, rate: float, limit: str) -> None:
        """Have it stopped so many degrees from here, unless it is seen again before."""
        if rate > RESTLESS and not self._going:
            self._alarm.within((room - self._alone) / rate - to_stop(self._hub), limit)

    def _fear_all(self, by_hand: dict[int, op.Move | op.MoveAxis]) -> None:
        """A motion by hand begins, whichever way: its first stretch has been checked, and then it must be seen."""
        hub, here, limits = self._hub, self._before, self._limits
        status = hub.snapshot.value(op.GetStatus)
        if here is None or status is None or not status.aligned:
            return
        rooms = [distance - hub.suns.limit for distance in here.suns]
        if here.altitude is not None:
            rooms += [here.altitude - limits.lowest] * (limits.lowest > -90.0)
            rooms += [limits.highest - here.altitude] * (limits.highest < 90.0)
        speed = sum(hub.driver.speed(moving.rate) for moving in by_hand.values())
        nearest = min((room for room in rooms if room > 0.0), default=180.0)
        if speed > RESTLESS:
            seconds = nearest / speed - to_stop(hub) - (hub.now() - here.at)
            self._alarm.within(max(seconds, interval(hub) + SHORTEST), "a limit")

    def _altitude(self, before: Look, after: Look, elapsed: float) -> str:
        if before.altitude is None or after.altitude is None:
            return ""
        change = after.altitude - before.altitude
        rate = self._rates.ahead("altitude", change, after.at, elapsed)
        margin = self._margin(rate, elapsed) - OVERSHOOT * self._going
        if leaving(self._limits, before.altitude, after.altitude, margin):
            return f"the altitude limit ({after.altitude:.1f} degrees)"
        if change < 0.0 and self._limits.lowest > -90.0:
            self._fear(after.altitude - self._limits.lowest, rate, "the altitude limit")
        elif change > 0.0 and self._limits.highest < 90.0:
            self._fear(self._limits.highest - after.altitude, rate, "the altitude limit")
        return ""

    def _suns(self, before: Look, after: Look, elapsed: float) -> str:
        """Nearer than the limit, and nearer than it was farthest since: a slow approach counts like a fast one."""
        limit = self._hub.suns.limit
        for number, (first, second) in enumerate(zip(before.suns, after.suns, strict=True)):
            rate = self._rates.ahead(f"sun {number}", second - first, after.at, elapsed)
            if second >= limit + self._margin(rate, elapsed):
                self._farthest[number] = second
                if second < first:
                    self._fear(second - limit, rate, "the Sun")
            elif second < self._farthest[number] - NEARER:
                self._farthest[number] = second
                return f"the Sun ({second:.0f} degrees from it)"
            else:
                self._farthest[number] = max(second, self._farthest[number])
        return ""

    def _meridian(self, before: Look, after: Look, elapsed: float, status: op.Status | None) -> str:
        """The limit of the hour angle; a mount that may be a German one and does not tell its side is not watched."""
        hub = self._hub
        limit = hub.policy.limits.hour_angle
        if limit is None or status is None or not status.equatorial or hub.slewing:
            return ""
        if before.hour_angle is None or after.hour_angle is None or hub.driver.german is None:
            return ""
        side = None
        if hub.driver.german:
            if hub.snapshot.age(op.PierSide, hub.now()) > SIDE_AGE:
                hub.spawn(hub.tube_side())
            side = hub.driver.tube_side(hub.snapshot.value(op.PierSide) or "")
            if not side:
                return ""
        first, second = past_meridian(before.hour_angle, side), past_meridian(after.hour_angle, side)
        rate = self._rates.ahead("meridian", second - first, after.at, elapsed)
        if second > first and second > limit - self._margin(rate, elapsed):
            return f"the hour angle limit ({second / 15.0:.2f} hours past the meridian)"
        if second > first:
            self._fear(limit - second, rate, "the hour angle limit")
        return ""

    # --- acting -----------------------------------------------------------------------------------------------------

    def _act(self, reason: str) -> None:
        """Stop what moves; where nobody moves the mount, it is tracking, and that goes off."""
        hub = self._hub
        if hub.moving or self.restless:
            hub.transcript.note("mount", f"stopped at {reason}")
            hub.begin_stop()
        elif not (self._switching or self._helpless):
            self._switching = True
            hub.spawn(self._tracking_off(reason))

    def _late(self, limit: str) -> None:
        """The alarm: by its last known speed the mount is about to reach a limit, and it has not been seen since."""
        if self._hub.moving or self.restless:
            self._act(f"{limit}, reckoned by its speed")

    async def _tracking_off(self, reason: str) -> None:
        hub = self._hub
        try:
            if (await hub.read(op.GetStatus())).tracking is op.Tracking.OFF:
                hub.transcript.note("mount", f"WARNING: the mount rests and comes to {reason}")
                self._helpless = True
                return
            await hub.perform(op.SetTracking(on=False))
            hub.transcript.note("mount", f"tracking is off: it came to {reason}")
        except Unsupported:
            self._helpless = True
            hub.transcript.note("mount", f"stopped at {reason}")
            hub.transcript.note_once("mount", "the tracking of this mount cannot be switched off at a limit")
            hub.begin_stop()
        except Fault as fault:
            hub.transcript.note("mount", f"tracking goes on beyond {reason}: {fault}")
        finally:
            self._switching = False
