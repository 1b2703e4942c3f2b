"""What programs are told of where the mount points; everybody else goes by what the mount itself has said.

In motion a place is reckoned on to the moment at which it is told, one moment for all that is told within 50 ms, and
one for both of its angles. A reading that was asked for before the mount acknowledged the last order of motion, most of
all a stop, is not told after it: the mount is asked again.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, NoAnswer, Unsupported
from gateway.core.motion_kinds import GOTOS
from gateway.mount.link.verification import FASTEST
from gateway.mount.motion.wanted import Slew
from gateway.mount.readings import target_limits
from gateway.mount.readings.cache import LAST_POSITION, MISSING, Kind
from gateway.mount.readings.reckoning import EARLIER, SOONEST, Course, Inside, Pair, Reading, course, place

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: The reads that tell where the mount points.
PLACES: tuple[Kind, ...] = (op.Position, op.HorizontalPosition, op.AxisPosition)
#: For so many seconds what was reckoned is told again.
MOMENT = EARLIER
#: How often the mount is asked again while orders come faster than it can tell what came of them.
TRIES = 3
#: Seconds that an answer is waited for where the last one may stand in for it: in motion, which makes it old, as long
#: as a reply may take.
WAITS, WAITS_MOVING = 2.5, 3.2
#: How a mount stands that has never said so: nothing is promised that it might not do.
UNKNOWN = op.Status(tracking=op.Tracking.OFF, aligned=False, equatorial=False)


class Taken(Struct, frozen=True):
    """What the mount has told, the same as a reading, and when it was asked for it."""

    value: Any
    reading: Reading
    asked: float


class Telling:
    """``tell`` and ``read`` answer programs; ``came`` takes readings, ``ordered`` what the mount has acknowledged."""

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
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

    def stirs(self) -> None:
        """Something that may set the mount moving goes to it: the next end is not the end of nothing."""
        self._stirred = True

    def ordered(self, operation: op.Operation) -> None:
        """The mount has acknowledged this; to be called before the controller goes by it."""
        controller = self._controller
        if isinstance(operation, op.Stop | op.Halt | op.CancelGoto):
            if not (controller.moving or self._stirred or controller.guard.restless):
                return
            self._stirred = not isinstance(operation, op.Stop) and controller.moving
        elif isinstance(operation, op.Move | op.MoveAxis):
            if controller.motions.by_hand.get(operation.axis) == operation:
                return  # it goes on
        elif not isinstance(operation, (*GOTOS, op.Sync)):
            return
        self.anew()

    def anew(self) -> None:
        """From now on nothing is told that the mount was asked for before."""
        self._since = self._controller.now()
        self._controller.snapshot.version += 1
        self._courses.clear()
        self._moment = -1e9

    # --- what is told -----------------------------------------------------------------------------------------------

    def tell(self, operation: op.Operation) -> Any:
        """The answer of a read for a program, when it is at hand; MISSING when it must be waited for."""
        controller, kind = self._controller, type(operation)
        value = controller.at_hand(operation)
        if kind not in PLACES:
            return value
        source = self._source(kind)
        if source is not None:
            seen = self.tell(source())
            return MISSING if seen is MISSING else self._worked_out(kind, seen)
        if value is MISSING or kind not in self._taken:
            return MISSING
        _, last = self._taken[kind]
        if last.asked < self._since:
            return MISSING
        return type(last.value)(*place(self._course(kind), self._now())) if controller.moving else last.value

    async def read(self, operation: op.Operation) -> Any:
        """The same, waiting for the mount where that is needed; in place of an answer that does not come the last one.

        A state that nobody knows is told as it does no harm. Raises Fault where there is nothing to tell.
        """
        fault: Fault
        try:
            async with asyncio.timeout(WAITS_MOVING if self._controller.moving else WAITS):
                answer = await self._read(operation)
        except Asleep:
            raise
        except (NoAnswer, Busy) as said:
            fault = said
        except TimeoutError:
            fault = NoAnswer()
        else:
            self.told_old = self.told_old and type(operation) not in PLACES
            return answer
        last = self._last(type(operation))
        if last is MISSING:
            raise fault
        return last

    def _last(self, kind: Kind) -> Any:
        """What was told last and may be told again although the mount has not answered; MISSING if there is nothing."""
        controller = self._controller
        if kind is op.Slewing:
            return controller.slewing or controller.motions.goto_waits
        if kind is op.GetStatus:
            return controller.snapshot.value(kind) or UNKNOWN
        source = self._source(kind) or (op.Position if kind is op.HorizontalPosition else None)
        if kind not in self._taken and source is not None:
            seen = self._last(source)
            return MISSING if seen is MISSING else self._worked_out(kind, seen)
        _, last = self._taken.get(kind, (None, None))
        if last is None or last.asked < self._since or controller.now() - last.reading.complete > LAST_POSITION:
            return MISSING
        if not self.told_old:
            self.told_old = True
            controller.transcript.note(
                "mount",
                f"the mount has not answered in time: programs are told its last position, "
                f"up to {LAST_POSITION:.0f} s old",
            )
        return type(last.value)(*place(self._course(kind), controller.now())) if controller.moving else last.value

    async def _read(self, operation: op.Operation) -> Any:
        """The mount's answer, at hand or waited for. Raises Fault."""
        controller, kind = self._controller, type(operation)
        value = self.tell(operation)
        for _ in range(TRIES):
            if value is MISSING and (source := self._source(kind)) is not None:
                await self.read(source())
                value = self.tell(operation)
            if value is not MISSING:
                return value
            asked = await controller.asked(operation)
            if kind not in PLACES:
                return asked
            value = self.tell(operation)
        return asked if value is MISSING else value

    def fresh_until(self, kinds: list[Kind]) -> float:
        """The loop time until which what was just told may be told again."""
        places = [kind for kind in kinds if kind in PLACES]
        sources = [source for kind in places if (source := self._source(kind)) is not None]
        until = self._controller.snapshot.until([*kinds, *sources])
        return min(until, self._moment + MOMENT) if places and self._controller.moving else until

    def _now(self) -> float:
        """The moment that is told; a new one makes what was told before out of date."""
        now = self._controller.now()
        if now - self._moment >= MOMENT:
            self._moment = now
            self._controller.snapshot.version += 1
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
                fastest=FASTEST * self._controller.driver.hurry,
                digit=self._controller.driver.resolution,
                goal=self._goal(kind),
                polar=kind is not op.AxisPosition,
                inside=self._inside(kind),
            )
        return self._courses[kind]

    def _inside(self, kind: Kind) -> Inside | None:
        limits = target_limits.limits_of(self._controller)
        if kind is op.Position:
            return target_limits.on_the_sky(self._controller, limits)
        return None if kind is op.AxisPosition and self._equatorial else target_limits.over_the_horizon(limits)

    def _goal(self, kind: Kind) -> Pair | None:
        """Where the goto that is under way leads, as this read tells it; None where nobody here knows."""
        controller, motion = self._controller, self._controller.motions.wanted.motion
        if not isinstance(motion, Slew):
            return None
        goto = motion.operation
        axes = goto if isinstance(goto, op.GotoAxes) else controller.driver.destination(goto)
        try:
            if isinstance(goto, op.Goto):
                sky = controller.derived.from_mount(op.Equatorial(goto.ra, goto.dec))
            elif axes is None:
                return None
            elif kind is op.AxisPosition or (kind is op.HorizontalPosition and not self._equatorial):
                return axes.az, axes.alt
            elif self._equatorial:
                sky = op.Equatorial(*_pair(controller.derived.from_axes(axes, wedge=not controller.driver.german)))
            else:
                sky = op.Equatorial(*_pair(controller.derived.equatorial(op.GotoHorizontal(axes.az, axes.alt))))
            if kind is op.AxisPosition and self._equatorial:
                return None
            return _pair(sky if kind is op.Position else controller.derived.horizon(sky))
        except Unsupported:
            return None

    @property
    def _equatorial(self) -> bool:
        status = self._controller.snapshot.value(op.GetStatus)
        return status is not None and bool(status.equatorial)

    # --- what the mount does not tell ---------------------------------------------------------------------------------

    def _source(self, kind: Kind) -> Kind | None:
        """The read that a place is worked out from; a mount that tells places in halves has no time to in motion."""
        if kind is op.HorizontalPosition and self._controller.moving and self._controller.driver.position_reads > 1:
            return op.Position
        return self._sources.get(kind)

    def _worked_out(self, kind: Kind, seen: Any) -> Any:
        """A place by the site and the clock of this moment; MISSING where the site is unknown."""
        if isinstance(seen, op.Horizontal):
            return seen
        derived = self._controller.derived
        try:
            if kind is op.HorizontalPosition:
                return derived.horizon(seen)
            return derived.axes(seen, wedge=not self._controller.driver.german)
        except Unsupported:
            return MISSING


def _pair(value: Any) -> Pair:
    if isinstance(value, op.Horizontal | op.GotoAxes):
        return value.az, value.alt
    return value.ra, value.dec
