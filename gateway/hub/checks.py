"""Before a motion: is it allowed, and in which form can this mount carry it out?

Nothing moves a mount that is held (``hold.py``). Checked are the target of every goto, park and home, the ways that
lead to it (``ways.py``), the first stretch of a motion by hand, and how far a sync moves the sky. What happens
afterwards is the guard's business (``guard.py``).
"""

from __future__ import annotations

import asyncio
from itertools import product
from math import ceil
from typing import TYPE_CHECKING

from gateway import operations as op
from gateway.errors import Fault, NearSun, NotAligned, Refused, Unsupported
from gateway.hub import ways
from gateway.hub.reaction import SHORTEST, reaction
from gateway.mount.safety.contradictions import check_contradictions
from gateway.mount.safety.sync_sum import check_sum
from gateway.mount_geometry import Pair
from gateway.paths import clear
from gateway.safety import Limits, check_altitude, check_hour_angle, check_shaft, check_sync, leaving
from gateway.spherical import fold_declination, separation, wrap180

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: A position older than that says nothing about where a motion begins.
OLD_POSITION = 6.0
#: Seconds that a sync waits for the end of a goto, and between two looks at it.
NEARLY, PAUSE = 2.5, 0.2
#: Degrees of an axis between the places of a way that are looked at.
STRIDE = 2.0


def _first(turn: Pair, stretch: float) -> Pair:
    """No more than the first degrees of either axis."""
    first, second = (max(-stretch, min(stretch, degrees)) for degrees in turn)
    return first, second


class Checks:
    """``admit`` is asked for every motion, in its turn."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    async def admit(self, operation: op.Operation) -> op.Operation:
        """An operation that the limits allow, in the form that this mount can carry out. Raises Fault."""
        hub = self._hub
        hub.hold.admit(operation)
        hub.guard.dips = False
        await self._check_aligned(operation)
        if isinstance(operation, op.Move | op.MoveAxis):
            await self._check_by_hand(operation)
        elif isinstance(operation, op.Park | op.Home):
            if isinstance(operation, op.Park):
                await hub.read(op.GetStatus())  # how the mount stands decides where it is parked
            there = hub.driver.destination(operation)
            own = isinstance(operation, op.Park) and hub.policy.own_park
            if there is not None:
                await self._check_axes(there, high_enough=own)
        elif isinstance(operation, op.GotoHorizontal):
            check_altitude(hub.policy.limits.narrowed(operation.lowest, operation.highest), operation.alt)
            fork = not (await hub.read(op.GetStatus())).equatorial
            if fork and hub.driver.way(op.GotoAxes) and not hub.driver.displaced:
                return await self.admit(op.GotoAxes(operation.az, operation.alt))
            return await self.admit(hub.derived.equatorial(operation))
        elif isinstance(operation, op.GotoAxes):
            if not hub.driver.way(op.AxisPosition) and (await hub.read(op.GetStatus())).equatorial:
                return await self.admit(hub.derived.from_axes(operation))
            await self._check_axes(operation)
        elif isinstance(operation, op.Goto):
            limits = hub.policy.limits.narrowed(operation.lowest, operation.highest)
            self._check_goto(limits, operation)
            await self._check_way(limits, op.Equatorial(operation.ra, operation.dec))
            check_contradictions(hub.sources, hub.derived.sky, limits, op.Equatorial(operation.ra, operation.dec))
            return hub.derived.to_mount(operation)
        elif isinstance(operation, op.Sync):
            await self._goto_ends()
            if hub.moving:
                raise Refused("The mount moves: nothing is centred, sync when it rests.")
            status = await hub.read(op.GetStatus())
            if status.aligned:
                here = await hub.read(op.Position())
                wanted = op.Equatorial(operation.ra, operation.dec)
                check_sync(hub.policy.limits, here, wanted)
                check_sum(hub.policy.limits.sync, hub.synced, here, wanted, status.equatorial)
            return hub.derived.to_mount(operation)
        return operation

    async def _goto_ends(self) -> None:
        """Wait a moment for the end of a goto: programs that compare positions take it for over a little too early."""
        hub = self._hub
        until = hub.now() + NEARLY
        while hub.slewing and not hub.motions.axes and hub.now() < until and await hub.anew(op.Slewing()):
            await asyncio.sleep(PAUSE)

    async def _check_aligned(self, operation: op.Operation) -> None:
        """A hand control without alignment acknowledges whatever it is told and does nothing, or moves who knows where.

        Raises NotAligned.
        """
        hub = self._hub
        by_axes = isinstance(operation, op.GotoAxes | op.GotoHorizontal | op.Park | op.Home)
        if hub.driver.sync_aligns or not (by_axes or isinstance(operation, op.Sync)):
            return
        if by_axes and hub.policy.unaligned == "allow":
            return
        status = await hub.read(op.GetStatus())
        if not status.aligned and not (await hub.anew(op.GetStatus())).aligned:  # it may be so since a moment ago
            raise NotAligned

    async def still_allowed(self) -> None:
        """Whether what moves by hand may go on. Raises BelowHorizon, TooHigh or NearSun."""
        moving = next(iter(self._hub.motions.by_hand.values()), None)
        if moving is not None:  # the other axis is looked at with it
            await self._check_by_hand(moving)

    # --- gotos ------------------------------------------------------------------------------------------------------

    def _check_goto(self, limits: Limits, operation: op.Goto) -> None:
        hub = self._hub
        seen = op.Equatorial(operation.ra, operation.dec)
        altitude = hub.derived.altitude(seen.ra, seen.dec)
        if altitude is None:
            hub.transcript.note_once("mount", "site unknown: gotos are not checked against the horizon")
            return
        check_altitude(limits, altitude)
        status = hub.snapshot.value(op.GetStatus)
        if status is not None and status.equatorial and hub.driver.tube_side("E") is None:
            check_hour_angle(limits, hub.derived.sidereal_time() - seen.ra)

    async def _check_axes(self, wanted: op.GotoAxes, high_enough: bool = False) -> None:
        """Axis readings: a place over the horizon on a fork, one on the sky on an equatorial mount whose site is known.

        ``high_enough`` is a place whose altitude is the operator's own decision.
        """
        hub = self._hub
        limits = Limits(lowest=-90.0) if high_enough else hub.policy.limits
        if not (await hub.read(op.GetStatus())).equatorial:
            check_altitude(limits, wanted.alt)
            if hub.sources.site() is not None:
                goal = hub.derived.equatorial(op.GotoHorizontal(wanted.az, wanted.alt))
                await self._check_way(limits, op.Equatorial(goal.ra, goal.dec), (wanted.az, wanted.alt))
            return
        try:
            goal = hub.derived.from_axes(wanted, wedge=not hub.driver.german)
        except Unsupported:
            hub.transcript.note_once("mount", "site unknown: axis gotos are not checked")
            return
        check_altitude(limits, hub.derived.horizon(op.Equatorial(goal.ra, goal.dec)).alt)
        if hub.driver.german:
            check_shaft(limits, wanted.az)
        else:
            check_hour_angle(limits, hub.derived.sidereal_time() - goal.ra)
        await self._check_way(limits, op.Equatorial(goal.ra, goal.dec), (wanted.az, wanted.alt))

    async def _check_way(self, limits: Limits, goal: op.Equatorial, axes: Pair | None = None) -> None:
        """Raises NearSun. ``axes`` are the readings that a fork or a German mount goes to, where they are given.

        A way out of the circle is clear as long as it comes no nearer than it begins. Before the alignment nobody knows
        where the tube is, so only the target counts. A way that leads beyond an altitude limit is begun all the same (a
        German mount seldom has another) and watched like a motion by hand, unless it does so at once: then it raises
        BelowHorizon or TooHigh.
        """
        hub = self._hub
        limit, suns = hub.suns.limit, hub.suns.up()
        if any(distance < limit for distance in hub.suns.distances(goal)):
            raise NearSun
        status = await hub.read(op.GetStatus())
        if not status.aligned or not (suns or status.equatorial or limits.highest < 90.0):
            return
        others = await self._pointing()
        here = await hub.read(op.Position())
        possible = ways.possible(hub, status.equatorial, here, goal, axes, others)
        for sun in suns:
            allowed = min(limit, separation(here.ra, here.dec, sun.ra, sun.dec) - 0.01)
            place = ways.reading(hub, sun, status.equatorial)
            if not all(clear(start, turn, place, allowed) for start, turn in possible):
                raise NearSun("The way there passes too close to the Sun.")
        forbidden = ways.circles(hub, limits, status.equatorial, True in others)
        stretch = reaction(hub) * hub.driver.speed(op.Rate(name="max"))
        for altitude, place, radius in forbidden:
            begins = ((start, _first(turn, stretch)) for start, turn in possible)
            if not any(clear(*way, place, min(radius, separation(*way[0], *place) - 0.01)) for way in begins):
                check_altitude(limits, altitude)
        hub.guard.dips = not all(clear(*way, place, radius) for _, place, radius in forbidden for way in possible)

    async def _pointing(self) -> set[bool]:
        """In which of the two ways the axes point where the mount is: the first (False), the other one, or who knows.

        The other one is the W side of the pier in the north; of a fork, over the pole or the zenith. A hand control
        that was synced there may take it for the first way, so there both count.
        """
        hub = self._hub
        site = hub.sources.site()
        if not hub.driver.german or site is None:
            return {False, not hub.driver.german and await self._over()}
        under_way = hub.slewing and await hub.anew(op.Slewing())  # then it tells the side of its goal
        side = None if under_way else await hub.tube_side()
        return {False, True} if side is None else {(side == "W") == (site.latitude >= 0.0)}

    async def _over(self) -> bool:
        """Whether the tube of a fork has been driven over the pole or the zenith, so that it points the other way."""
        if not self._hub.driver.way(op.AxisPosition):
            return not self._hub.guard.upright
        here: op.Horizontal = await self._hub.read(op.AxisPosition())
        return abs(wrap180(here.alt)) > 90.0

    # --- by hand ----------------------------------------------------------------------------------------------------

    async def _check_by_hand(self, operation: op.Move | op.MoveAxis) -> None:
        """Raises BelowHorizon, TooHigh or NearSun when a limit would be crossed before the guard can act."""
        hub = self._hub
        if hub.sources.site() is None:
            return
        # Programs switch tracking off before a slew, and nothing is known of it after that.
        status = hub.snapshot.value(op.GetStatus) or await hub.read(op.GetStatus())
        if not status.aligned:
            return
        seen, age = hub.snapshot.value(op.Position), hub.snapshot.age(op.Position, hub.now())
        if seen is None or age > OLD_POSITION:
            seen = await hub.read(op.Position())
        elif hub.now() - age < hub.guard.rests_since and not hub.motions.by_hand:  # it was seen on its way
            seen = await hub.anew(op.Position())
        limits = hub.policy.limits
        if isinstance(operation, op.Move):
            limits = limits.narrowed(operation.lowest, operation.highest)
        by_hand = {**hub.motions.by_hand, operation.axis: operation}
        turns = {axis: self._turn(moving) for axis, moving in by_hand.items()}
        try:
            for way in product(*({degrees, -degrees} for degrees in turns.values())):
                self._check_turns(limits, seen, status, dict(zip(turns, way, strict=True)))
        except Fault:  # where one way is forbidden it counts which way the motors really turn the tube
            for axis, moving in by_hand.items():
                turns[axis] *= await self._sense(moving, status)
            self._check_turns(limits, seen, status, turns)

    def _turn(self, operation: op.Move | op.MoveAxis) -> float:
        """How far an axis turns from the last position until the guard has looked and stopped it, degrees."""
        hub = self._hub
        seconds = reaction(hub) + SHORTEST + hub.snapshot.age(op.Position, hub.now()) * bool(hub.motions.by_hand)
        return operation.sense * hub.driver.speed(operation.rate) * seconds

    def _check_turns(self, limits: Limits, seen: op.Equatorial, status: op.Status, turns: dict[int, float]) -> None:
        """The whole way of so many degrees: over the zenith or past the Sun its end may be allowed again."""
        steps = max(1, ceil(max(abs(degrees) for degrees in turns.values()) / STRIDE))
        here = seen
        for step in range(1, steps + 1):
            soon = self._soon(seen, status, {axis: degrees * step / steps for axis, degrees in turns.items()})
            self._check_soon(limits, here, soon)
            here = soon

    def _check_soon(self, limits: Limits, seen: op.Equatorial, soon: op.Equatorial) -> None:
        """Raises BelowHorizon, TooHigh or NearSun when a step from here to there leads beyond a limit."""
        before, after = self._hub.derived.horizon(seen).alt, self._hub.derived.horizon(soon).alt
        if leaving(limits, before, after, 0.0):
            check_altitude(limits, after)
        for now, then in zip(self._hub.suns.distances(seen), self._hub.suns.distances(soon), strict=True):
            if then < self._hub.suns.limit and then < now:
                raise NearSun

    def _soon(self, seen: op.Equatorial, status: op.Status, turns: dict[int, float]) -> op.Equatorial:
        """Where so many degrees of the axes lead."""
        first, second = turns.get(1, 0.0), turns.get(2, 0.0)
        if status.equatorial or self._hub.driver.stepping:
            return op.Equatorial(*fold_declination(seen.ra - first, seen.dec + second))
        here = self._hub.derived.horizon(seen)
        goal = self._hub.derived.equatorial(op.GotoHorizontal(*fold_declination(here.az + first, here.alt + second)))
        return op.Equatorial(goal.ra, goal.dec)

    async def _sense(self, operation: op.Move | op.MoveAxis, status: op.Status) -> int:
        """-1 where what is positive for a motor is not so on the sky: in the south, beyond the pole or the zenith."""
        hub, by_motor = self._hub, isinstance(operation, op.MoveAxis)
        if hub.driver.stepping:
            return 1
        pole = -1 if status.equatorial and hub.derived.place().latitude < 0 else 1
        if operation.axis == 1:
            return pole if by_motor else 1
        told_directions = not hub.driver.way(op.AxisPosition)  # a Meade
        if status.equatorial and not by_motor and not told_directions:
            return 1  # the driver sees to it
        return (1 if told_directions else pole) * (-1 if await self._over() else 1)
