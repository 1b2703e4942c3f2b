"""A whole gateway in one process on virtual time, with a client at one end and a simulated mount at the other.

The parts are those of a real gateway, put together as ``app/gateway.py`` does; only ports, files and the watchdog are
missing. ``wire`` is what the mount itself received, taken at its end of the line and not from the gateway's records.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Self

from msgspec.structs import replace

from gateway.app.bindings import make_driver, make_surface, own_face, policy, shows_itself
from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.app.simulated import DEFAULT_SITE, make_simulator
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import Access
from gateway.clients.profiles import J2000, SurfaceBinding
from gateway.core import operations as op
from gateway.core.waiting import TimedEvent
from gateway.core.wire_log import Entry, WireLog
from gateway.mount.controller import MountController
from gateway.mount.link.line import MountLink
from gateway.mount.site.site_clock import SiteClock
from gateway.protocols.base.driver import Driver
from gateway.protocols.base.session import Shared
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.registry import pairs
from gateway.transport.wires import Connection, SimulatedTransport

#: Who speaks to whom where nobody says otherwise.
PRESENTED, DRIVEN = pairs()[0]


class Stage:
    """``sim`` is the simulated mount, ``controller`` the gateway's, ``client()`` a new connection. Needs a running
    loop.

    ``start`` is Unix time; ``ramps`` False is a mount whose motors change their speed at once; ``on`` a stage that has
    ended, whose mount is used again; ``simulated`` are further settings of the simulator. The driver finds out which
    mount it is, and where it is ``named`` it was told before, as on a command line.
    """

    def __init__(
        self,
        mount: str | None,
        version: str | None = None,
        *,
        start: float,
        driven: str = DRIVEN,
        presented: str = PRESENTED,
        surface: str | None = None,
        surface_version: str | None = None,
        site: tuple[float, float] = DEFAULT_SITE,
        latency: float = 0.05,
        aligned: bool = True,
        speed: float = 1.0,
        config: dict[str, Any] | None = None,
        host_ahead: float = 0.0,
        on: Stage | None = None,
        access: Access = Access(),
        ramps: bool = True,
        sky: Sky | None = None,
        named: bool = False,
        simulated: dict[str, Any] | None = None,
    ) -> None:
        loop = asyncio.get_running_loop()
        self._began: float = loop.time() if on is None else on._began
        self.clock: Callable[[], float] = lambda: start + loop.time() - self._began
        self.host: Callable[[], float] = lambda: self.clock() + host_ahead
        self.settings = MountConfig(at="-", **(config or {}))
        endpoint = Endpoint(driven, "sim", mount, version)
        self.sim: Simulated = (
            on.sim
            if on
            else make_simulator(
                endpoint, clock=self.clock, site=site, aligned=aligned, speed=speed, ramps=ramps, **(simulated or {})
            )
        )
        self.wire_log = WireLog(self.clock)
        self.entries: list[Entry] = []
        self.wire_log.sinks.append(self.entries.append)
        known = endpoint if named else Endpoint(driven, "sim")
        driver, follow_ups, dialogue = make_driver(known, self.settings, loop.time)
        self.driver: Driver = driver
        driver.hurry = speed
        self.wire: list[bytes] = []
        line = MountLink(
            SimulatedTransport("sim", self._listening(self.sim.connection), latency), dialogue, self.wire_log
        )
        given = self.settings.site
        self.site_clock = SiteClock(loop.time, self.host, op.Place(*given) if given else None)
        self.controller = MountController(
            driver, follow_ups, line, sky or Sky(), self.site_clock, self.wire_log, policy(self.settings)
        )
        shown = Endpoint(presented, "-", surface, surface_version)
        self.face: SurfaceBinding = make_surface(shown, SurfaceConfig(at="-"), self.settings.limits)
        self.face.surface.verbatim = presented == driven
        if self.face.counts_in == "j2000":
            self.face = replace(self.face, equinox=J2000(self.controller.astrometry.sky, self.site_clock.unix))
        if shows_itself(Endpoint(driven, "sim"), shown):
            self.controller.identification.told.connect(lambda _: own_face(self.controller, self.face))
        self.shared = self.remember()
        self.reception = ConnectionAcceptor(self.controller, self.face, self.shared, self.clock, access=access)

    def remember(self) -> Shared:
        """What all clients have in common: here nothing outlives the stage."""
        return Shared()

    def _listening(self, connect: Connection) -> Connection:
        """The same way into the mount, where what it is sent is noted."""

        def connection(later: Callable[[float, bytes], None]) -> Callable[[bytes], bytes]:
            feed = connect(later)

            def heard(data: bytes) -> bytes:
                self.wire.append(data)
                answer: bytes = feed(data)
                return answer

            return heard

        return connection

    async def __aenter__(self) -> Self:
        self.controller.start()
        await self.controller.settled.wait()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.controller.close()

    def client(self, host: str = "127.0.0.1") -> Visitor:
        return Visitor(self, host)

    def sent(self) -> list[bytes]:
        """Every request that went to the mount so far."""
        return [entry.data for entry in self.entries if entry.side == "mount" and entry.arrow == ">"]


class Visitor:
    """One connection."""

    def __init__(self, stage: Stage, host: str) -> None:
        self.heard = b""
        self._more = TimedEvent()
        self._guest = stage.reception.arrive(host, host, self._hear)

    def _hear(self, data: bytes) -> None:
        self.heard += data
        self._more.set()

    @property
    def answered(self) -> bool:
        """Whether everything said so far has been answered, as far as it is answered at all."""
        return bool(self._guest.answered)

    async def ask(self, data: bytes, seconds: float = 10.0, *, until: bytes = b"") -> bytes:
        """Send bytes and wait for the reply: up to ``until``, else for whatever comes first; b"" after ``seconds``."""
        self.heard = b""
        self._guest.feed(data)
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        while not self.heard or not self.heard.endswith(until):
            self._more.clear()
            if not await self._more.within(end - loop.time()):
                break
        return self.heard

    def tell(self, data: bytes) -> None:
        """Send bytes that have no reply."""
        self._guest.feed(data)

    def close(self) -> None:
        self._guest.close()
