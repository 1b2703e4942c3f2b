"""Assembles one gateway: a mount, its controller, and the ports of its surfaces."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from gateway.app.bindings import (
    Acceptor,
    AcceptorFactory,
    configure_binding,
    exposure_warning,
    make_driver,
    make_transport,
    open_surface,
    policy_of,
    watch_mount,
)
from gateway.app.config import MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.config.endpoints import device_text
from gateway.app.config.programs import with_needs
from gateway.app.control.orders import carry_out_stop
from gateway.app.control.server import ControlServer
from gateway.app.discovery.offer import reachable_networks
from gateway.app.mount_state import MountState, mount_state
from gateway.app.state.file import MarkerContent
from gateway.app.state.mount_claim import claim_mount, taken_message
from gateway.app.state.store import StateStore
from gateway.app.watchdog.client import Watchdog, WatchedMount
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.profiles import SurfaceBinding
from gateway.core import operations as op
from gateway.core.errors import Fault, UserError
from gateway.core.requests import Answer, Request, StopOrHold
from gateway.core.wire_log import WireLog
from gateway.mount.context import Context
from gateway.mount.controller import MountController
from gateway.mount.link.line import MountLink
from gateway.mount.site.site_clock import SiteClock
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.protocols.base.session import SharedSettings
from gateway.system.computer_clock import ClockCheck
from gateway.system.locks import NameClaim
from gateway.system.runtime_folders import find_folders
from gateway.transport import Listener
from gateway.transport.listening import WEB_ADDRESS, split_address
from gateway.transport.web_server import WebDevice, WebServer

if TYPE_CHECKING:
    from gateway.app.control.requests import RequestHandler


class Gateway:
    """A mount and its surfaces, open for clients until ``close`` is called. ``warn`` gets messages for the user.

    Several gateways of a process may share the tables of the sky, the watchdog process and the web server.
    """

    def __init__(
        self,
        config: MountConfig,
        surfaces: Sequence[SurfaceConfig],
        wire_log: WireLog | None = None,
        sky: Sky | None = None,
        clock: Callable[[], float] = time.time,
        warn: Callable[[str], None] | None = None,
        watchdog: Watchdog | None = None,
    ) -> None:
        self.config, self.surfaces, self.clock = config, [with_needs(surface) for surface in surfaces], clock
        self.watchdog = watchdog
        self.watchdog_mount: WatchedMount | None = None
        self.wire_log = wire_log or WireLog(clock)
        self.warn = warn or (lambda text: self.wire_log.note("state", text))
        self.sky = sky or Sky()
        self.mount = parse_endpoint(config.at)
        self.endpoints = [parse_endpoint(surface.at) for surface in surfaces]
        self.acceptors: list[Acceptor] = []
        self.ports: list[Listener] = []
        self.bindings: list[tuple[str, SurfaceBinding]] = []
        #: The web server, which several gateways may share, and the event for which it waits: the ports are open.
        self.web, self.ports_ready = WebServer(), asyncio.Event()
        self.models_presented = asyncio.Event()
        self._controller: MountController | None = None
        self.store: StateStore | None = None
        self.control: ControlServer | None = None
        self.mount_claim: NameClaim | None = None

    def open_state_store(self) -> None:
        """Claim the mount and read its saved state. Raises MountTaken if another gateway has the mount."""
        self.mount_claim = claim_mount(self.mount, self.warn)
        marked = MarkerContent(str(self.mount), self.config.baud)
        self.store = StateStore(self.mount.protocol, self.mount.where, marked, self.config.state, self.warn)

    async def open(self) -> None:
        """Open the surfaces and begin to open the line. Raises UserError if a surface fails, or the mount is in use."""
        if self.store is None:
            self.open_state_store()
        self._connect_watchdog()
        wire = make_transport(self.mount, self.config, self.watchdog_mount)
        self.prepare(lambda reply_rules, wire_log: MountLink(wire, reply_rules, wire_log))
        for endpoint, surface, acceptor in zip(self.endpoints, self.surfaces, self.acceptors, strict=True):
            try:
                self.ports.append(await open_surface(endpoint, surface, acceptor.accept, self.web))
            except UserError:
                await self.close()
                raise
        for port, acceptor in zip(self.ports, self.acceptors, strict=True):
            acceptor.set_address(port.address)  # with the number of the port that was really opened
        self.ports_ready.set()
        self.open_line()
        await self._open_control()

    def _connect_watchdog(self) -> None:
        """Let the watchdog process stop a real mount if this process cannot. A simulated one ends with this process."""
        if self.watchdog is not None and self.mount.where != "sim":
            lock = self.store.lock_path if self.store is not None else None
            self.watchdog_mount = watch_mount(
                self.watchdog, self.title, lock, lambda: self.controller, self._on_watchdog_stop
            )

    def _on_watchdog_stop(self) -> None:
        """Warn the user and stop again: this process did not run for a while, so its watchdog has stopped the mount."""
        self.warn(
            f"{self.title}: this gateway did not run for a while and its watchdog process stopped the mount; "
            "the gateway continues from where the mount is now"
        )
        self.controller.line.check_line_again()  # another process has sent something on the same port
        self.controller.begin_stop()

    def prepare(self, make_line: Callable[[ReplyRules, WireLog], MountLink]) -> None:
        """Assemble all parts around the line that ``make_line`` makes; this opens nothing yet."""
        config, loop = self.config, asyncio.get_running_loop()
        driver, follow_ups, reply_rules = make_driver(self.mount, config, loop.time, self.warn)
        shared = SharedSettings() if self.store is None else self.store.shared
        site = op.Place(*config.site) if config.site else None
        site_clock = SiteClock(loop.time, self.clock, site, config.computer_clock, ClockCheck() if self.store else None)
        line = make_line(reply_rules, self.wire_log)
        context = Context(driver, policy_of(config), self.wire_log, line, self.sky, site_clock)
        announcers = [part.before_motion for part in (self.watchdog_mount, self.store) if part is not None]
        self._controller = MountController(context, follow_ups, announcers)
        if self.store is not None:
            self.store.attach(self.controller)
        if self.watchdog_mount is not None:
            self.controller.save_due.connect(self.watchdog_mount.report_changes)
        factory = AcceptorFactory(
            self.controller, self.mount, config, shared, self.clock, self.sky, self.warn, self.web
        )
        self.bindings = factory.bindings
        self.controller.identification.identified.connect(lambda _: self._present_mount(factory.native_bindings))
        for number, (endpoint, surface) in enumerate(zip(self.endpoints, self.surfaces, strict=True), 1):
            self.acceptors.append(factory.make(number, endpoint, surface))

    def _present_mount(self, bindings: list[SurfaceBinding]) -> None:
        """Make these surfaces present the model that the mount has reported; called after each identification."""
        for binding in bindings:
            configure_binding(self.controller, binding)

    def open_line(self) -> None:
        """Begin to open the line and to identify the mount; this does not wait."""
        self.controller.start()
        self.controller.spawn(self.present_fitting_model())

    async def _open_control(self) -> None:
        """Open the control endpoint for ``mount-gateway stop`` and the other commands."""
        assert self.store is not None
        folders = [self.store.folder, *find_folders()[0]]
        self.control = ControlServer(folders, self.store.stem, str(self.mount), self.carry_out, self.config.name or "")
        try:
            await self.control.open()
        except OSError as error:
            self.warn(
                f"mount-gateway stop, status and goto will not find this gateway: {folders[0]}: "
                f"{error.strerror or error}; --state PATH names another folder"
            )

    async def carry_out(self, request: Request) -> Answer:
        """Carry out a request of a person or a program. A stop imports no module, because the disk may be broken."""
        if isinstance(request, StopOrHold):
            assert self.store is not None
            return await carry_out_stop(request, self.controller, self.store)
        return await self.request_handler.carry_out(request)

    async def present_fitting_model(self) -> None:
        """Wait until the mount has reported its status; then present a fitting model where the user named none."""
        await self.controller.identified.wait()
        while True:
            try:
                equatorial = (await self.controller.read(op.GetStatus())).equatorial
                break
            except Fault:
                await asyncio.sleep(1.0)
        for _, binding in self.bindings:
            if binding.fit_model is not None:
                binding.model.update(
                    binding.fit_model(equatorial, self.controller.driver.german, self.controller.driver.gps)
                )
        self.models_presented.set()

    @cached_property
    def request_handler(self) -> RequestHandler:
        """Carries out requests of people; made at the first request, so that the start is faster."""
        from gateway.app.control.requests import RequestHandler

        return RequestHandler(self.controller, self)

    def state(self) -> MountState:
        """Return the activity and the known state of the mount, without an exchange with it."""
        programs = [host for acceptor in self.acceptors for host in acceptor.hosts_present()]
        return mount_state(self.controller, self.config.name or "", str(self.mount), programs)

    def start_warnings(self) -> Iterator[str]:
        """Yield warnings to show after the start: shown earlier, they would hide the reason of a failed start."""
        for port, surface in zip(self.ports, self.surfaces, strict=True):
            if warning := exposure_warning(port.address, surface, reachable_networks):
                yield warning
        if self.store is not None and self.store.conflict_text:
            yield self.store.conflict_text

    def names(self) -> list[str]:
        """Return ``PROTOCOL:MODEL@WHERE`` for each surface with its own port, followed by the mount's name if any."""
        name = f" {self.config.name}" if self.config.name else ""
        return [
            f"{device_text(endpoint.protocol, acceptor.model)}@{port.address}{name}"
            for endpoint, acceptor, port in zip(self.endpoints, self.acceptors, self.ports, strict=False)
            if port.address != WEB_ADDRESS
        ]

    def web_devices(self) -> Iterator[tuple[str, WebDevice]]:
        """Yield, for each surface, its protocol and the device that the web server offers at the surface's port."""
        for endpoint, acceptor, port in zip(self.endpoints, self.acceptors, self.ports, strict=True):
            number = split_address(port.address)[1] if "://" in port.address else 0
            yield endpoint.protocol, WebDevice(acceptor.accept, self.title, self.wire_log, number)

    @property
    def is_prepared(self) -> bool:
        """Whether ``prepare`` has assembled the gateway."""
        return self._controller is not None

    @property
    def controller(self) -> MountController:
        """The controller of the mount; exists from ``prepare`` on."""
        assert self._controller is not None
        return self._controller

    @property
    def mount_taken_message(self) -> str:
        """A sentence that another gateway has this mount; empty if none is known to have it."""
        return taken_message(self.title, self.store.holder) if self.store is not None and self.store.holder else ""

    @property
    def open_failure(self) -> str:
        """Why the mount's port cannot be opened, or which other gateway has it; empty if the port can be opened."""
        why = self.controller.line.open_error
        return why and (self.mount_taken_message or f"{self.title}: {why}")

    @property
    def moving(self) -> bool:
        """Whether an ordered motion is under way or pending, or a stop is not acknowledged yet."""
        return self.is_prepared and self.controller.reconciler.busy

    @property
    def title(self) -> str:
        """The mount in messages: its name, if any, and its endpoint."""
        return f"{self.config.name}: {self.mount}" if self.config.name else str(self.mount)

    async def wait_identified(self, seconds: float) -> bool:
        """Wait until the mount is identified and its status is read; return whether that is so within ``seconds``."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self.models_presented.wait()
        return self.models_presented.is_set()

    async def close(self) -> None:
        """Stop motion, and close the ports and the line."""
        try:
            while self.ports:
                await self.ports.pop().close()
            await self.web.close()
        finally:  # the mount is stopped even if closing a port failed
            if self.is_prepared:
                await self.controller.close()
            if self.store is not None:
                await self.store.close()
            if self.control is not None:
                await self.control.close()
            if self.mount_claim is not None:
                self.mount_claim.release()
