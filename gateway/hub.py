"""The hub: the one owner of a mount.

Reads are answered from a snapshot while it is fresh and share one exchange when it is not; while any client polls, the
snapshot is refreshed in the background, so a hundred pollers cost the mount's line what one costs. Motions run one
after the other; a stop ends whatever runs or waits and goes to the line before everything else.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from msgspec import Struct

from gateway import operations as op
from gateway.driver import Ask, Driver, Later, Pause, Steps
from gateway.errors import Fault, NoAnswer, NotAligned, Stopped, Unsupported
from gateway.line import MOTION, POSITION, READ, SETTING, STOP, Line
from gateway.observatory import Observatory
from gateway.safety import Limits, check_altitude, check_sync, leaving
from gateway.sky import Sky
from gateway.transcript import Transcript

#: Nothing yet, or no longer fresh: the answer must be waited for.
MISSING = object()
#: How old an answer may be (seconds), and how often it is renewed while clients ask for it.
FRESH = {op.Position: 0.5, op.HorizontalPosition: 0.5, op.AxisPosition: 0.5, op.Slewing: 1.0, op.GetStatus: 6.0,
         op.GetIdentity: 1e9, op.PierSide: 5.0}
RENEW = {op.Position: 0.4, op.HorizontalPosition: 0.45, op.AxisPosition: 0.45, op.Slewing: 0.5, op.GetStatus: 2.5}
#: A client that asked within this time is still polling.
POLLING = 3.0
HEARTBEAT = 5.0
#: The last position is still told this long after the line went down; before the first one a client waits this long.
LAST_POSITION = 10.0
FIRST_ANSWER = 2.0
HALF_SITE = 2.0
CLOCK_AGE = 120.0
_MOTIONS = (op.Goto, op.GotoHorizontal, op.GotoAxes, op.Sync, op.Move, op.Halt, op.Pulse, op.SetTracking, op.TrackRate,
            op.Park, op.Home, op.SetHome, op.Unpark, op.Sleep, op.Wake, op.Focus)
_READS = (op.Position, op.HorizontalPosition, op.AxisPosition, op.Slewing, op.GetStatus, op.GetIdentity, op.PierSide)


class Policy(Struct, frozen=True):
    """What the operator has decided for a mount."""

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str = "jnow"


class Seen(Struct):
    """An answer of the mount and when it came."""

    value: Any
    at: float


class Hub:
    """``perform`` carries out any operation; ``peek`` answers a read at once when that needs no exchange."""

    def __init__(self, driver: Driver, follow_ups: dict[type[Any], Callable[[Any, Any], Any]], line: Line, sky: Sky,
                 observatory: Observatory, transcript: Transcript, policy: Policy = Policy()) -> None:
        self.driver, self.line, self.sky, self.observatory = driver, line, sky, observatory
        self.transcript, self.policy = transcript, policy
        self.follow_ups = follow_ups
        self.loop = asyncio.get_running_loop()
        self.now = self.loop.time
        #: Grows whenever an answer changes; what was made from older answers is then out of date.
        self.version = 0
        self.stops = 0
        self.identified = asyncio.Event()
        self.lost_at: float | None = None
        self._seen: dict[type[op.Operation], Seen] = {}
        self._asked: dict[type[op.Operation], float] = {}
        self._sharing: dict[type[op.Operation], asyncio.Task[Any]] = {}
        self._motion = asyncio.Lock()
        self._jobs: dict[asyncio.Task[Any], op.Operation] = {}
        self._later: dict[op.Operation, asyncio.TimerHandle] = {}
        self._tasks: set[asyncio.Task[Any]] = set()
        self._moving: set[int] = set()
        self._altitude: float | None = None
        line.on_up = self._on_up

    # --- life -----------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Open the line, find out what is on it, and keep the snapshot fresh."""
        self.line.start()
        self.spawn(self._refresh())

    async def close(self) -> None:
        """End motion, forget what was planned, close the line."""
        try:
            async with asyncio.timeout(4.0):
                if self.moving and self.line.state == "up":
                    await self.stop()
        except (TimeoutError, Fault):
            self.transcript.note("mount", "the stop at shutdown was not answered")
        for handle in self._later.values():
            handle.cancel()
        for task in [*self._tasks, *self._jobs, *self._sharing.values()]:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.line.close()

    def spawn(self, work: Any) -> asyncio.Task[Any]:
        """Run something in the background and hold on to it."""
        task = self.loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _on_up(self) -> None:
        self._seen.clear()
        self.version += 1
        self.spawn(self._identify())

    async def _identify(self) -> None:
        """Who is there, where it stands, what time it has."""
        for operation in (op.GetIdentity(), op.GetSite(), op.GetClock()):
            try:
                value = await self._run(self.driver.perform(operation), READ)
            except NoAnswer:
                return
            except Fault as fault:
                self.transcript.note("mount", str(fault))
                continue
            self._learn(operation, value)
        self.identified.set()

    def _learn(self, operation: op.Operation, value: Any) -> None:
        if isinstance(value, op.Place):
            self.observatory.mount_says_site(value)
        elif isinstance(value, op.Moment):
            self.observatory.mount_says_clock(value)
        self._seen[type(operation)] = Seen(value, self.now())
        self.version += 1

    # --- asking ---------------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        """Whether anything moves that a stop should end."""
        return bool(self._moving) or self.slewing

    @property
    def slewing(self) -> bool:
        seen = self._seen.get(op.Slewing)
        return seen is not None and bool(seen.value)

    def peek(self, operation: op.Operation) -> Any:
        """The answer of a read, when it is at hand; MISSING when it must be waited for."""
        kind = type(operation)
        if kind in FRESH:
            now = self._asked[kind] = self.now()
            seen = self._seen.get(kind)
            if seen is not None and now - seen.at <= max(FRESH[kind], 2.5 * self.line.typical):
                return seen.value
            if self.line.state == "down" and seen is not None and now - seen.at <= LAST_POSITION:
                return seen.value
            return MISSING
        if kind is op.GetSite:
            place = self.observatory.site()
            return MISSING if place is None else place
        if kind is op.GetClock:
            moment = self.observatory.clock()
            return MISSING if moment is None else moment
        return MISSING

    def touch(self, now: float) -> None:
        """A client was served a repeated reply: it is polling the position all the same."""
        self._asked[op.Position] = now

    def fresh_until(self, kinds: list[type[op.Operation]]) -> float:
        """The loop time until which the answers of these reads may be told."""
        return min(self._seen[kind].at + FRESH[kind] for kind in kinds)

    async def perform(self, operation: op.Operation, stops: int | None = None) -> Any:
        """Carry out an operation. ``stops`` is the count of stops when it was asked for. Raises Fault."""
        if isinstance(operation, _READS):
            return await self._read(operation)
        if isinstance(operation, op.Stop):
            return await self.stop()
        if isinstance(operation, _MOTIONS):
            return await self._motion_job(operation, self.stops if stops is None else stops)
        handler = self._HANDLERS.get(type(operation))
        if handler is not None:
            return await handler(self, operation)
        return await self._run(self.driver.perform(operation), SETTING)

    async def _read(self, operation: op.Operation) -> Any:
        """A read that the snapshot cannot answer: everyone who asks shares one exchange."""
        value = self.peek(operation)
        if value is not MISSING:
            return value
        kind = type(operation)
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = self.loop.create_task(self._ask(operation))
            task.add_done_callback(lambda done: self._shared(kind, done))
        if kind in self._seen:
            return await asyncio.shield(task)
        try:
            async with asyncio.timeout(FIRST_ANSWER):
                return await asyncio.shield(task)
        except TimeoutError:
            raise NoAnswer from None

    def _shared(self, kind: type[op.Operation], task: asyncio.Task[Any]) -> None:
        self._sharing.pop(kind, None)
        if not task.cancelled():
            task.exception()  # whoever still waits gets it; nobody waiting is no error

    async def _ask(self, operation: op.Operation) -> Any:
        if not self.identified.is_set():
            await self.identified.wait()
        rank = POSITION if isinstance(operation, op.Position) else READ
        value = await self._run(self.driver.perform(operation), rank)
        if isinstance(operation, op.Slewing) and self.slewing and not value:
            await self._settled()
        if isinstance(operation, op.HorizontalPosition) and value is None:
            value = await self._derived_horizon()
        if isinstance(operation, op.Position) and self.policy.equinox == "j2000":
            value = op.Equatorial(*self.sky.to_of_date(value.ra, value.dec, self.observatory.unix()))
        self._learn(operation, value)
        return value

    async def _settled(self) -> None:
        """A goto has just ended: nobody is told so before the position is known where it ended."""
        self._seen.pop(op.HorizontalPosition, None)
        self._seen.pop(op.Position, None)
        await self._read(op.Position())

    async def _derived_horizon(self) -> op.Horizontal:
        """Azimuth and altitude from right ascension, declination, site and clock."""
        place = self.observatory.site()
        if place is None:
            raise Unsupported("The site is not known.")
        seen = await self._read(op.Position())
        return op.Horizontal(*self.sky.horizon(seen.ra, seen.dec, place.latitude, place.longitude,
                                               self.observatory.unix()))

    async def _run(self, steps: Steps, rank: int) -> Any:
        """Drive a driver's generator: exchanges, pauses, things to do later."""
        answer: Any = None
        fault: Fault | None = None
        try:
            while True:
                step = steps.send(answer) if fault is None else steps.throw(fault)
                answer, fault = None, None
                if isinstance(step, Ask):
                    try:
                        answer = await self.line.exchange(step, rank)
                    except Fault as error:
                        fault = error
                elif isinstance(step, Pause):
                    await asyncio.sleep(step.seconds)
                else:
                    self._plan(step)
        except StopIteration as end:
            return end.value
        finally:
            steps.close()

    def _plan(self, later: Later) -> None:
        """Have a follow-up performed after some seconds; the same one planned again replaces the first."""
        old = self._later.pop(later.operation, None)
        if old is not None:
            old.cancel()
        if later.urgent:
            self.line.expect_urgent(self.now() + later.seconds)
        self._later[later.operation] = self.loop.call_later(
            later.seconds, lambda: self.spawn(self._follow_up(later.operation, later.urgent))
        )

    async def _follow_up(self, operation: op.Operation, urgent: bool) -> None:
        self._later.pop(operation, None)
        special = self.follow_ups.get(type(operation))
        steps = special(self.driver, operation) if special else self.driver.perform(operation)
        try:
            async with self._motion:
                await self._run(steps, STOP if urgent else MOTION)
        except Fault as fault:
            self.transcript.note("mount", f"{type(operation).__name__}: {fault}")

    # --- moving ---------------------------------------------------------------------------------------------------

    async def stop(self) -> None:
        """End every motion: what runs or waits dies, and the stop goes to the line first."""
        self.stops += 1
        for task in list(self._jobs):
            task.cancel()
        for later in list(self._later):
            if type(later) not in (op.Unpark,):
                self._later.pop(later).cancel()
        self._moving.clear()
        async with self._motion:
            await self._run(self.driver.perform(op.Stop()), STOP)
        self._seen[op.Slewing] = Seen(False, self.now())
        self.version += 1

    async def _motion_job(self, operation: op.Operation, stops: int) -> Any:
        """Run a motion after those before it, unless a stop comes first."""
        if isinstance(operation, op.Halt):
            for task, other in list(self._jobs.items()):
                if isinstance(other, op.Move) and other.direction.axis == operation.axis:
                    task.cancel()
        task = self.loop.create_task(self._move(operation, stops))
        self._jobs[task] = operation
        task.add_done_callback(self._moved)
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            if task.cancelled():
                raise Stopped from None
            raise

    def _moved(self, task: asyncio.Task[Any]) -> None:
        self._jobs.pop(task, None)
        if not task.cancelled():
            task.exception()

    async def _move(self, operation: op.Operation, stops: int) -> Any:
        async with self._motion:
            if stops != self.stops and not isinstance(operation, op.Halt):
                raise Stopped
            operation = await self._checked(operation)
            rank = STOP if isinstance(operation, op.Halt) else MOTION
            value = await self._run(self.driver.perform(operation), rank)
        self._after(operation)
        return value

    async def _checked(self, operation: op.Operation) -> op.Operation:
        """An operation that the limits allow, as this mount must be given it. Raises Fault."""
        if isinstance(operation, op.GotoHorizontal):
            check_altitude(self.policy.limits.narrowed(operation.lowest, operation.highest), operation.alt)
            status = await self._read(op.GetStatus())
            if not status.equatorial:
                return op.GotoAxes(operation.az, operation.alt)
            place = self.observatory.site()
            if place is None:
                raise Unsupported("The site is not known.")
            ra, dec = self.sky.equatorial(operation.az, operation.alt, place.latitude, place.longitude,
                                          self.observatory.unix())
            operation = op.Goto(ra, dec)
        if isinstance(operation, op.Goto):
            self._check_goto(operation)
            return self._to_mount_equinox(operation)
        if isinstance(operation, op.Sync):
            status = await self._read(op.GetStatus())
            if status.aligned:
                check_sync(self.policy.limits, await self._read(op.Position()), op.Equatorial(operation.ra, operation.dec))
            return self._to_mount_equinox(operation)
        return operation

    def _check_goto(self, operation: op.Goto) -> None:
        altitude = self.altitude_of(operation.ra, operation.dec)
        if altitude is None:
            self.transcript.note_once("mount", "site or clock unknown: gotos are not checked against the horizon")
            return
        check_altitude(self.policy.limits.narrowed(operation.lowest, operation.highest), altitude)

    def altitude_of(self, ra: float, dec: float) -> float | None:
        """Degrees above the horizon now; None while the site is unknown."""
        place = self.observatory.site()
        if place is None:
            return None
        return self.sky.horizon(ra, dec, place.latitude, place.longitude, self.observatory.unix())[1]

    def _to_mount_equinox(self, operation: Any) -> Any:
        if self.policy.equinox != "j2000":
            return operation
        ra, dec = self.sky.to_j2000(operation.ra, operation.dec, self.observatory.unix())
        return type(operation)(**{**{f: getattr(operation, f) for f in operation.__struct_fields__}, "ra": ra, "dec": dec})

    def _after(self, operation: op.Operation) -> None:
        """What is known without asking, once an operation has been carried out."""
        if isinstance(operation, op.Goto | op.GotoAxes | op.Park | op.Home):
            self._moving.clear()
            self._seen[op.Slewing] = Seen(True, self.now())
        elif isinstance(operation, op.Move):
            self._moving.add(operation.direction.axis)
            self._altitude = None
        elif isinstance(operation, op.Halt):
            self._moving.discard(operation.axis)
        if isinstance(operation, op.Sync):
            self._seen.pop(op.Position, None)
            self._seen.pop(op.HorizontalPosition, None)
        if isinstance(operation, op.SetTracking | op.Unpark | op.Sleep | op.Wake):
            self._seen.pop(op.GetStatus, None)
        self.version += 1

    # --- site and clock -------------------------------------------------------------------------------------------

    async def _get_site(self, _: op.GetSite) -> op.Place:
        if self.observatory.site() is None:
            await self._first_answers()
        place = self.observatory.site()
        if place is None:
            raise Unsupported("The site is not known.")
        return place

    async def _get_clock(self, _: op.GetClock) -> op.Moment:
        if self.observatory.clock() is None:
            await self._first_answers()
        moment = self.observatory.clock()
        if moment is None:
            self.transcript.note_once("mount", "the mount tells no time: this computer's clock stands in")
            moment = op.Moment(self.observatory.unix(), 0.0)
        return moment

    async def _first_answers(self) -> None:
        try:
            async with asyncio.timeout(FIRST_ANSWER):
                await self.identified.wait()
        except TimeoutError:
            raise NoAnswer from None

    async def _sidereal_time(self, _: op.SiderealTime) -> float:
        place = await self._get_site(op.GetSite())
        await self._get_clock(op.GetClock())
        return self.sky.sidereal_time(self.observatory.unix(), place.longitude)

    async def _set_site(self, operation: op.SetSite) -> None:
        """Take a half or the whole; the mount is told once both halves are there, or after a moment."""
        whole = self.observatory.set_site_half(operation)
        self.version += 1
        if whole is not None:
            self.spawn(self._hand_on_site())
        else:
            self.loop.call_later(HALF_SITE, lambda: self.spawn(self._hand_on_site()))

    async def _hand_on_site(self) -> None:
        whole = self.observatory.take_site()
        if whole is None:
            return
        if await self._telling(self.observatory.same_site(whole), "site"):
            try:
                await self._run(self.driver.perform(whole), SETTING)
            except Fault as fault:
                self.transcript.note("mount", f"site kept in the gateway: {fault}")
            else:
                self.observatory.kept_site = None
                assert whole.latitude is not None and whole.longitude is not None
                self.observatory.mount_says_site(op.Place(whole.latitude, whole.longitude))
                self.version += 1
                return
        elif self.observatory.same_site(whole):
            self.observatory.kept_site = None
            return
        self.observatory.keep_site(whole)
        self.version += 1

    async def _set_clock(self, operation: op.SetClock) -> None:
        """The client is believed at once; the mount is told where the policy allows it."""
        at = self.now()
        same = self.observatory.same_clock(operation)
        if not same:
            self.observatory.keep_clock(operation)
        self.version += 1
        self.spawn(self._hand_on_clock(operation, at, same))

    async def _hand_on_clock(self, operation: op.SetClock, at: float, same: bool) -> None:
        if not await self._telling(same, "clock"):
            return
        moment = op.SetClock(operation.unix + self.now() - at, operation.offset)
        try:
            await self._run(self.driver.perform(moment), SETTING)
            value = await self._run(self.driver.perform(op.GetClock()), READ)
        except Fault as fault:
            self.transcript.note("mount", f"clock kept in the gateway: {fault}")
            return
        self.observatory.mount_says_clock(value)
        self.observatory.kept_clock = None
        self.version += 1

    async def _telling(self, same: bool, what: str) -> bool:
        """Whether the mount is to be told a site or a clock that a client has set."""
        if self.policy.site_time == "never":
            self.transcript.note_once("mount", f"the {what} a client sets is kept in the gateway (site_time = never)")
            return False
        try:
            status = await self._read(op.GetStatus())
        except Fault:
            return False
        if not status.aligned:
            return True
        if same:
            return False
        if self.policy.site_time == "always" and not getattr(self.driver, "starsense", False):
            return True
        self.transcript.note_once("mount", f"the mount is aligned: the {what} a client sets is kept in the gateway")
        return False

    _HANDLERS: dict[type[Any], Callable[[Any, Any], Any]] = {
        op.GetSite: _get_site,
        op.GetClock: _get_clock,
        op.SiderealTime: _sidereal_time,
        op.SetSite: _set_site,
        op.SetClock: _set_clock,
    }

    # --- keeping the snapshot fresh -------------------------------------------------------------------------------

    async def _refresh(self) -> None:
        """Renew what clients ask for; watch a goto and an altitude; else one heartbeat every few seconds."""
        await self.identified.wait()
        beat = self.now()
        while True:
            if self.line.state != "up":
                await asyncio.sleep(0.2)
                continue
            now = self.now()
            due = [kind for kind in RENEW if self._wanted(kind, now) and self._age(kind, now) >= RENEW[kind] - 0.02]
            if due:
                beat = now
                await asyncio.gather(*(self._renew(kind) for kind in due))
            elif now - beat >= HEARTBEAT:
                beat = now
                await self._renew(op.Position)
            moment = self.observatory.mount_clock
            if moment is not None and now - moment[1] > CLOCK_AGE and self._wanted(op.Position, now):
                await self._renew_clock()
            await asyncio.sleep(min(self._next(kind, now) for kind in RENEW))

    def _wanted(self, kind: type[op.Operation], now: float) -> bool:
        """Whether somebody polls this, or the hub itself must watch it."""
        if self.moving and kind in (op.Position, op.Slewing):
            return kind is op.Position or self.slewing
        return now - self._asked.get(kind, -1e9) <= POLLING

    def _age(self, kind: type[op.Operation], now: float) -> float:
        seen = self._seen.get(kind)
        return 1e9 if seen is None else now - seen.at

    def _next(self, kind: type[op.Operation], now: float) -> float:
        if not self._wanted(kind, now):
            return 0.25
        return max(0.01, RENEW[kind] - self._age(kind, self.now()))

    async def _renew(self, kind: type[op.Operation]) -> None:
        task = self._sharing.get(kind)
        if task is None:
            task = self._sharing[kind] = self.loop.create_task(self._ask(kind()))
            task.add_done_callback(lambda done: self._shared(kind, done))
        try:
            await asyncio.shield(task)
        except Fault as fault:
            if not isinstance(fault, NoAnswer | NotAligned):
                self.transcript.note("mount", f"{kind.__name__}: {fault}")
        if kind is op.Position and self.moving:
            await self._watch_altitude()

    async def _renew_clock(self) -> None:
        try:
            value = await self._run(self.driver.perform(op.GetClock()), READ)
        except Fault:
            return
        self.observatory.mount_says_clock(value)

    async def _watch_altitude(self) -> None:
        """Stop a motion that leaves the altitude limits, early enough for the next look to come in time."""
        seen = self._seen.get(op.Position)
        altitude = None if seen is None else self.altitude_of(seen.value.ra, seen.value.dec)
        if altitude is None:
            return
        before, self._altitude = self._altitude, altitude
        if before is None or self.slewing:
            return
        margin = abs(altitude - before) * 1.5
        if leaving(self.policy.limits, before, altitude, margin):
            self.transcript.note("mount", f"stopped at the altitude limit ({altitude:.1f} degrees)")
            await self.stop()
