"""``Mount``: one mount for Python programs, whether its gateway runs in this process or in another one.

Every method is one request, or several in a row. They are passed to the gateway in this process, or to the control
endpoint of another process. So limits, checks and errors are the same in both cases.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import cast

import msgspec
from msgspec.structs import replace

from gateway.app.control.operations import answer_of, checked_copy, pack_operation
from gateway.app.discovery.served import CONSOLE_PROTOCOL
from gateway.app.status import State
from gateway.core import errors, requests
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Stopped, UserError
from gateway.core.motion_kinds import GOTOS
from gateway.core.operations import AnswerT

#: Sends a request and returns its answer; the number is how many seconds the request itself lasts.
Send = Callable[[requests.Request, float], Awaitable[requests.Answer]]
#: Seconds between two checks whether a motion has ended, and whether the mount has identified itself.
PROGRESS_PERIOD, STATE_RETRY_PERIOD = 0.25, 0.1
#: Timeouts in seconds: for a mount to identify itself, and for a silent mount whose motion is awaited.
IDENTIFY_TIMEOUT, SILENCE_TIMEOUT = 20.0, 10.0
#: What to look at if a mount is silent.
CABLE_ADVICE = "Is it switched on, and the cable in the hand control? mount-gateway detect looks for it on every port."


class Mount:
    """A mount. Made by ``open_gateway`` and ``connect``; ``name`` is the mount's name, or else its endpoint.

    Positions are right ascension and declination of the equinox of date, in degrees. Every method raises ``Fault`` if
    the gateway or the mount refuses (its text is one sentence for the user), and ``NoAnswer``, a kind of ``Fault``, if
    either does not answer. ``BlockingMount`` has the same methods for programs without an event loop.
    """

    def __init__(self, name: str, send_request: Send, client_name: str) -> None:
        self.name = name
        self._send_request, self._client_name = send_request, client_name
        #: All operations but gotos have this one request number, so that each of them keeps a motion by hand alive.
        self._operation_number = requests.new_request_number()
        #: The number of the last request for a goto, park or home; empty before the first, and after ``arrived``.
        self._goto_number = ""

    # --- what is known ------------------------------------------------------------------------------------------------

    async def ready(self, seconds: float = IDENTIFY_TIMEOUT) -> None:
        """Wait until the mount answers and has reported its identity and status.

        Raises NoAnswer after ``seconds``, and UserError at once if the mount's port cannot be opened.
        """
        now = asyncio.get_running_loop().time
        end = now() + seconds
        while (state := await self._get_state(fresh=False)).look.status is None or not state.look.online:
            if state.unopened:
                raise UserError(state.unopened)
            if now() >= end:
                raise NoAnswer(f"{self.name} has not answered within {seconds:g} s. {CABLE_ADVICE}")
            await asyncio.sleep(min(STATE_RETRY_PERIOD, max(0.0, end - now())))

    async def addresses(self) -> list[str]:
        """Return the surfaces as ``PROTOCOL:MODEL@WHERE``, each with the TCP port that was really opened."""
        return [
            f"{surface.name}@{surface.at}"
            for surface in (await self._get_state(fresh=False)).served
            if surface.name != CONSOLE_PROTOCOL
        ]

    async def status(self) -> State:
        """Ask the mount, for at most 1.5 s, and return its state: what ``mount-gateway status --json`` shows."""
        return await self._get_state(fresh=True)

    async def position(self) -> tuple[float, float]:
        """Return where the telescope points: right ascension in [0, 360), declination in [-90, 90]."""
        position = await self.perform(op.Position())
        return position.ra, position.dec

    async def moving(self) -> bool:
        """Return whether the mount moves, except by tracking and guiding, or is not yet seen at rest after a motion.

        Raises NoAnswer if that is not known, because the mount has not reported its position since a motion was ended.
        """
        look = (await self._get_state(fresh=False)).look
        if look.unknown:
            raise NoAnswer("It is not known whether the mount moves: it has not reported its position.")
        return look.moves

    async def site(self) -> op.Place:
        """Return the site in use: the mount's, a program's or the configured one. Raises Unsupported if unknown."""
        return await self.perform(op.GetSite())

    async def time(self) -> op.Moment:
        """Return the time of the best clock: the mount's, a program's, or this computer's."""
        return await self.perform(op.GetClock())

    # --- motion -------------------------------------------------------------------------------------------------------

    async def goto(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Slew to a position and track it; return when the mount has accepted the goto. All limits apply.

        ``j2000``: the position is of the equinox J2000, as in catalogues. Raises Invalid for a bad number.
        """
        await self._get_answer_text(requests.GotoRequest(_target_of(op.Goto(ra, dec), j2000)))

    async def goto_object(self, name: str) -> None:
        """Slew to a planet, star or other object as ``goto`` does. Raises UserError for a name that is not known."""
        await self._get_answer_text(requests.GotoRequest(checked_copy(requests.Named(name))))

    async def park(self) -> None:
        """Slew to the park position and turn tracking off; return when the mount has accepted the command."""
        await self._get_answer_text(requests.ParkRequest())

    async def unpark(self) -> None:
        """Unpark the mount, or wake it, so that it tracks."""
        await self._get_answer_text(requests.UnparkRequest())

    async def arrived(self, seconds: float = 300.0) -> tuple[float, float]:
        """Wait until the goto, park or home of this program has ended, and return the position.

        If this program has begun none, wait until none is under way. Raises Stopped with the reason if the motion ended
        before its goal (also before the call), TimeoutError after ``seconds``, NoAnswer after 10 s without an answer.
        """
        now = asyncio.get_running_loop().time
        last_heard, reason = now(), ""
        try:
            async with asyncio.timeout(seconds):
                while await self._is_goto_under_way():
                    look = (await self._get_state(fresh=False)).look
                    if look.online:
                        last_heard, reason = now(), ""
                    else:
                        reason = look.reason or "the mount does not answer"
                    if now() - last_heard > SILENCE_TIMEOUT:
                        raise NoAnswer(f"It is not known whether the motion goes on: {reason}.")
                    await asyncio.sleep(PROGRESS_PERIOD)
        except TimeoutError:
            ending = f", and it is not known whether it goes on: {reason}." if reason else "; it goes on."
            raise TimeoutError(f"The motion has not ended within {seconds:g} s{ending}") from None
        if not self._goto_number and (short := (await self.perform(op.GetActivity())).short):
            raise Stopped(short)
        self._goto_number = ""
        return await self.position()

    async def _is_goto_under_way(self) -> bool:
        if self._goto_number:
            return (await self._get_answer(requests.ProgressRequest(self._goto_number))).outcome == requests.UNDER_WAY
        return await self.perform(op.Slewing())

    async def sync(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Sync the mount: it points at this position now. Raises SyncTooFar beyond ``sync_limit``."""
        await self._get_answer_text(requests.SyncRequest(_target_of(op.Sync(ra, dec), j2000)))

    async def move(self, direction: op.Direction, key: int, seconds: float) -> None:
        """Press an arrow at hand-control rate ``key``, 1 to 9; return after ``seconds``; the gateway releases it."""
        await self._get_answer_text(requests.MoveRequest(direction=direction, key=key, seconds=seconds), seconds)

    async def stop(self) -> None:
        """End every motion of any client at once, also one not begun yet; return when the mount is seen at rest."""
        await self._get_answer(requests.StopRequest(self._client_name))

    async def hold(self) -> None:
        """Stop the mount, and let nothing move it until ``release``, even after a restart of the gateway."""
        await self._get_answer(requests.HoldRequest(self._client_name))

    async def release(self) -> None:
        """End ``hold``: the mount may be moved again."""
        await self._get_answer(requests.ReleaseHoldRequest(self._client_name))

    # --- any operation ------------------------------------------------------------------------------------------------

    async def perform(self, operation: op.Operation[AnswerT]) -> AnswerT:
        """Carry out any operation of ``gateway.op`` and return its answer; the docstring of the operation describes it.

        A motion that ``Move`` began ends if the program does not call ``perform`` for ``dead_man`` seconds. Raises
        Invalid if the argument is no operation, or a field has a wrong type or value.
        """
        is_goto = isinstance(operation, GOTOS)
        request = pack_operation(operation, requests.new_request_number() if is_goto else self._operation_number)
        answer = await self._get_answer_text(request)
        if is_goto:
            self._goto_number = request.number
        return answer_of(operation, answer)

    # --- requests -----------------------------------------------------------------------------------------------------

    async def _get_state(self, fresh: bool) -> State:
        return msgspec.json.decode((await self._get_answer(requests.StateRequest(fresh))).text, type=State)

    async def _get_answer_text(self, request: requests.ChangeRequest, duration: float = 0.0) -> str:
        """Send a request, and return the text of the answer. Raises Fault."""
        named = cast(requests.Request, checked_copy(replace(request, who=self._client_name)))
        text = (await self._get_answer(named, duration)).text
        if isinstance(request, requests.GotoRequest | requests.ParkRequest):
            self._goto_number = request.number
        return text

    async def _get_answer(self, request: requests.Request, duration: float = 0.0) -> requests.Answer:
        answer = await self._send_request(request, duration)
        if answer.outcome == requests.FAILED:
            raise getattr(errors, answer.fault or NoAnswer.__name__, Fault)(answer.text)
        return answer


def _target_of(operation: op.Goto | op.Sync, j2000: bool) -> requests.Spot:
    operation = checked_copy(operation)
    return requests.Spot(operation.ra % 360.0, operation.dec, bool(j2000))
