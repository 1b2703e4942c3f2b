"""Moves and observes the mount for ``prove``: sends requests to the gateway, and evaluates reported positions.

Every motion is a request like those of the command line, under the same rules. While ``prove`` waits, it checks whether
somebody else has stopped or moved the mount, or the connection is lost: then the stage ends (``StageEnded``), and
``prove`` moves nothing until the next stage. Angles are degrees, times seconds of the event loop's clock.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import inf
from typing import NamedTuple

from msgspec.structs import replace

from gateway.app.control.operations import pack_operation
from gateway.app.control.orders import stop_mount
from gateway.app.gateway import Gateway
from gateway.astro.spherical import SIDEREAL_RATE, hour_angle_to_horizon, separation, wrap180
from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import Fault, NoAnswer
from gateway.core.motion_kinds import begins_motion
from gateway.core.wire_log import Entry
from gateway.mount.motion.run_on import TimedPosition, unexplained_motion
from gateway.mount.motion.wanted import HandMove, Slew, Wanted
from gateway.mount.presence import HostActivity
from gateway.mount.safety.unattended import SWITCHED_OFF_MESSAGE
from gateway.protocols.registry import streams

#: The client name of ``prove`` in the log and on the page.
CLIENT = "mount-gateway prove"
#: Seconds: between two checks of the mount's state; the timeout for rest; between two positions that prove rest.
CHECK_PERIOD, REST_TIMEOUT, POSITION_SPACING = 0.1, 15.0, 0.8
#: A motion ends after so many changed readings, after so many seconds, or after the time for so many degrees. The last
#: value is the greatest motion of the other axis, degrees.
ENOUGH_READING_CHANGES, MAX_DURATION, MAX_TRAVEL, MAX_CROSS_MOTION = 20, 10.0, 5.0, 0.5
#: At this rate (degrees a second) or faster, a reading must change within so many seconds.
FAST_RATE, MAX_UNCHANGED_TIME = 0.5, 2.0
#: Degrees: the finest step of a server's angles that is believed; a change below the second value is a rounding error.
FINEST_STEP, ROUNDING_ERROR = 1.0 / 3600.0, 0.5 / 3600.0

Pair = tuple[float, float]  # of the two axes, degrees


class StageEnded(Exception):
    """A stage must end early. The text is the reason, without a full stop at its end."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason.removesuffix("."))


class StoppedByOthers(StageEnded):
    """Somebody else, or the gateway at a limit, has stopped the mount: this stage must not move the mount any more."""


class Motion(NamedTuple):
    """A motion by a direction key: when the mount acknowledged its start and its stop, and the positions on the way.

    ``start_position`` and ``end_position`` are at rest. ``refusal`` is the reason if the motion was refused.
    """

    began_at: float = 0.0
    ended_at: float = 0.0
    start_position: TimedPosition | None = None
    positions: tuple[TimedPosition, ...] = ()
    end_position: TimedPosition | None = None
    refusal: str = ""


class CheckedMount:
    """The identified mount of a gateway, as the stages of ``prove`` move and observe it."""

    def __init__(self, gateway: Gateway) -> None:
        self.gateway, self.controller = gateway, gateway.controller
        self.now, self.driver = self.controller.now, self.controller.driver
        self._stop_count, self._positions = self.controller.stop_count, list[TimedPosition]()
        #: Whether a motion of the check is under way; reset when `settle` finds the mount at rest.
        self.is_moving = False
        #: A time of the event loop's clock, and the sidereal time then (degrees; 0 if the site is unknown).
        self._lst_epoch: Pair | None = None
        #: Whether somebody else has turned tracking on or off, or set its rate, in this stage.
        self.others_set_tracking = False
        self._steps = list(self.driver.angle_steps)
        self.controller.reader.position_read.connect(lambda _: self._add_position())
        self.controller.wanted.changed.connect(self._on_wanted_changed)
        #: The gateway's message when it switched tracking off; empty if it has not.
        self.tracking_off_note = ""
        self.controller.wire_log.sinks.append(self._on_log_entry)

    @property
    def position(self) -> TimedPosition | None:
        """The last position that the mount has reported; None if there is none."""
        return self.controller.reader.latest_position()

    @property
    def status(self) -> op.Status:
        """The last status. Raises StageEnded if the mount has not reported one."""
        status: op.Status | None = self.controller.cache.last_value(op.GetStatus)
        if status is None:
            raise StageEnded("the mount has not reported its status")
        return status

    # --- who else acts ------------------------------------------------------------------------------------------------

    def begin_stage(self) -> None:
        """Begin a stage: only later stops and tracking orders of others count as interference."""
        self._stop_count, self.others_set_tracking = self.controller.stop_count, False

    def raise_if_stage_ends(self) -> None:
        """Raise StageEnded if somebody else stops or moves the mount, or if it does not answer."""
        controller = self.controller
        if controller.stop_count != self._stop_count:
            notices = [entry.text for entry in controller.wire_log.recent_notices if entry.side != CLIENT]
            reason = controller.wanted.value.goto_failure or next(reversed(notices), "")
            by = controller.wanted.stopped_by
            raise StoppedByOthers(f"the mount was stopped{f' by {by}' if by else f' ({reason})' * bool(reason)}")
        if controller.line.state not in ("up", "busy"):
            may_move = controller.wanted.stop_owed or self.is_moving
            still = "; it may still move, and is stopped as soon as it answers" if may_move else ""
            raise StageEnded(f"the mount does not answer ({controller.line.down_cause}){still}")
        if other := self.other_mover:
            raise StageEnded(f"another program moves the mount ({other})")
        if controller.watch.moved_by_others and not self.is_moving and controller.context.run_on.current is None:
            raise StageEnded("the mount is moved at its keys, or by itself")

    @property
    def other_mover(self) -> str:
        """The name of another client that moves the mount; empty if none does."""
        return next((by.host for by in self._moving_clients() if by is not None and by.host != CLIENT), "")

    def _moving_clients(self) -> Iterator[HostActivity | None]:
        wanted = self.controller.wanted.value
        if isinstance(wanted.motion, Slew):
            yield wanted.motion.client
        elif isinstance(wanted.motion, HandMove):
            yield from (moving.client for _, moving in wanted.motion)
        yield from (order.client for order in wanted.pending if begins_motion(order.operation))

    def _on_log_entry(self, entry: Entry) -> None:
        if entry.note.startswith(SWITCHED_OFF_MESSAGE):
            self.tracking_off_note = f"the gateway says: {entry.note}"

    def _on_wanted_changed(self, wanted: Wanted) -> None:
        orders = [order for order in wanted.pending if isinstance(order.operation, op.SetTracking | op.TrackRate)]
        self.others_set_tracking |= any(order.client is not None and order.client.host != CLIENT for order in orders)

    async def wait_until(self, is_done: Callable[[], bool], timeout: float) -> bool:
        """Wait for a condition; return False if it is not met within ``timeout`` seconds. Raises StageEnded."""
        end = self.now() + timeout
        while not is_done():
            if self.now() >= end:
                return False
            await asyncio.sleep(CHECK_PERIOD)
            self.raise_if_stage_ends()
        return True

    # --- requests -----------------------------------------------------------------------------------------------------

    async def ask(self, request: requests.Request) -> requests.Answer:
        return await self.gateway.carry_out(request)

    async def read_position(self) -> TimedPosition:
        """Read the mount's position and status anew, and return the position. Raises StageEnded."""
        await self.ask(requests.StateRequest())
        self.raise_if_stage_ends()
        if self.position is None:
            raise StageEnded("the mount has not reported its position")
        return self.position

    async def stop(self) -> str:
        """Stop all motion at once; return an empty text, or why the mount may still move."""
        answer = await stop_mount(self.controller)
        return "" if answer.is_ok else answer.text

    async def settle(self) -> TimedPosition:
        """Wait until the mount is at rest or only tracks, and return its position. Raises StageEnded."""
        controller = self.controller

        def is_at_rest() -> bool:
            ends = controller.wanted.is_ending or controller.context.run_on.current is not None
            ends = ends or (self.is_moving and controller.watch.moved_by_others)  # what runs on longer looks like that
            return not (ends or controller.moving or controller.wanted.goto_pending)

        if not await self.wait_until(is_at_rest, REST_TIMEOUT):
            raise StageEnded("the mount does not come to rest")
        present = await self.read_position()
        for _ in range(int(REST_TIMEOUT / POSITION_SPACING)):
            await asyncio.sleep(POSITION_SPACING)
            before, present = present, await self.read_position()
            if self.drift(before, present) <= max(self.angle_steps) + 5.0 / 3600.0:
                self.is_moving = False
                return present
        raise StageEnded("the mount does not come to rest")

    async def move_by_key(self, direction: op.Direction, key: int, max_seconds: float) -> Motion:
        """Move as with a rate key, for ``max_seconds`` at most, and wait until the mount rests. Raises StageEnded."""
        before = await self.settle()
        speed, number = self.speed_of_key(key), requests.new_request_number()
        self._positions.clear()
        self.is_moving = True
        try:
            answer = await self.ask(requests.PressKeyRequest(direction=direction, key=key, number=number, who=CLIENT))
            if refused := self._refusal_reason(answer):
                return Motion(refusal=refused)
            began, changed, count = self.now(), self.now(), 0
            while self.now() < began + max_seconds and count < ENOUGH_READING_CHANGES:
                await asyncio.sleep(max(0.01, min(CHECK_PERIOD, began + max_seconds - self.now())))
                self.raise_if_stage_ends()
                observed = sum(self._has_changed(*two, is_fast=speed > FAST_RATE) for two in pairwise(self._positions))
                if observed != count:
                    count, changed = observed, self.now()
                if speed > FAST_RATE and self.now() > changed + MAX_UNCHANGED_TIME:
                    break
        finally:
            await self.ask(requests.ReleaseKeyRequest(number=number, who=CLIENT, lost=True))
        ended = self.now()
        places = tuple(place for place in self._positions if place.requested_at > began and place.at < ended)
        after = await self.settle()
        across = abs(self.axis_turns(before, after)[2 - direction.axis])
        if across > MAX_CROSS_MOTION + abs(SIDEREAL_RATE) * (after.at - before.at) and not self.driver.moves_by_gotos:
            raise StageEnded(
                f"the other axis was turned as well, by {across:.1f}°: somebody used its keys, or axes are swapped"
            )
        return Motion(began, ended, before, places, after)

    def _has_changed(self, before: TimedPosition, after: TimedPosition, is_fast: bool) -> bool:
        """Whether a position has changed: in a fast motion, by more than tracking can explain."""
        return self.drift(before, after) > max(self.angle_steps) if is_fast else before.position != after.position

    async def goto(self, goal: op.Equatorial, timeout: float) -> str:
        """Go to a position; cancel the goto when time is up. Return why it was refused, or "". Raises StageEnded."""
        number = requests.new_request_number()
        spot = requests.Spot(goal.ra % 360.0, goal.dec)
        self.is_moving, controller, over = True, self.controller, False
        try:
            answer = await self.ask(requests.GotoRequest(where=spot, number=number, who=CLIENT))
            if refused := self._refusal_reason(answer):
                return refused
            over = await self.wait_until(lambda: not (controller.slewing or controller.wanted.goto_pending), timeout)
        finally:
            if not over:
                await self.ask(requests.CancelRequest(number))
        return ""

    async def pulse(self, direction: op.Direction, ms: int) -> None:
        """Send a guide pulse, as a guiding program does; a refusal is ignored."""
        await self.ask(replace(pack_operation(op.Pulse(direction, ms), requests.new_request_number()), who=CLIENT))

    def _refusal_reason(self, answer: requests.Answer) -> str:
        """Return why a request was refused, else "". Raises StageEnded if the mount is silent or others act on it."""
        if answer.is_ok:
            return ""
        self.raise_if_stage_ends()
        if answer.fault == NoAnswer.__name__:
            raise StageEnded("the mount has not acknowledged an order")
        self.is_moving = False
        return answer.text

    def speed_of_key(self, key: int) -> float:
        """Return the speed of a rate key on this model, degrees a second."""
        fastest = float(getattr(self.driver, "model_facts", {}).get("max_rate", inf))
        return min(self.driver.speed(op.Rate(key=key)), fastest)

    # --- what a position means ----------------------------------------------------------------------------------------

    @property
    def angle_steps(self) -> Pair:
        """The steps of the two reported angles, degrees; for a network server, the smallest observed changes."""
        return self.driver.angle_steps if self.driver.protocol.name in streams() else (self._steps[0], self._steps[1])

    def _add_position(self) -> None:
        """Record the latest position and the smallest observed step."""
        if (place := self.position) is None:
            return
        self._positions.append(place)
        before = self._positions[-2:][0].position
        for number, change in enumerate((wrap180(place.position.ra - before.ra), place.position.dec - before.dec)):
            if abs(change) > ROUNDING_ERROR:
                self._steps[number] = min(self._steps[number], max(FINEST_STEP, abs(change)))

    def axis_angles(self, position: TimedPosition) -> Pair:
        """Return the angles of the axes: hour angle and declination, or azimuth and altitude. Raises StageEnded."""
        if self._lst_epoch is None:
            try:
                self._lst_epoch = self.now(), self.controller.astrometry.sidereal_time()
            except Fault:
                if not self.status.equatorial:
                    raise StageEnded("the site is not known: without it an alt-az mount cannot be measured") from None
                self._lst_epoch = self.now(), 0.0
        hour_angle = self._lst_epoch[1] + SIDEREAL_RATE * (position.at - self._lst_epoch[0]) - position.position.ra
        if self.status.equatorial or self.driver.moves_by_gotos:
            return hour_angle, position.position.dec
        return hour_angle_to_horizon(hour_angle, position.position.dec, self.controller.astrometry.site().latitude)

    def axis_turns(self, before: TimedPosition, after: TimedPosition) -> Pair:
        """Return how far both axes have turned relative to the ground."""
        (first, second), (then, second_end) = self.axis_angles(before), self.axis_angles(after)
        return wrap180(then - first), second_end - second

    def drift(self, before: TimedPosition, after: TimedPosition) -> float:
        """Return the motion between two positions that tracking, on or off, does not explain, degrees."""
        return unexplained_motion(before.position, after.position, after.at - before.at)

    def distance_moved(self, before: TimedPosition, after: TimedPosition, tracks: bool) -> float:
        """Return the angle between two positions: on the sky if the mount tracks, else relative to the ground."""
        passed = 0.0 if tracks else SIDEREAL_RATE * (after.at - before.at)
        return separation(before.position.ra + passed, before.position.dec, after.position.ra, after.position.dec)
