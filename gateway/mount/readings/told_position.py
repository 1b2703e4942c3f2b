"""What programs are told of where the mount points; everybody else goes by what the mount itself has said.

In motion a place is reckoned on to the moment at which it is told, one moment for all that is told within 50 ms, and
one for both of its angles. A reading that was asked for before the mount acknowledged the last order of motion, most of
all a stop, is not told after it: the mount is asked again.
"""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.core.motion_kinds import GOTOS
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.verification import FASTEST
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings import reckoning
from gateway.mount.readings.cache import FRESH, LAST_POSITION, MISSING, Kind
from gateway.mount.readings.reckoning import EARLIER, SOONEST, Course, Inside, Pair, Reading, course, place

#: The reads that tell where the mount points.
PLACES: tuple[Kind, ...] = (op.Position, op.HorizontalPosition, op.AxisPosition)
#: For so many seconds what was reckoned is told again.
MOMENT = EARLIER
#: An answer lives so many times as long as an exchange takes, at least.
EXCHANGES = 2.5
#: How a mount stands that has never said so: nothing is promised that it might not do.
UNKNOWN = op.Status(tracking=op.Tracking.OFF, aligned=False, equatorial=False)


class Taken(Struct, frozen=True):
    """What the mount has told, the same as a reading, and when it was asked for it."""

    value: Any
    reading: Reading
    asked: float


def at_hand(context: Context, kind: Kind) -> Any:
    """What the mount said last, when it is fresh enough; MISSING when it must be asked. The cache notes who asks."""
    if kind not in FRESH:
        known = context.site_clock.known(kind)
        return MISSING if known is None else known
    if kind is op.Slewing and context.wanted.goto_waits:
        return True
    now, link = context.now(), context.link
    value = context.cache.asked(kind, now)
    if value is not MISSING:
        return value
    return context.cache.fresh(kind, now, EXCHANGES * link.typical, link.state != "up")


class ToldPosition:
    """``tell`` answers programs; ``came`` takes readings, ``ordered`` what the mount has acknowledged.

    ``changed`` is emitted when what was told before is out of date.
    """

    def __init__(self, context: Context) -> None:
        self._context, self._driver, self._now = context, context.driver, context.now
        self._cache, self._wanted, self._movement = context.cache, context.wanted, context.movement
        self._astrometry = context.astrometry
        self.changed: Signal[None] = Signal()
        self._taken: dict[Kind, tuple[Taken | None, Taken]] = {}
        self._courses: dict[Kind, Course] = {}
        #: Places that the mount itself does not tell, and what they are worked out from.
        self._sources: dict[Kind, Kind] = {}
        self._since = self._moment = -1e9
        self._stirred = False
        #: Programs are told the last place that is known, because the mount has not answered in time.
        self.told_old = False

    # --- what comes in ----------------------------------------------------------------------------------------------

    def came(self, kind: Kind, value: Any, asked: float, at: Pair) -> None:
        """The mount itself has told a place: asked at ``asked``, its two halves true at ``at``, loop times."""
        self._sources.pop(kind, None)
        _, last = self._taken.get(kind, (None, None))
        taken = Taken(value, Reading(_pair(value), at), asked)
        if last is not None and min(at) - min(last.reading.at) < SOONEST:
            last = self._taken[kind][0]
        self._taken[kind] = last, taken
        self._courses.pop(kind, None)

    def worked_out(self, kind: Kind, source: Kind) -> None:
        """The mount does not tell this; it follows from another read."""
        self._sources[kind] = source

    def stirs(self, _: None = None) -> None:
        """Something that may set the mount moving goes to it: the next end is not the end of nothing."""
        self._stirred = True

    def ordered(self, operation: op.Operation, restless: bool) -> None:
        """The mount has acknowledged this; to be called before anything goes by it. ``restless``: it is seen to move
        though nobody here has told it to.
        """
        if isinstance(operation, op.AbortMotion | op.StopAxis | op.AbortSlew):
            if not (self._movement.anything or self._stirred or restless):
                return
            self._stirred = not isinstance(operation, op.AbortMotion) and self._movement.anything
        elif isinstance(operation, op.Move | op.MoveAxis):
            if self._wanted.by_hand.get(operation.axis) == operation:
                return  # it goes on
        elif not isinstance(operation, (*GOTOS, op.Sync)):
            return
        self.anew()

    def anew(self) -> None:
        """From now on nothing is told that the mount was asked for before."""
        self._since = self._now()
        self._courses.clear()
        self._moment = -1e9
        self.changed.emit(None)

    # --- what is told -----------------------------------------------------------------------------------------------

    def tell(self, operation: op.Operation) -> Any:
        """The answer of a read for a program, when it is at hand; MISSING when it must be waited for."""
        kind = type(operation)
        value = at_hand(self._context, kind)
        if kind not in PLACES:
            return value
        source = self.source(kind)
        if source is not None:
            seen = self.tell(source())
            return MISSING if seen is MISSING else self._worked_out(kind, seen)
        if value is MISSING or kind not in self._taken:
            return MISSING
        _, last = self._taken[kind]
        if last.asked < self._since:
            return MISSING
        return type(last.value)(*place(self._course(kind), self._told_at())) if self._movement.anything else last.value

    def last(self, kind: Kind) -> Any:
        """What was told last and may be told again although the mount has not answered; MISSING if there is nothing."""
        if kind is op.Slewing:
            return self._movement.slewing or self._wanted.goto_waits
        if kind is op.GetStatus:
            return self._cache.value(kind) or UNKNOWN
        source = self.source(kind) or (op.Position if kind is op.HorizontalPosition else None)
        if kind not in self._taken and source is not None:
            seen = self.last(source)
            return MISSING if seen is MISSING else self._worked_out(kind, seen)
        _, last = self._taken.get(kind, (None, None))
        if last is None or last.asked < self._since or self._now() - last.reading.complete > LAST_POSITION:
            return MISSING
        if not self.told_old:
            self.told_old = True
            self._context.note(
                f"the mount has not answered in time: programs are told its last position, "
                f"up to {LAST_POSITION:.0f} s old"
            )
        return type(last.value)(*place(self._course(kind), self._now())) if self._movement.anything else last.value

    def answered(self, kind: Kind) -> None:
        self.told_old = self.told_old and kind not in PLACES

    def fresh_until(self, kinds: list[Kind]) -> float:
        """The loop time until which what was just told may be told again."""
        places = [kind for kind in kinds if kind in PLACES]
        sources = [source for kind in places if (source := self.source(kind)) is not None]
        until = self._cache.until([*kinds, *sources])
        return min(until, self._moment + MOMENT) if places and self._movement.anything else until

    def _told_at(self) -> float:
        """The moment that is told; a new one makes what was told before out of date."""
        now = self._now()
        if now - self._moment >= MOMENT:
            self._moment = now
            self.changed.emit(None)
        return self._moment

    # --- how the mount goes on --------------------------------------------------------------------------------------

    def _course(self, kind: Kind) -> Course:
        """That of the last reading, worked out once."""
        if kind not in self._courses:
            before, last = self._taken[kind]
            same = before is not None and before.asked >= self._since
            self._courses[kind] = course(
                before.reading if before is not None and same else None,
                last.reading,
                fastest=FASTEST * self._driver.speed_factor,
                digit=self._driver.resolution,
                goal=self._goal(kind),
                polar=kind is not op.AxisPosition,
                inside=self._inside(kind),
            )
        return self._courses[kind]

    def _inside(self, kind: Kind) -> Inside | None:
        if kind is op.Position:
            return reckoning.on_the_sky(self._context)
        unknown = kind is op.AxisPosition and self._equatorial
        return None if unknown else reckoning.over_the_horizon(self._context)

    def _goal(self, kind: Kind) -> Pair | None:
        """Where the goto that is under way leads, as this read tells it; None where nobody here knows."""
        motion, astrometry = self._wanted.value.motion, self._astrometry
        if not isinstance(motion, Slew):
            return None
        goto = motion.operation
        axes = goto if isinstance(goto, op.GotoAxes) else self._driver.destination(goto)
        try:
            if isinstance(goto, op.Goto):
                sky = astrometry.from_mount(op.Equatorial(goto.ra, goto.dec))
            elif axes is None:
                return None
            elif kind is op.AxisPosition or (kind is op.HorizontalPosition and not self._equatorial):
                return axes.az, axes.alt
            elif self._equatorial:
                sky = astrometry.from_axes(axes, wedge=not self._driver.german)
            else:
                sky = astrometry.equatorial(axes)
            if kind is op.AxisPosition and self._equatorial:
                return None
            return _pair(sky if kind is op.Position else astrometry.horizon(sky))
        except Unsupported:
            return None

    @property
    def _equatorial(self) -> bool:
        status = self._cache.value(op.GetStatus)
        return status is not None and bool(status.equatorial)

    # --- what the mount does not tell ---------------------------------------------------------------------------------

    def source(self, kind: Kind) -> Kind | None:
        """The read that a place is worked out from; a mount that tells places in halves has no time to in motion."""
        if kind is op.HorizontalPosition and self._movement.anything and self._driver.position_reads > 1:
            return op.Position
        return self._sources.get(kind)

    def _worked_out(self, kind: Kind, seen: Any) -> Any:
        """A place by the site and the clock of this moment; MISSING where the site is unknown."""
        if isinstance(seen, op.Horizontal):
            return seen
        astrometry = self._astrometry
        try:
            if kind is op.HorizontalPosition:
                return astrometry.horizon(seen)
            return astrometry.axes(seen, wedge=not self._driver.german)
        except Unsupported:
            return MISSING


def _pair(value: Any) -> Pair:
    if isinstance(value, op.Horizontal):
        return value.az, value.alt
    return value.ra, value.dec
