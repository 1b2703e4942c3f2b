"""Carries out requests of people and Python programs, under the same limits and rules as the commands of clients.

A motion belongs to the request that began it: cancelling the request ends that motion, and no other that a program or
another request has begun since. A timer in the gateway ends a ``move``, even if its command was killed.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any, TypeVar

import msgspec
from msgspec.structs import replace

from gateway.app.control.operations import unpack_operation
from gateway.app.discovery.served import RunningGateway, served_surfaces
from gateway.app.status import State, format_position
from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import BelowHorizon, Busy, Fault, Invalid, NearSun, PastMeridian, Stopped, TooHigh, UserError
from gateway.core.requests import DONE, FAILED, UNDER_WAY, Answer
from gateway.mount.controller import MountController
from gateway.mount.motion.taps import arrow_holder
from gateway.mount.motion.wanted import HandMove, Slew
from gateway.mount.policy import Limits
from gateway.mount.presence import HostActivity
from gateway.mount.readings.reader import miss_text

#: Seconds after which a motion that could not begin yet is dropped, because its command does not wait longer.
MAX_START_DELAY = 10.0
#: Timeout in seconds for fresh readings of the mount; after it, cached ones are shown.
FRESH_READING_TIMEOUT = 1.5
#: How many requests are remembered: the newest ones, and those whose arrow is still pressed.
MAX_REMEMBERED_REQUESTS = 64
#: Operations that need the site.
SITE_OPERATIONS = (op.Zenith, op.MoonPlace, op.HorizontalPosition, op.GotoHorizontal, op.TubeSide)
_T = TypeVar("_T")


class ActiveRequest:
    """A remembered request: its client, how many stops there were before it, its goal, and whether it was cancelled."""

    def __init__(self, activity: HostActivity, stop_count: int) -> None:
        self.activity, self.stop_count = activity, stop_count
        self.goal: op.Equatorial | None = None
        self.is_park = False
        self.cancel_event = asyncio.Event()
        #: Direction and rate key of the motion by hand that a ``PressKeyRequest`` began.
        self.arrow: tuple[op.Direction, int] | None = None


#: Tag of a request -> its title for people, if that is not the tag.
REQUEST_TITLES = {"press": "Arrow", "let go": "Release of an arrow", "narrow": "Limits"}


def title_of(request: msgspec.Struct) -> str:
    """Return the kind of a request in words, to begin a line of the log."""
    if (kind := _operation_type(request)) is not None:
        return kind.title()
    tag = str(request.__struct_config__.tag)
    return REQUEST_TITLES.get(tag, tag.capitalize())


def _operation_type(request: object) -> type[op.Operation] | None:
    """Return the type of the operation in an ``OperationRequest``; None for every other request."""
    return op.operation_class(request.operation) if isinstance(request, requests.OperationRequest) else None


#: Refusals by limits that a page may have narrowed.
NARROWED = BelowHorizon | TooHigh | NearSun | PastMeridian
#: The sentence that is added to such a refusal for a person.
NARROWED_LIMITS_TEXT = (
    "A page of the console has narrowed the limits until the gateway ends ({0}); it can take that back under More."
)


def explain(fault: Fault, limits: Limits) -> str:
    """Return a refusal for a person: the text for programs, and an explanation unless the text says what to do."""
    if limits.by_page and isinstance(fault, NARROWED):
        return f"{fault} {NARROWED_LIMITS_TEXT.format(limits)}"
    if fault.brief or not fault.explanation:  # a text with a brief form says what to do
        return str(fault)
    return f"{fault} {fault.explanation.format(sun=limits.sun, sync=limits.sync)}"


async def position_of_date(controller: MountController, target: requests.Target) -> op.Equatorial:
    """Return the position of a target for the equinox of date, in degrees. Raises Fault."""
    if isinstance(target, requests.Named):
        raise Invalid(f"The position of {target.name} has not been looked up.")
    if isinstance(target, requests.Body):
        await _wait_for_site(controller)
        reads: op.Read[op.Equatorial] = op.MoonPlace() if target.name.lower() == "moon" else op.PlanetPlace(target.name)
    elif not (-90.0 <= target.dec <= 90.0 and 0.0 <= target.ra <= 360.0):
        raise Invalid("There is no such place on the sky.")
    elif target.j2000:
        reads = op.ToEquinoxOfDate(target.ra % 360.0, target.dec)
    else:
        return op.Equatorial(target.ra % 360.0, target.dec)
    return await controller.answer(reads)


async def _wait_for_site(controller: MountController) -> None:
    """Read the mount's site if it is unknown. A failure is ignored: the operation that needs a site is then refused."""
    with contextlib.suppress(Fault):
        await controller.answer(op.GetSite())


class RequestHandler:
    """Carries out the requests of people for one gateway."""

    def __init__(self, controller: MountController, gateway: RunningGateway) -> None:
        self._controller, self._gateway = controller, gateway
        self._active: dict[str, ActiveRequest] = {}

    def state(self) -> State:
        """Return the known state of the mount, without an exchange with it."""
        ports = tuple(served_surfaces(self._gateway))
        surfaces = [f"{port.name} {port.at}" for port in ports]
        state = self._gateway.state().to_state(surfaces)
        folder = "" if self._gateway.store is None else str(self._gateway.store.folder)
        return replace(state, served=ports, folder=folder, unopened=self._gateway.open_failure)

    async def carry_out(self, request: requests.Request) -> Answer:
        """Carry out any request but a stop or a hold. The name of an object is first replaced by its position."""
        subject = "It"
        if isinstance(request, requests.GotoRequest | requests.SyncRequest) and isinstance(
            request.where, requests.Named
        ):
            subject = request.where.name[:1].upper() + request.where.name[1:]
            from gateway.app.control import objects  # loads the catalogues, which only names of objects need

            stops = self._controller.stop_count
            try:
                request = replace(request, where=await asyncio.to_thread(objects.find_target, request.where.name))
            except UserError as error:
                return Answer(FAILED, str(error), UserError.__name__)
            if self._controller.stop_count != stops:
                return Answer(FAILED, explain(Stopped(), self._controller.policy.limits), Stopped.__name__)
        match request:
            case requests.StateRequest():
                if request.fresh:
                    await self._refresh()
                return Answer(DONE, msgspec.json.encode(self.state()).decode())
            case requests.ReadSlowRequest():
                return Answer(DONE, msgspec.json.encode(await self._read_unpolled_values()).decode())
            case requests.ProgressRequest():
                return await self._report_progress(request.number)
            case requests.CancelRequest():
                return await self._cancel(request.number)
        assert isinstance(request, requests.ChangeRequest)
        what, wire_log = title_of(request), self._controller.wire_log
        active = self._add_active(request.number, request.who or f"mount-gateway {what.lower()}")
        kept_alive = isinstance(request, requests.PressKeyRequest) and active.arrow is not None
        reads = issubclass(_operation_type(request) or op.Operation, op.Read)
        try:
            message = await self._carry_out_change(request, active)
        except Fault as fault:
            message = f"{what} ended by a stop" if isinstance(fault, Stopped) else fault.with_summary(what)
            if not reads:
                wire_log.log_refusal(active.activity.host, message)
            explanation = explain(fault, self._controller.policy.limits)
            return Answer(
                FAILED,
                subject + explanation[2:] if explanation.startswith("It is") else explanation,
                type(fault).__name__,
            )
        if not (reads or kept_alive):
            answer = "" if isinstance(request, requests.OperationRequest) else f": {message}"
            wire_log.put(active.activity.host, "*", note=f"{what}{answer}")
        return Answer(DONE, message)

    def _add_active(self, number: str, client: str) -> ActiveRequest:
        active, presence = self._active.get(number), self._controller.presence
        if active is None:
            active = self._active[number] = ActiveRequest(presence.add_connection(client), self._controller.stop_count)
            if len(self._active) > MAX_REMEMBERED_REQUESTS:
                oldest = next((begun for begun, known in self._active.items() if not self._owns_arrow(known)), number)
                presence.mark_closed(self._active.pop(oldest).activity)
        return active

    # --- carrying out -----------------------------------------------------------------------------------------------

    async def _carry_out_change(self, request: Any, active: ActiveRequest) -> str:
        match request:
            case requests.GotoRequest():
                active.goal = await position_of_date(self._controller, request.where)
                await self._perform(op.Goto(active.goal.ra, active.goal.dec), active)
                return f"it goes to {format_position(active.goal)}"
            case requests.SyncRequest():
                goal = await position_of_date(self._controller, request.where)
                await self._perform(op.Sync(goal.ra, goal.dec), active)
                return f"it now points to {format_position(goal)}"
            case requests.ParkRequest():
                active.is_park = True
                await self._perform(op.Park(), active)
                return "it goes to its park position"
            case requests.HomeRequest():
                await self._perform(op.Home(), active)
                return "it goes to its home position"
            case requests.PressKeyRequest():
                return await self._press(request, active)
            case requests.ReleaseKeyRequest():
                return await self._release(request, active)
            case requests.TrackRequest():
                return await self._track(request, active)
            case requests.SetClockRequest():
                await self._controller.perform(op.SetClock(request.unix, request.offset), None, active.activity)
                return "the time is set"
            case requests.SetSiteRequest():
                holds = self._controller.site_settings.site_users()
                self._controller.site_clock.confirmed_site = op.Place(request.latitude, request.longitude)
                await self._controller.perform(op.SetSite(request.latitude, request.longitude), None, active.activity)
                return f"the site is set; it holds for {holds}" if holds else "the site is set"
            case requests.GuideRequest():
                await self._perform(op.Pulse(request.direction, request.ms, sky=True), active)
                return f"it was guided {request.direction.label} for {request.ms} ms"
            case requests.SetGuideRateRequest():
                for axis in (1, 2):
                    await self._controller.perform(op.SetGuideRate(axis, request.rate), None, active.activity)
                return f"the guide rate is {request.rate:g} of sidereal"
            case requests.NarrowLimitsRequest():
                asked = {name: getattr(request, name) for name in ("lowest", "highest", "sun", "hour_angle")}
                return f"allowed now: {self._controller.narrow_limits(**asked)}"
            case requests.UnparkRequest():
                await self._perform(op.Wake() if self._controller.driver.asleep else op.Unpark(), active)
                return "unparked and tracking"
            case requests.OperationRequest():
                return await self._carry_out_operation(unpack_operation(request), active)
        return await self._move(request, active)

    async def _carry_out_operation(self, operation: op.Operation[object], active: ActiveRequest) -> str:
        """Carry out an operation, and return its answer as JSON. Raises Fault."""
        active.activity.sent_data = True  # the program is alive: a motion by hand that it has begun may continue
        active.stop_count = self._controller.stop_count
        active.goal = op.Equatorial(operation.ra, operation.dec) if isinstance(operation, op.Goto) else None
        active.is_park = isinstance(operation, op.Park)
        if isinstance(operation, SITE_OPERATIONS):
            await _wait_for_site(self._controller)
        return msgspec.json.encode(await self._perform(operation, active)).decode()

    async def _perform(self, operation: op.Operation[_T], active: ActiveRequest) -> _T:
        """Perform an operation for a request, and return its answer. Raises Fault."""
        if active.cancel_event.is_set():
            raise Busy("It was cancelled.")
        try:
            async with asyncio.timeout(MAX_START_DELAY + 1.0):
                if isinstance(operation, op.Read):
                    return await self._controller.answer(operation, active.activity)
                return await self._controller.perform(operation, active.stop_count, active.activity, MAX_START_DELAY)
        except TimeoutError:
            raise Busy from None

    async def _move(self, request: requests.MoveRequest, active: ActiveRequest) -> str:
        """Begin a motion by hand, wait, and end it. Raises Fault."""
        controller, longest = self._controller, self._controller.policy.dead_man
        if not 0.0 < request.seconds <= longest or not 1 <= request.key <= 9:
            raise Invalid(f"An arrow may be pressed for up to {longest:g} s (--dead-man) at a rate of 1 to 9.")
        operation, parked = op.Move(request.direction, op.Rate(key=request.key)), controller.driver.parked
        try:
            await self._perform(operation, active)
            since = controller.now()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(request.seconds):
                    await active.cancel_event.wait()
            lasted, stopped = controller.now() - since, active.stop_count != controller.stop_count
        finally:
            if self._has_motion(active):
                await controller.perform(op.StopAxis(operation.axis), None, active.activity)
        if stopped:
            raise Stopped
        away = "; it is no longer parked" if parked and not controller.driver.parked else ""
        return f"it was moved {request.direction.label} for {lasted:.1f} s{away}"

    async def _press(self, request: requests.PressKeyRequest, active: ActiveRequest) -> str:
        """Begin a motion by hand, or keep it alive. Raises Fault."""
        if not 1 <= request.key <= 9:
            raise Invalid("Rates are from 1 to 9.")
        active.activity.sent_data = True
        if active.stop_count != self._controller.stop_count:
            raise Stopped
        if active.arrow == (request.direction, request.key):
            return f"it is moved {request.direction.label}"
        if active.arrow is not None and not self._owns_arrow(active):  # another rate, after something else ended it
            raise Stopped
        active.arrow = request.direction, request.key
        try:
            await self._perform(op.Move(request.direction, op.Rate(key=request.key)), active)
        except Stopped:
            if not active.cancel_event.is_set():
                raise
        return f"it is moved {request.direction.label}"

    async def _release(self, request: requests.ReleaseKeyRequest, active: ActiveRequest) -> str:
        """End the motion that a ``PressKeyRequest`` began, unless another arrow has replaced it. Raises Fault."""
        active.cancel_event.set()
        if active.arrow is not None and self._owns_arrow(active):
            by = None if request.lost else active.activity
            await self._controller.perform(op.StopAxis(active.arrow[0].axis), None, by)
        return "let go"

    def _owns_arrow(self, active: ActiveRequest) -> bool:
        """Whether the arrow that this request pressed is still the newest one of its axis."""
        return (
            active.arrow is not None
            and arrow_holder(self._controller.wanted.value, active.arrow[0].axis) is active.activity
        )

    async def _track(self, request: requests.TrackRequest, active: ActiveRequest) -> str:
        """Set the tracking rate if the request has it, and turn tracking on or off. Raises Fault."""
        if request.rate is not None:
            await self._perform(op.TrackRate(request.rate), active)
        await self._perform(op.SetTracking(request.on), active)
        return f"tracking is {'on' if request.on else 'off'}"

    # --- how it goes ------------------------------------------------------------------------------------------------

    def _has_motion(self, active: ActiveRequest) -> bool:
        """Whether a motion that this request has begun is in progress or waits to begin."""
        wanted = self._controller.wanted.value
        moving = [wanted.motion.client] if isinstance(wanted.motion, Slew) else []
        if isinstance(wanted.motion, HandMove):
            moving = [motion.client for _, motion in wanted.motion]
        return any(by is active.activity for by in (*moving, *(order.client for order in wanted.pending)))

    async def _report_progress(self, request_number: str) -> Answer:
        active, controller = self._active.get(request_number), self._controller
        if active is None:
            return Answer(FAILED, "the gateway does not know this request: it may have been restarted meanwhile")
        await self._refresh()
        look = self._gateway.state().look
        follows = active.is_park and any(
            order.follow_up for order in controller.wanted.value.pending
        )  # after parking, its tracking is still to be turned off
        if self._has_motion(active) or follows:
            return Answer(UNDER_WAY, format_position(look.position) if look.position else "")
        at = f", at {format_position(look.position)}" if look.position else ""
        if controller.wanted.value.goto_failure:
            return Answer(FAILED, f"{controller.wanted.value.goto_failure}{at}", "Stopped")
        if controller.stop_count != active.stop_count:
            by = controller.wanted.stopped_by
            return Answer(FAILED, f"it was stopped on the way{f' by {by}' if by else ''}{at}", "Stopped")
        if active.goal is not None and look.position is not None and (short := miss_text(active.goal, look.position)):
            slew = controller.wanted.value.motion
            other = f"another goto came from {slew.client.host}" if isinstance(slew, Slew) and slew.client else ""
            return Answer(FAILED, f"{other or f'{short}, or another request came'}{at}", "Stopped")
        if active.is_park:
            return Answer(DONE, "it is parked")
        return Answer(DONE, f"it is there{': ' + format_position(look.position) if look.position else ''}")

    async def _cancel(self, request_number: str) -> Answer:
        controller, active = self._controller, self._add_active(request_number, "mount-gateway stop")
        active.cancel_event.set()  # if the request arrives later than its cancellation, it is not begun
        if not self._has_motion(active):
            return Answer(DONE, "nothing that was started here is under way")
        wanted = controller.wanted.value
        halts: list[op.Operation] = (
            [op.StopAxis(axis) for axis, motion in wanted.motion if motion.client is active.activity]
            if isinstance(wanted.motion, HandMove)
            else []
        )
        # a goto of another client that waits will replace this goto anyway
        if not halts and all(order.client is active.activity for order in wanted.waiting_gotos):
            halts = [op.AbortSlew()]
        try:
            for halt in halts:
                await controller.perform(halt, None, active.activity)
        except Fault as fault:
            return Answer(
                FAILED, f"the mount has not acknowledged the stop: {explain(fault, controller.policy.limits)}"
            )
        controller.wire_log.put(active.activity.host, "*", note="Cancel: the mount was stopped")
        return Answer(DONE, "the mount was stopped")

    async def _read_unpolled_values(self) -> dict[str, Any]:
        """Read the pier side and the drive rate, which no task polls; None for one that the mount does not report."""
        controller = self._controller
        reported: dict[str, Any] = {"pier": None, "drive": None}
        if controller.line.state != "up" or controller.driver.asleep:
            return reported
        reads: dict[str, op.Operation[Any]] = {"pier": op.PierSide()} if controller.driver.german else {}
        for name, read in {**reads, "drive": op.DriveRate()}.items():
            with contextlib.suppress(Fault, TimeoutError):
                async with asyncio.timeout(FRESH_READING_TIMEOUT):
                    reported[name] = await controller.answer(read)
        return reported

    async def _refresh(self) -> None:
        """Read the position and status from the mount, for ``FRESH_READING_TIMEOUT`` seconds at most."""
        controller = self._controller
        if controller.line.state != "up" or controller.driver.asleep:
            return
        with contextlib.suppress(Fault, TimeoutError):
            async with asyncio.timeout(FRESH_READING_TIMEOUT):
                for read in (op.Position(), op.Slewing(), op.GetStatus()):
                    await controller.answer(read)
