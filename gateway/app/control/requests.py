"""Carries out requests from the command line, under the same limits and rules as the commands of programs.

A motion belongs to the request that began it: cancelling the request ends that motion, and no other that a program or
another request has begun since. A timer here ends a ``move``, even if the command that asked for it was killed.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from gateway.app.control import commands
from gateway.app.control.gather import gather
from gateway.app.control.refusals import no
from gateway.app.status import State, on_the_sky
from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, Invalid, Stopped
from gateway.mount.controller import MountController
from gateway.mount.motion.wanted import ByHand, Slew
from gateway.mount.presence import HostActivity
from gateway.mount.readings.reader import missed

#: The first word of an answer: carried out, still in progress, not carried out.
DONE, UNDER_WAY, FAILED = "done", "under way", "failed"
#: A motion that could not be begun within so many seconds is dropped: the command does not wait longer.
PATIENCE = 10.0
#: Seconds for fresh readings of the mount, before cached ones are shown.
SIGHT = 1.5
#: So many requests are remembered, the newest.
REMEMBERED = 64


class Begun:
    """A request that was begun: its activity as a client, the number of stops then, its goal, and its cancellation."""

    def __init__(self, life: HostActivity, stops: int) -> None:
        self.life, self.stops = life, stops
        self.goal: op.Equatorial | None = None
        self.parks = False
        self.ended = asyncio.Event()
        #: Direction and rate key of the motion by hand that ``Press`` began.
        self.pressed: tuple[op.Direction, int] | None = None


async def of_date(controller: MountController, where: commands.Where) -> op.Equatorial:
    """Return the position of a target for the equinox of date, in degrees. Raises Fault."""
    if isinstance(where, commands.Body):
        reads: op.Read[op.Equatorial] = op.MoonPlace() if where.name.lower() == "moon" else op.PlanetPlace(where.name)
    elif not (-90.0 <= where.dec <= 90.0 and 0.0 <= where.ra <= 360.0):
        raise Invalid("There is no such place on the sky.")
    elif where.j2000:
        reads = op.ToEquinoxOfDate(where.ra % 360.0, where.dec)
    else:
        return op.Equatorial(where.ra % 360.0, where.dec)
    return await controller.perform(reads)


class Desk:
    """Carries out requests. ``programs`` returns the hosts of connected programs; ``name``: the mount's, or empty."""

    def __init__(
        self, controller: MountController, name: str, mount: str, programs: Callable[[], Sequence[str]]
    ) -> None:
        self._controller, self._name, self._mount, self._programs = controller, name, mount, programs
        self._begun: dict[str, Begun] = {}

    def state(self) -> State:
        """Return what is known of the mount, without asking it."""
        return gather(self._controller, self._name, self._mount, self._programs())

    async def carry_out(self, line: str) -> str:
        """Return ``done WORDS``, ``under way WORDS`` or ``failed REASON``; for ``See`` a ``State`` as JSON."""
        try:
            wish = commands.read(line)
        except ValueError:
            return f"{FAILED} the gateway does not understand this: it is of another version than the command"
        if isinstance(wish, commands.See):
            await self._look()
            return msgspec.json.encode(self.state()).decode()
        if isinstance(wish, commands.Follow):
            return await self._follow(wish.number)
        if isinstance(wish, commands.End):
            return await self._end(wish.number)
        begun = self._remember(wish.number, wish.who or f"mount-gateway {type(wish).__name__.lower()}")
        try:
            return f"{DONE} {await self._do(wish, begun)}"
        except Fault as fault:
            controller = self._controller
            controller.wire_log.refused(begun.life.who, f"{type(wish).__name__}: {fault}")
            return f"{FAILED} {no(fault, controller.policy.limits)}"

    def _remember(self, number: str, who: str) -> Begun:
        begun, presence = self._begun.get(number), self._controller.presence
        if begun is None:
            begun = self._begun[number] = Begun(presence.arrive(who), self._controller.stops)
            if len(self._begun) > REMEMBERED:
                presence.leave(self._begun.pop(next(iter(self._begun))).life)
        return begun

    # --- carrying out -----------------------------------------------------------------------------------------------

    async def _do(self, wish: Any, begun: Begun) -> str:
        match wish:
            case commands.Goto():
                begun.goal = await of_date(self._controller, wish.where)
                await self._order(op.Goto(begun.goal.ra, begun.goal.dec), begun)
                return f"it goes to {on_the_sky(begun.goal)}"
            case commands.Sync():
                goal = await of_date(self._controller, wish.where)
                await self._order(op.Sync(goal.ra, goal.dec), begun)
                return f"it points to {on_the_sky(goal)} from now on"
            case commands.Park():
                begun.parks = True
                await self._order(op.Park(), begun)
                return "it goes to its park position"
            case commands.Home():
                await self._order(op.Home(), begun)
                return "it goes to its home position"
            case commands.Press():
                return await self._press(wish, begun)
            case commands.LetGo():
                return await self._let_go(begun)
            case commands.Track():
                return await self._track(wish, begun)
            case commands.TellTime():
                await self._controller.perform(op.SetClock(wish.unix, wish.offset))
                return "the time is set"
            case commands.TellSite():
                await self._controller.perform(op.SetSite(wish.latitude, wish.longitude))
                return "the site is set"
            case commands.Unpark():
                await self._order(op.Wake() if self._controller.driver.asleep else op.Unpark(), begun)
                return "it is in service again, and tracks"
        return await self._move(wish, begun)

    async def _order(self, operation: op.Operation, begun: Begun) -> None:
        """Perform an operation for a request. Raises Fault."""
        if begun.ended.is_set():
            raise Busy("It was cancelled.")
        try:
            async with asyncio.timeout(PATIENCE + 1.0):
                await self._controller.perform(operation, begun.stops, begun.life, PATIENCE)
        except TimeoutError:
            raise Busy from None

    async def _move(self, wish: commands.Move, begun: Begun) -> str:
        """Begin a motion by hand, wait, and end it. Raises Fault."""
        controller, longest = self._controller, self._controller.policy.silence
        if not 0.0 < wish.seconds <= longest or not 1 <= wish.key <= 9:
            raise Invalid(f"An arrow may be pressed for up to {longest:g} s (--dead-man) at a rate of 1 to 9.")
        operation = op.Move(wish.direction, op.Rate(key=wish.key))
        try:
            await self._order(operation, begun)
            since = controller.now()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(wish.seconds):
                    await begun.ended.wait()
            lasted, stopped = controller.now() - since, begun.stops != controller.stops
        finally:
            if self._moves(begun):
                await controller.perform(op.StopAxis(operation.axis), None, begun.life)
        if stopped:
            raise Stopped
        return f"it was moved {wish.direction.word} for {lasted:.1f} s"

    async def _press(self, wish: commands.Press, begun: Begun) -> str:
        """Begin a motion by hand, or keep it alive. Raises Fault."""
        if not 1 <= wish.key <= 9:
            raise Invalid("Rates are from 1 to 9.")
        begun.life.heard = True
        if begun.stops != self._controller.stops:
            raise Stopped
        if begun.pressed == (wish.direction, wish.key):
            return f"it is moved {wish.direction.word}"
        begun.pressed = wish.direction, wish.key
        await self._order(op.Move(wish.direction, op.Rate(key=wish.key)), begun)
        return f"it is moved {wish.direction.word}"

    async def _let_go(self, begun: Begun) -> str:
        """End the motion that ``Press`` began. Raises Fault."""
        begun.ended.set()
        if begun.pressed is not None and self._moves(begun):
            await self._controller.perform(op.StopAxis(begun.pressed[0].axis), None, begun.life)
        return "let go"

    async def _track(self, wish: commands.Track, begun: Begun) -> str:
        """Set the tracking rate if one is given, and turn tracking on or off. Raises Fault."""
        if wish.rate is not None:
            await self._order(op.TrackRate(wish.rate), begun)
        await self._order(op.SetTracking(wish.on), begun)
        return f"tracking is {'on' if wish.on else 'off'}"

    # --- how it goes ------------------------------------------------------------------------------------------------

    def _moves(self, begun: Begun) -> bool:
        """Whether a motion that this request has begun is in progress or waits to begin."""
        wanted = self._controller.wanted.value
        moving = [wanted.motion.by] if isinstance(wanted.motion, Slew) else []
        if isinstance(wanted.motion, ByHand):
            moving = [motion.by for _, motion in wanted.motion]
        return any(by is begun.life for by in (*moving, *(order.by for order in wanted.pending)))

    async def _follow(self, number: str) -> str:
        begun, controller = self._begun.get(number), self._controller
        if begun is None:
            return f"{FAILED} the gateway does not know this request: it may have been restarted meanwhile"
        await self._look()
        seen = self.state().look
        follows = begun.parks and any(
            order.follow_up for order in controller.wanted.value.pending
        )  # after parking, its tracking is still to be turned off
        if self._moves(begun) or follows:
            return f"{UNDER_WAY} {on_the_sky(seen.position) if seen.position else ''}"
        if controller.stops != begun.stops:
            return f"{FAILED} it was stopped on the way"
        if begun.goal is not None and seen.position is not None and (words := missed(begun.goal, seen.position)):
            return f"{FAILED} {words}, or another goto came"
        if begun.parks:
            return f"{DONE} it is parked"
        return f"{DONE} it is there{': ' + on_the_sky(seen.position) if seen.position else ''}"

    async def _end(self, number: str) -> str:
        controller, begun = self._controller, self._remember(number, "mount-gateway stop")
        begun.ended.set()  # if the request arrives later than its cancellation, it is not begun
        if not self._moves(begun):
            return f"{DONE} nothing that was begun here is under way"
        wanted = controller.wanted.value
        halts: list[op.Operation] = (
            [op.StopAxis(axis) for axis, motion in wanted.motion if motion.by is begun.life]
            if isinstance(wanted.motion, ByHand)
            else []
        )
        if not halts and all(order.by is begun.life for order in wanted.waiting_gotos):  # else another goto replaces it
            halts = [op.AbortSlew()]
        try:
            for halt in halts:
                await controller.perform(halt, None, begun.life)
        except Fault as fault:
            return f"{FAILED} the mount has not acknowledged the stop: {no(fault, controller.policy.limits)}"
        return f"{DONE} the mount was stopped"

    async def _look(self) -> None:
        """Refresh position and status, unless the mount does not answer soon."""
        controller = self._controller
        if controller.line.state != "up" or controller.driver.asleep:
            return
        with contextlib.suppress(Fault, TimeoutError):
            async with asyncio.timeout(SIGHT):
                for read in (op.Position(), op.Slewing(), op.GetStatus()):
                    await controller.perform(read)
