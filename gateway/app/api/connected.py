"""A gateway that runs already, as a service or in another program, asked from Python.

``connect`` finds it as ``mount-gateway goto`` does. Every method is one request to it, to which its limits apply; a
refusal is the same error as in ``RunningGateway``. Nothing stays open between two requests, and nothing ends with the
program that asks: what it has begun goes on.
"""

from __future__ import annotations

import asyncio
import functools
import os
from collections.abc import Callable, Coroutine
from typing import Concatenate, ParamSpec, TypeVar

from msgspec.structs import replace

from gateway.app.api.arrival import until_over
from gateway.app.api.checks import checked_request, find, spot
from gateway.app.control.exchange import ControlEndpoint
from gateway.app.control.reach import ANSWERED, ask_state, running
from gateway.app.control.reach import request as send
from gateway.app.status import OLD_AFTER, State, StatusLine
from gateway.core import errors, requests
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, UserError

_P = ParamSpec("_P")
_T = TypeVar("_T")
#: Seconds between two questions whether a motion has ended.
LOOK = 0.5


class ConnectedGateway:
    """The mount of a gateway that runs already. Made by ``connect``.

    Positions are right ascension and declination of the equinox of date, in degrees. Every method raises ``Fault`` if
    the gateway or the mount refuses, and ``NoAnswer`` if the gateway does not answer. ``BlockingConnectedGateway`` has
    the same methods for programs without an event loop.
    """

    def __init__(self, endpoint: ControlEndpoint) -> None:
        self._endpoint = endpoint
        #: The number of the last request for a motion towards a goal.
        self._goal = ""

    @property
    def name(self) -> str:
        """The mount's name, or the port it is at if it has none."""
        return self._endpoint.title

    async def status(self) -> State:
        """Return all that is known of the mount, newly read: what ``mount-gateway status --json`` shows."""
        return await self._state(fresh=True)

    async def _state(self, fresh: bool) -> State:
        state = await ask_state(self._endpoint, fresh)
        if not isinstance(state, State):
            raise NoAnswer(state.words)
        return state

    async def position(self) -> tuple[float, float]:
        """Return where the telescope points. Raises NoAnswer if the mount has not told so lately."""
        look = (await self.status()).look
        if look.position is None or look.age > OLD_AFTER:
            raise NoAnswer(f"The mount has not told where it points{': ' * bool(look.reason)}{look.reason}.")
        return look.position.ra, look.position.dec

    async def goto(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Slew to a position and track it; return when the mount has accepted the goto."""
        await self.ask(requests.Goto(spot(op.Goto(ra, dec), j2000)))

    async def goto_object(self, name: str) -> None:
        """Slew to a planet, star or other object as ``goto`` does. Raises UserError for a name that is not known."""
        await self.ask(requests.Goto(await find(name)))

    async def arrived(self, seconds: float = 300.0) -> tuple[float, float]:
        """Wait until the last goto, park or home of this program has ended, and return the position.

        Raises Stopped if it ended before its goal, TimeoutError if it takes longer, and NoAnswer if the mount is lost
        meanwhile.
        """

        async def under_way() -> bool:
            if not self._goal:
                return False
            return (await self._answer(requests.Follow(self._goal))).outcome == requests.UNDER_WAY

        async def look() -> StatusLine:
            return (await self._state(fresh=False)).look

        await until_over(under_way, look, seconds, LOOK)
        return await self.position()

    async def sync(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Tell the mount that it points at this position now. Raises SyncTooFar beyond ``sync_limit``."""
        await self.ask(requests.Sync(spot(op.Sync(ra, dec), j2000)))

    async def park(self) -> None:
        """Slew to the park position and turn tracking off; return when the mount has accepted it."""
        await self.ask(requests.Park())

    async def stop(self) -> None:
        """End every motion, whoever began it; return when the mount is seen at rest."""
        await self.ask(requests.Stop())

    async def ask(self, request: requests.Request) -> str:
        """Have any request of ``gateway.core.requests`` carried out, and return the gateway's words for it."""
        request = checked_request(request)
        if isinstance(request, requests.Base) and not request.who:
            request = replace(request, who=f"a Python program (process {os.getpid()})")
        words = (await self._answer(request)).words
        if isinstance(request, requests.Goto | requests.Park | requests.Home):
            self._goal = request.number
        return words

    async def _answer(self, request: requests.Request) -> requests.Answer:
        """Send a request and return the answer. Raises the Fault that it names."""
        lasting = request.seconds if isinstance(request, requests.Move) else 0.0
        answer = await send(self._endpoint, request, ANSWERED + lasting)
        if answer.outcome == requests.FAILED:
            raise getattr(errors, answer.fault, Fault)(answer.words)
        return answer


def connect(mount: str | None = None, *, state: str | None = None) -> ConnectedGateway:
    """Find a gateway that runs on this computer, and return its mount; its methods are awaited.

    ``mount`` is its name, or its port; it may be left out where only one runs. ``state`` is a gateway's state folder,
    where that was named. Raises UserError if none runs, or several do.
    """
    found = running(mount, state)
    if not found:
        raise UserError(f"no gateway runs here{f' for {mount}' if mount else ''}; mount-gateway run starts one")
    gateways = [ConnectedGateway(endpoint) for endpoint in found]
    if len(gateways) > 1:
        names = ", ".join(sorted(gateway.name for gateway in gateways))
        raise UserError(f"{len(gateways)} mounts run here; say which one is meant: {names}")
    return gateways[0]


def _waits(
    method: Callable[Concatenate[ConnectedGateway, _P], Coroutine[object, object, _T]],
) -> Callable[Concatenate[BlockingConnectedGateway, _P], _T]:
    """Return a method of ``ConnectedGateway`` as one that waits for its result."""

    @functools.wraps(method)
    def waits(self: BlockingConnectedGateway, /, *arguments: _P.args, **named: _P.kwargs) -> _T:
        return asyncio.run(method(self._gateway, *arguments, **named))

    return waits


class BlockingConnectedGateway:
    """The mount of a gateway that runs already, whose methods wait. Made by ``connect_blocking``."""

    def __init__(self, gateway: ConnectedGateway) -> None:
        self._gateway = gateway

    status = _waits(ConnectedGateway.status)
    position = _waits(ConnectedGateway.position)
    goto = _waits(ConnectedGateway.goto)
    goto_object = _waits(ConnectedGateway.goto_object)
    park = _waits(ConnectedGateway.park)
    arrived = _waits(ConnectedGateway.arrived)
    sync = _waits(ConnectedGateway.sync)
    stop = _waits(ConnectedGateway.stop)
    ask = _waits(ConnectedGateway.ask)

    @property
    def name(self) -> str:
        """As in ``ConnectedGateway``."""
        return self._gateway.name


def connect_blocking(mount: str | None = None, *, state: str | None = None) -> BlockingConnectedGateway:
    """Find a gateway as ``connect`` does, for a program without an event loop."""
    return BlockingConnectedGateway(connect(mount, state=state))
