"""A complete gateway in one process on virtual time, with clients at one end and a simulated mount at the other.

The gateway is real, but it has no ports, no files and no watchdog. The bytes that the simulated mount receives are
recorded at the mount, independently of the gateway's log.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Self

from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.simulated import DEFAULT_SITE, make_simulator
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import AccessRules
from gateway.core.waiting import TimedEvent
from gateway.core.wire_log import Entry, WireLog
from gateway.mount.link.line import MountLink
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.registry import protocol_pairs
from gateway.transport.handler import NewConnection
from gateway.transport.wires import SimulatedConnection, SimulatedTransport

#: The default protocols of the surface and the mount.
DEFAULT_SURFACE, DEFAULT_MOUNT = protocol_pairs()[0]


class RehearsalGateway:
    """A gateway with a simulated mount ``sim``; ``client()`` opens a connection. It must be made in an event loop.

    ``start`` is Unix time. With ``ramps`` False the motors change their speed at once. ``on`` is an earlier rehearsal
    whose simulated mount is used again. With ``named`` the gateway is given the mount's model and version, as by the
    command line; else its driver identifies the mount.
    """

    def __init__(
        self,
        mount: str | None,
        version: str | None = None,
        *,
        start: float,
        driven: str = DEFAULT_MOUNT,  # the protocol of the mount
        presented: str = DEFAULT_SURFACE,  # the protocol of the surface
        surface: str | None = None,  # the model that the surface presents
        surface_version: str | None = None,
        site: tuple[float, float] = DEFAULT_SITE,
        latency: float = 0.05,
        aligned: bool = True,
        speed: float = 1.0,  # a factor: how much faster than real the mount slews
        config: dict[str, Any] | None = None,  # keys of [mount] in gateway.toml
        host_ahead: float = 0.0,  # seconds by which the computer's clock is ahead
        on: RehearsalGateway | None = None,  # a former rehearsal, to use its mount again
        access: AccessRules = AccessRules(),
        ramps: bool = True,
        sky: Sky | None = None,
        named: bool = False,  # whether the gateway is given model and version
        simulated: dict[str, Any] | None = None,  # further settings of the simulator
    ) -> None:
        loop = asyncio.get_running_loop()
        self._start_time: float = loop.time() if on is None else on._start_time
        self.clock: Callable[[], float] = lambda: start + loop.time() - self._start_time
        self.pc_time: Callable[[], float] = lambda: self.clock() + host_ahead  # the computer's clock
        endpoint = Endpoint(driven, "sim", mount, version)
        settings = {"site": site, "aligned": aligned, "speed": speed, "ramps": ramps, **(simulated or {})}
        self.sim: Simulated = on.sim if on else make_simulator(endpoint, clock=self.clock, **settings)
        self.wire_log = WireLog(self.clock)
        self.entries: list[Entry] = []
        self.wire_log.sinks.append(self.entries.append)
        known = MountConfig(at=str(endpoint if named else Endpoint(driven, "sim")), speed=speed, **(config or {}))
        shown = SurfaceConfig(at=str(Endpoint(presented, "-", surface, surface_version)))
        self.gateway = Gateway(known, [shown], self.wire_log, sky, self.pc_time)
        self.open_state_store()
        self.rx_data: list[bytes] = []  # what the mount has received
        wire = SimulatedTransport("sim", self._recorded_connection(self.sim.connection), latency)
        self.gateway.prepare(lambda reply_rules, wire_log: MountLink(wire, reply_rules, wire_log))
        self.controller = self.gateway.controller
        self.driver, self.site_clock = self.controller.driver, self.controller.site_clock
        [made] = self.gateway.acceptors
        assert isinstance(made, ConnectionAcceptor)
        self.binding, self.shared_state = made.binding, made.shared_state
        self.acceptor = ConnectionAcceptor(self.controller, self.binding, self.shared_state, self.clock, access=access)

    def open_state_store(self) -> None:
        """Do nothing: a rehearsal has no saved state. Subclasses may open a state store."""

    def _recorded_connection(self, connect: SimulatedConnection) -> SimulatedConnection:
        """Return a connection to the mount that records the bytes sent to the mount."""

        def connection(send_later: Callable[[float, bytes], None]) -> Callable[[bytes], bytes]:
            feed = connect(send_later)

            def record_and_answer(data: bytes) -> bytes:
                self.rx_data.append(data)
                answer: bytes = feed(data)
                return answer

            return record_and_answer

        return connection

    async def __aenter__(self) -> Self:
        self.controller.start()
        await self.controller.site_read.wait()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.controller.close()

    def client(self, host: str = "127.0.0.1") -> RehearsalClient:
        return RehearsalClient(self, host)

    def sent_requests(self) -> list[bytes]:
        """Return every request that the gateway has sent to the mount, by its log."""
        return [entry.data for entry in self.entries if entry.side == "mount" and entry.arrow == ">"]


class RehearsalClient:
    """A connection of a client to a rehearsal gateway; ``received`` are the bytes of its replies."""

    def __init__(self, rehearsal: RehearsalGateway, host: str) -> None:
        self.received = b""
        self._received_event = TimedEvent()
        self.connection = rehearsal.acceptor.accept(NewConnection(host, host, self._on_received))

    def _on_received(self, data: bytes) -> None:
        self.received += data
        self._received_event.set()

    @property
    def all_answered(self) -> bool:
        """Whether all commands that have a reply were answered."""
        return bool(self.connection.all_answered)

    async def ask(self, data: bytes, timeout: float = 10.0, *, ending: bytes = b"") -> bytes:
        """Send bytes; return the reply as soon as it ends with ``ending``, or what came in ``timeout`` seconds."""
        self.received = b""
        self.connection.feed(data)
        loop = asyncio.get_running_loop()
        end = loop.time() + timeout
        while not self.received or not self.received.endswith(ending):
            self._received_event.clear()
            if not await self._received_event.wait_within(end - loop.time()):
                break
        return self.received

    def send(self, data: bytes) -> None:
        """Send bytes without waiting for a reply."""
        self.connection.feed(data)

    def close(self) -> None:
        self.connection.close()
