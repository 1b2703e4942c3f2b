"""The positions that clients get; all other parts use the mount's own readings.

In motion a position is extrapolated to the moment of the reply, the same moment for all replies within 50 ms and for
both angles. A reading that was requested before the mount acknowledged the last motion order, above all a stop, is
outdated: the mount is asked again.
"""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.about import FIRST_RULES
from gateway.core.errors import Unsupported
from gateway.core.motion_kinds import GOTOS
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.verification import FASTEST
from gateway.mount.motion.run_on import Place
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings import extrapolation
from gateway.mount.readings.cache import LAST_POSITION, NOT_CACHED, Kind
from gateway.mount.readings.extrapolation import EARLIER, SOONEST, Course, Inside, Pair, Reading, course, place

#: The reads of a position.
POSITIONS: tuple[Kind, ...] = (op.Position, op.HorizontalPosition, op.AxisPosition)
#: Seconds for which an extrapolated position is used again.
MOMENT = EARLIER
#: A reading is fresh for this many reply times at least.
EXCHANGES = 2.5
#: The status of a mount that has never reported one, with the least promises.
UNKNOWN = op.Status(tracking=op.Tracking.OFF, aligned=False, equatorial=False)


class Reported(Struct, frozen=True):
    """A position as the mount reported it, the same as a reading, and the loop time of the request."""

    value: Any
    reading: Reading
    asked: float


def cached_reading(context: Context, kind: Kind) -> Any:
    """Return the last reading if it is fresh enough, else NOT_CACHED. The cache notes that a client polls it."""
    run_on = context.run_on.value
    if kind is op.Slewing and (context.wanted.goto_waits or (run_on is not None and run_on.goto)):
        return True
    now, link = context.now(), context.link
    value = context.cache.poll(kind, now)
    if value is not NOT_CACHED:
        return value
    return context.cache.fresh(kind, now, EXCHANGES * link.typical_rtt, link.state != "up")


class ClientReadings:
    """``peek`` answers clients; ``take`` takes readings, ``ordered`` the operations that the mount has acknowledged.

    ``changed`` is emitted when earlier answers are outdated.
    """

    def __init__(self, context: Context) -> None:
        self._context, self._driver, self._now = context, context.driver, context.now
        self._cache, self._wanted, self._movement = context.cache, context.wanted, context.movement
        self._astrometry = context.astrometry
        self.changed: Signal[None] = Signal()
        self._reported: dict[Kind, tuple[Reported | None, Reported]] = {}
        self._courses: dict[Kind, Course] = {}
        #: Positions that the mount does not report, and the reads from which they are calculated.
        self._sources: dict[Kind, Kind] = {}
        self._since = self._moment = -1e9
        self._may_move = False
        #: Clients get the last known position, because the mount has not replied in time.
        self.gives_last_position = False

    # --- input ------------------------------------------------------------------------------------------------------

    def take(self, kind: Kind, value: Any, asked: float, at: Pair) -> None:
        """Take a reported position; ``asked`` is the loop time of the request, ``at`` the times of its two angles."""
        self._sources.pop(kind, None)
        _, last = self._reported.get(kind, (None, None))
        reported = Reported(value, Reading(_pair(value), at), asked)
        if kind is op.Position and (run_on := self._context.run_on).value is not None:
            run_on.position(Place(self._now(), asked, value), self._equatorial, self._driver.resolution)
        if last is not None and min(at) - min(last.reading.at) < SOONEST:
            last = self._reported[kind][0]
        self._reported[kind] = last, reported
        self._courses.pop(kind, None)

    def latest(self) -> Place | None:
        """Return the last position that the mount has reported, however old; None before the first."""
        _, last = self._reported.get(op.Position, (None, None))
        return None if last is None else Place(last.reading.complete, last.asked, last.value)

    def calculated_from(self, kind: Kind, source: Kind) -> None:
        """Note that the mount does not report this position, and from which read it is calculated."""
        self._sources[kind] = source

    def may_move(self, _: None = None) -> None:
        """Note that a command is sent that may set the mount moving: the next end makes readings outdated."""
        self._may_move = True

    def ordered(self, operation: op.Operation, moved_by_others: bool) -> None:
        """Note an operation that the mount has acknowledged, before any other part acts on it. ``moved_by_others``: the
        position shows a motion that the gateway has not ordered.
        """
        if isinstance(operation, op.AbortMotion | op.StopAxis | op.AbortSlew):
            if not (self._movement.anything or self._may_move or moved_by_others):
                return
            self._may_move = not isinstance(operation, op.AbortMotion) and self._movement.anything
        elif isinstance(operation, op.Move | op.MoveAxis):
            if self._wanted.by_hand.get(operation.axis) == operation:
                return  # the same motion continues
        elif not isinstance(operation, (*GOTOS, op.Sync)):
            return
        self.outdate()

    def outdate(self) -> None:
        """Treat readings that were requested before now as outdated."""
        self._since = self._now()
        self._courses.clear()
        self._moment = -1e9
        self.changed.emit(None)

    # --- answers ----------------------------------------------------------------------------------------------------

    def peek(self, operation: op.Operation) -> Any:
        """Return the answer to a client's read if it is cached; NOT_CACHED if it must be requested."""
        kind = type(operation)
        value = cached_reading(self._context, kind)
        if kind not in POSITIONS:
            return value
        source = self.source(kind)
        if source is not None:
            position = self.peek(source())
            return NOT_CACHED if position is NOT_CACHED else self._calculate(kind, position)
        if value is NOT_CACHED or kind not in self._reported:
            return NOT_CACHED
        _, last = self._reported[kind]
        if last.asked < self._since:
            return NOT_CACHED
        return type(last.value)(*place(self._course(kind), self._instant())) if self._moves else last.value

    def last(self, kind: Kind) -> Any:
        """Return the last answer that a client may get although the mount has not replied; NOT_CACHED if none."""
        if kind is op.Slewing:
            return self._movement.slewing or self._wanted.goto_waits or self._context.run_on.of_goto
        if kind is op.GetStatus:
            return self._cache.value(kind) or UNKNOWN
        source = self.source(kind) or (op.Position if kind is op.HorizontalPosition else None)
        if kind not in self._reported and source is not None:
            position = self.last(source)
            return NOT_CACHED if position is NOT_CACHED else self._calculate(kind, position)
        _, last = self._reported.get(kind, (None, None))
        if last is None or last.asked < self._since or self._now() - last.reading.complete > LAST_POSITION:
            return NOT_CACHED
        if not self.gives_last_position:
            self.gives_last_position = True
            self._context.note(
                f"the mount has not replied in time: programs get its last position, up to {LAST_POSITION:.0f} s old"
            )
        return type(last.value)(*place(self._course(kind), self._now())) if self._moves else last.value

    def answered(self, kind: Kind) -> None:
        self.gives_last_position = self.gives_last_position and kind not in POSITIONS

    def fresh_until(self, kinds: list[Kind]) -> float:
        """Return the loop time until which the answers just given may be given again."""
        positions = [kind for kind in kinds if kind in POSITIONS]
        sources = [source for kind in positions if (source := self.source(kind)) is not None]
        until = self._cache.until([*kinds, *sources])
        return min(until, self._moment + MOMENT) if positions and self._moves else until

    def _instant(self) -> float:
        """Return the moment to which positions are extrapolated; a new one makes earlier answers outdated."""
        now = self._now()
        if now - self._moment >= MOMENT:
            self._moment = now
            self.changed.emit(None)
        return self._moment

    @property
    def _moves(self) -> bool:
        others = self._context.policy.rules > FIRST_RULES and self._now() < self._movement.by_others_until
        return self._movement.anything or others

    # --- extrapolation ----------------------------------------------------------------------------------------------

    def _course(self, kind: Kind) -> Course:
        """Return the course after the last reading, calculated once."""
        if kind not in self._courses:
            before, last = self._reported[kind]
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
            return extrapolation.on_the_sky(self._context)
        unknown = kind is op.AxisPosition and self._equatorial
        return None if unknown else extrapolation.over_the_horizon(self._context)

    def _goal(self, kind: Kind) -> Pair | None:
        """Return the goal of the goto under way in the coordinates of this read; None if it is unknown."""
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

    # --- positions that the mount does not report ---------------------------------------------------------------------

    def source(self, kind: Kind) -> Kind | None:
        """Return the read from which a position is calculated; None if the mount reports it. In motion, a mount that
        takes two requests per position reports only one kind.
        """
        if kind is op.HorizontalPosition and self._movement.anything and self._driver.position_reads > 1:
            return op.Position
        return self._sources.get(kind)

    def _calculate(self, kind: Kind, position: Any) -> Any:
        """Calculate a position by the present site and clock; NOT_CACHED if the site is unknown."""
        if isinstance(position, op.Horizontal):
            return position
        astrometry = self._astrometry
        try:
            if kind is op.HorizontalPosition:
                return astrometry.horizon(position)
            return astrometry.axes(position, wedge=not self._driver.german)
        except Unsupported:
            return NOT_CACHED


def _pair(value: Any) -> Pair:
    if isinstance(value, op.Horizontal):
        return value.az, value.alt
    return value.ra, value.dec
