"""A gateway inside another Python program.

``open_gateway`` does what ``mount-gateway run`` does for one mount: it opens the mount's port and the surfaces, starts
the watchdog process for a real mount, and stops the mount at the end. The embedding program gets the same limits,
refusals and command order as the clients of the surfaces. Everything runs on the caller's event loop; only the
tables of the sky are calculated by a process of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec.structs import replace

from gateway.app.api.arrival import until_over
from gateway.app.api.checks import checked, find
from gateway.app.api.own_goto import OwnGoto
from gateway.app.config import Source, make_config, parse_endpoint
from gateway.app.control.refusals import explain
from gateway.app.mount_state import mount_state
from gateway.app.status import StatusLine, format_position
from gateway.app.watchdog.client import Watchdog, available
from gateway.astro.ephemeris.keeper import AlmanacKeeper
from gateway.astro.ephemeris.sky import Sky
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Fault, NoAnswer, Stopped, TooHigh, UserError
from gateway.core.motion_kinds import GOTOS
from gateway.core.requests import Body
from gateway.core.wire_log import Entry, WireLog
from gateway.transport.web_server import WebServer

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

_T = TypeVar("_T")
#: Seconds between two checks whether a goto has ended.
LOOK = 0.25
#: Seconds that a mount may take to identify itself.
FIND_MOUNT = 20.0
#: What is asked before these operations, so that they wait for the mount's site if none is known yet.
NEEDS_SITE = (op.Zenith, op.MoonPlace, op.HorizontalPosition, op.GotoHorizontal, op.TubeSide)
#: What to look at if a mount is silent.
SILENT = "Is it switched on, and the cable in the hand control? mount-gateway detect looks for it on every port."
#: Keys that only ``mount-gateway run`` honours -> what does it here.
ONLY_RUN = {
    "wait": "ready(seconds) waits for the mount",
    "record": "mount-gateway run --record FILE records; watch is called with every command and reply",
    "record_keep": "mount-gateway run --record FILE records; watch is called with every command and reply",
}


class RunningGateway:
    """One mount whose surfaces are open. Made by ``open_gateway``.

    Positions are right ascension and declination of the equinox of date, in degrees. Every method that reaches the
    mount raises ``Fault`` if the operation is refused or fails; ``str(fault)`` is one sentence for the user.
    ``BlockingGateway`` has the same methods for programs without an event loop.
    """

    def __init__(self, gateway: Gateway) -> None:
        self._gateway, self._controller = gateway, gateway.controller
        self._host = self._controller.presence.connected("the program that embeds the gateway")
        self._goto = OwnGoto(self._controller.wanted, self._host)

    @property
    def addresses(self) -> list[str]:
        """The endpoints of the surfaces as ``PROTOCOL:MODEL@WHERE``, each with the TCP port that was really opened."""
        return self._gateway.names()

    async def ready(self, seconds: float = FIND_MOUNT) -> None:
        """Wait until the mount has identified itself.

        Raises NoAnswer if it has not within ``seconds``, and UserError at once if its port cannot be opened.
        """
        loop, line = asyncio.get_running_loop(), self._controller.line
        end = loop.time() + seconds
        while not await self._gateway.wait_identified(min(LOOK, max(0.0, end - loop.time()))):
            if line.unopened:
                raise UserError(self._gateway.taken or f"{self._gateway.title}: {line.unopened}")
            if loop.time() >= end:
                raise NoAnswer(f"{self._gateway.title} has not answered within {seconds:g} s. {SILENT}")

    async def position(self) -> tuple[float, float]:
        """Return where the telescope points: right ascension in [0, 360), declination in [-90, 90]."""
        position = await self.perform(op.Position())
        return position.ra, position.dec

    async def goto(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Slew to a position and track it; return when the mount has accepted the goto. All limits apply.

        ``j2000``: the position is one of a catalogue. Raises Invalid, which is a Fault, for what is no number, or no
        declination.
        """
        await self._point(op.Goto(ra, dec), j2000)

    async def goto_object(self, name: str) -> None:
        """Slew to a planet, star or other object as ``goto`` does. Raises UserError for a name that is not known."""
        stops = self._controller.stops
        where = await find(name)
        if isinstance(where, Body):
            with contextlib.suppress(Fault):  # the place of the Moon depends on the site
                await self.site()
        from gateway.app.control.requests import of_date  # loads all that carries out requests

        place = await of_date(self._controller, where)
        if self._controller.stops != stops:
            raise Stopped
        await self.perform(op.Goto(place.ra, place.dec))

    async def park(self) -> None:
        """Slew to the park position and turn tracking off; return when the mount has accepted it."""
        await self.perform(op.Park())

    async def _point(self, wanted: op.Goto | op.Sync, j2000: bool) -> None:
        place = await self.perform(op.ToEquinoxOfDate(wanted.ra, wanted.dec)) if j2000 else wanted
        await self.perform(replace(wanted, ra=place.ra % 360.0, dec=place.dec))

    async def arrived(self, seconds: float = 300.0) -> tuple[float, float]:
        """Wait until the goto or park of this program has ended, or if it has none under way until no program has one;
        return the position.

        Raises Stopped with the reason if the motion ended before its goal, also if that of this program did before this
        was called, TimeoutError if it has not ended within ``seconds``, and NoAnswer if the mount is lost meanwhile.
        """
        goto, stops = self._goto, None if self._goto.under_way else self._controller.stops

        async def under_way() -> bool:
            return not goto.replaced and await self.perform(op.Slewing())

        async def look() -> StatusLine:
            return mount_state(self._controller).look

        await until_over(under_way, look, seconds, LOOK)
        here = await self.position()
        if goto.why:
            raise Stopped(f"{goto.why}, at {format_position(op.Equatorial(*here))}.")
        if stops is not None and (stops != self._controller.stops or (not goto.known and self.ended_short)):
            raise Stopped(self.ended_short or None)
        return here

    @property
    def ended_short(self) -> str:
        """Why the last goto ended before its goal, in words, until the next one; empty if it did not."""
        return self._goto.why or self._controller.wanted.value.short

    async def moving(self) -> bool:
        """Return whether the mount moves for any reason but tracking and guiding, until its position shows it at rest.

        Raises NoAnswer if that is not known, because it has not reported its position since a motion was ended.
        """
        look = mount_state(self._controller).look
        if look.unknown:
            raise NoAnswer("It is not known whether the mount moves: it has not reported its position.")
        return look.moves

    async def sync(self, ra: float, dec: float, *, j2000: bool = False) -> None:
        """Tell the mount that it points at this position now. Raises SyncTooFar beyond ``sync_limit``."""
        await self._point(op.Sync(ra, dec), j2000)

    async def site(self) -> op.Place:
        """Return the site that counts, of the mount, a program or the settings. Raises Unsupported if none is known."""
        return await self.perform(op.GetSite())

    async def time(self) -> op.Moment:
        """Return the time by the clock that counts: that of the mount, of a program, or of this computer."""
        return await self.perform(op.GetClock())

    async def stop(self) -> None:
        """Stop every motion, ahead of all other commands; return when the mount has acknowledged the stop."""
        await self._controller.stop(self._host.who)

    async def perform(self, operation: op.Operation[_T]) -> _T:
        """Carry out any operation of ``gateway.core.operations`` and return its answer; see its docstring.

        A motion that ``Move`` began ends if the program calls ``perform`` no more for ``dead_man`` seconds. Raises
        Invalid for what is no operation, and for a field of a wrong type.
        """
        operation = checked(operation)
        if isinstance(operation, NEEDS_SITE):
            with contextlib.suppress(Fault):  # the operation says what is missing
                await self.site()
        self._host.sent_data = True  # the program is alive: a motion by hand that it has begun may continue
        try:
            return await self._controller.perform(operation, self._controller.stops, self._host)
        except (BelowHorizon, TooHigh) as fault:
            if not isinstance(operation, GOTOS):
                raise
            words = explain(fault, self._controller.policy.limits)
            raise type(fault)(words.replace("start the gateway with another --", "open it with another ")) from None


@contextlib.asynccontextmanager
async def open_gateway(
    mount: str,
    surfaces: str | Sequence[str | Mapping[str, object]] = (),
    *,
    warn: Callable[[str], None] | None = None,
    watch: Callable[[Entry], None] | None = None,
    watchdog: bool = True,
    **settings: object,
) -> AsyncIterator[RunningGateway]:
    """Open a mount (``"nexstar@/dev/ttyUSB0"``, ``"nexstar@sim"``) and the surfaces on which programs reach it, if any.

    ``settings`` are the keys of ``[mount]`` in docs/configuration.md with ``_`` for ``-``: ``site=(48.1, 11.6)``,
    ``lowest=15``. A surface is an endpoint such as ``"lx200@tcp://127.0.0.1:4030"`` (port 0: any free port), or a
    mapping of the keys of ``[[surface]]``. ``warn`` is called with whole sentences for the user, and ``watch`` with
    every entry of the wire log. Both are called on the event loop and must return quickly. Raises UserError for an
    invalid setting and for a surface that cannot be opened; the mount's port is waited for in ``ready``. Leaving the
    block stops the mount and closes everything.
    """
    for name in settings.keys() & ONLY_RUN:
        raise UserError(f"open_gateway: {name} is no setting of this function: {ONLY_RUN[name]}.")
    tables: dict[str, object] = {
        "mount": [_keys({"at": mount, **settings})],
        "surface": [
            _keys(surface if isinstance(surface, Mapping) else {"at": surface})
            for surface in ([surfaces] if isinstance(surfaces, str) else surfaces)
        ],
    }
    config = make_config(tables, Source("open_gateway"), served=False)
    from gateway.app.gateway import Gateway
    from gateway.app.site import load_site

    sky, wire_log = Sky(), WireLog(time.time)
    if watch is not None:
        wire_log.sinks.append(watch)
    real = parse_endpoint(mount).where != "sim"
    guard = Watchdog(warn or (lambda text: None)) if watchdog and real and available() else None
    opened = Gateway(config.mount[0], config.surface, wire_log, sky, warn=warn, watchdog=guard)
    opened.web = WebServer(lambda: load_site([opened]))

    almanac = AlmanacKeeper(sky, opened.warn, quiet=lambda: not opened.busy)
    almanac.open()
    keeping: asyncio.Task[None] | None = None
    try:
        await opened.open()
        if guard is not None:
            guard.start()
        for caution in opened.cautions():
            opened.warn(caution)
        keeping = asyncio.ensure_future(almanac.keep())
        yield RunningGateway(opened)
    finally:
        if keeping is not None:
            keeping.cancel()
        await opened.close()
        if guard is not None:
            guard.close()


def shown(opens: Any, returns: str) -> None:
    """Let ``help`` show what a function returns, where a decorator has changed that."""
    opens.__signature__ = inspect.signature(opens).replace(return_annotation=returns)


shown(open_gateway, "AbstractAsyncContextManager[RunningGateway]")


def _keys(settings: Mapping[str, object]) -> dict[str, object]:
    """Return keyword arguments under the key names of ``gateway.toml``."""
    return {name.replace("_", "-"): value for name, value in settings.items()}
