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
from typing import Concatenate, Literal, ParamSpec, TypeVar

from gateway.app.control.exchange import ControlEndpoint
from gateway.app.control.reach import ANSWERED, ask_state, request, running
from gateway.app.status import OLD_AFTER, State
from gateway.core import errors, requests
from gateway.core.errors import Fault, Invalid, NoAnswer, UserError
from gateway.core.operations import Direction

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
        self._who = f"a Python program (process {os.getpid()})"
        #: The number of the last request for a motion towards a goal.
        self._goal = ""

    @property
    def name(self) -> str:
        """The mount's name, or the port it is at if it has none."""
        return self._endpoint.name or self._endpoint.mount

    async def status(self) -> State:
        """Return all that is known of the mount, newly read: what ``mount-gateway status --json`` shows."""
        state = await ask_state(self._endpoint)
        if not isinstance(state, State):
            raise NoAnswer(state.words)
        return state

    async def position(self) -> tuple[float, float]:
        """Return where the telescope points. Raises NoAnswer if the mount has not told so lately."""
        look = (await self.status()).look
        if look.position is None or look.age > OLD_AFTER:
            raise NoAnswer(f"The mount has not told where it points{': ' * bool(look.reason)}{look.reason}.")
        return look.position.ra, look.position.dec

    async def moving(self) -> bool:
        """Return whether the mount moves for any reason but tracking and guiding. Raises NoAnswer if it is unknown."""
        look = (await self.status()).look
        if look.unknown:
            raise NoAnswer("It is not known whether the mount moves: it has not reported its position.")
        return look.moves

    async def goto(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Slew to a position and track it; return when the mount has accepted the goto."""
        await self._begin(requests.Goto(requests.new_number(), _spot(ra, dec, j2000), who=self._who))

    async def goto_object(self, name: str) -> None:
        """Slew to a planet, star or other object as ``goto`` does. Raises UserError for a name that is not known."""
        from gateway.app.control import objects  # loads the catalogues

        where = await asyncio.to_thread(objects.find, name)
        await self._begin(requests.Goto(requests.new_number(), where, who=self._who))

    async def park(self) -> None:
        """Slew to the park position and turn tracking off; return when the mount has accepted it."""
        await self._begin(requests.Park(requests.new_number(), who=self._who))

    async def home(self) -> None:
        """Slew to the home position; return when the mount has accepted it."""
        await self._begin(requests.Home(requests.new_number(), who=self._who))

    async def arrived(self, seconds: float = 300.0) -> tuple[float, float]:
        """Wait until the last goto, park or home of this program has ended, or without one until the mount is at rest.

        Return the position. Raises Stopped if it ended before its goal, and TimeoutError if it takes longer.
        """
        try:
            async with asyncio.timeout(seconds):
                while (
                    (await self._ask(requests.Follow(self._goal))).outcome == requests.UNDER_WAY
                    if self._goal
                    else await self.moving()
                ):
                    await asyncio.sleep(LOOK)
        except TimeoutError:
            raise TimeoutError(f"The motion has not ended within {seconds:g} s; it goes on.") from None
        return await self.position()

    async def _under_way(self) -> bool:
        return (await self._ask(requests.Follow(self._goal))).outcome == requests.UNDER_WAY

    async def sync(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Tell the mount that it points at this position now. Raises SyncTooFar beyond ``sync_limit``."""
        await self._ask(requests.Sync(requests.new_number(), _spot(ra, dec, j2000), who=self._who))

    async def unpark(self) -> None:
        """Take a parked or sleeping mount up again: it tracks."""
        await self._ask(requests.Unpark(requests.new_number(), who=self._who))

    async def move(self, direction: Direction, key: int, seconds: float) -> None:
        """Press an arrow for some seconds, at the rate of the hand control's key 1 to 9; return when that is over.

        The gateway itself releases it, whatever becomes of this program.
        """
        await self._ask(requests.Move(requests.new_number(), direction, key, seconds, who=self._who), seconds)

    async def track(self, on: bool = True, rate: Literal["sidereal", "lunar", "solar"] | None = None) -> None:
        """Turn tracking on or off; optionally set its rate."""
        await self._ask(requests.Track(requests.new_number(), on, rate, who=self._who))

    async def set_site(self, latitude: float, longitude: float) -> None:
        """Set the mount's site, north and east positive."""
        await self._ask(requests.TellSite(requests.new_number(), latitude, longitude, who=self._who))

    async def set_time(self, unix: float, offset: float) -> None:
        """Set the mount's clock: UTC as Unix seconds, and local time minus UTC in hours."""
        await self._ask(requests.TellTime(requests.new_number(), unix, offset, who=self._who))

    async def stop(self) -> None:
        """End every motion, whoever began it; return when the mount is seen at rest."""
        await self._ask(requests.Stop())

    async def hold(self) -> None:
        """Stop, and let nothing move the mount until ``release``, over restarts of the gateway too."""
        await self._ask(requests.Hold())

    async def release(self) -> None:
        """End a hold."""
        await self._ask(requests.Release())

    async def _begin(self, motion: requests.Goto | requests.Park | requests.Home) -> None:
        await self._ask(motion)
        self._goal = motion.number

    async def _ask(self, wish: requests.Request, lasting: float = 0.0) -> requests.Answer:
        """Send a request and return the answer. Raises the Fault that it names."""
        try:
            requests.decode(requests.encode(wish))
        except (TypeError, ValueError) as error:
            raise Invalid(f"{type(wish).__name__}: {error}.") from None
        answer = await request(self._endpoint, wish, ANSWERED + lasting)
        if answer.outcome == requests.FAILED:
            raise getattr(errors, answer.fault, Fault)(answer.words)
        return answer


def _spot(ra: float, dec: float, j2000: bool) -> requests.Spot:
    try:
        return requests.Spot(float(ra) % 360.0, float(dec), j2000)
    except (TypeError, ValueError):
        raise Invalid("Right ascension and declination are numbers, in degrees.") from None


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
    moving = _waits(ConnectedGateway.moving)
    goto = _waits(ConnectedGateway.goto)
    goto_object = _waits(ConnectedGateway.goto_object)
    park = _waits(ConnectedGateway.park)
    home = _waits(ConnectedGateway.home)
    arrived = _waits(ConnectedGateway.arrived)
    sync = _waits(ConnectedGateway.sync)
    unpark = _waits(ConnectedGateway.unpark)
    move = _waits(ConnectedGateway.move)
    track = _waits(ConnectedGateway.track)
    set_site = _waits(ConnectedGateway.set_site)
    set_time = _waits(ConnectedGateway.set_time)
    stop = _waits(ConnectedGateway.stop)
    hold = _waits(ConnectedGateway.hold)
    release = _waits(ConnectedGateway.release)

    @property
    def name(self) -> str:
        """As in ``ConnectedGateway``."""
        return self._gateway.name


def connect_blocking(mount: str | None = None, *, state: str | None = None) -> BlockingConnectedGateway:
    """Find a gateway as ``connect`` does, for a program without an event loop."""
    return BlockingConnectedGateway(connect(mount, state=state))
