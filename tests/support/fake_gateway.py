"""Connections to a `Mount` through the product's ConnectionAcceptor, which keeps settings from one to the next.

The mount controller behind it is a minimal stand-in: reads are always cached, everything else is performed at once.
It needs a running event loop; ``gateway.diagnostics.virtual_time.run`` provides one on virtual time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, cast

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.core.wire_log import WireLog
from gateway.mount.motion.wanted import Wanted
from gateway.mount.policy import Limits
from gateway.mount.presence import NO_PROGRAM, ClientPresence, HostActivity, ProgramId
from gateway.mount.readings.cache import NOT_CACHED
from gateway.mount.site.pending_settings import IncomingSettings
from gateway.protocols.base.session import SharedSettings
from gateway.transport.handler import NewConnection
from tests.support.fake_mount import Mount


class FakeController:
    """Stands in for the mount controller. Call ``changed`` after setting other readings of the mount."""

    def __init__(self, mount: Mount) -> None:
        self.mount, self.loop = mount, asyncio.get_running_loop()
        self.now = self.loop.time
        self.wire_log = WireLog(self.clock)
        self.presence = ClientPresence(self.now)
        self.answer_version = self.stop_count = 0
        self.closed = self.slewing = False
        self.reconciler = self.wanted = self.context = self
        self.incoming_settings = IncomingSettings()
        #: Seconds by which the host's clock is ahead of the event loop's, and the mount's ahead of the host's.
        self._epoch = mount.clock.unix - self.now()
        self._ahead = 0.0

    @property
    def value(self) -> Wanted:
        """Return that nothing moves or waits, because everything is done at once."""
        return Wanted(stop_count=self.stop_count)

    def clock(self) -> float:
        """Return the host's time."""
        return self._epoch + self.now()

    def changed(self) -> None:
        self.answer_version += 1

    def merge_halt(self, operation: op.Operation) -> None:
        """Do nothing: no stop is ever under way here, because each is done at once."""

    def treat_as_release(self, activity: HostActivity) -> bool:
        """Return that no arrow waits: everything is done at once."""
        return False

    def peek(self, operation: op.Operation, program: ProgramId = NO_PROGRAM) -> Any:
        if isinstance(operation, op.Position | op.Slewing) and self.mount.fault is None:
            return self.mount.perform(operation)
        return NOT_CACHED

    def certain_fault(self, operation: op.Operation) -> None:
        """Accept every operation."""

    def touch(self, kinds: list[type[op.Operation]], now: float) -> None:
        """Do nothing: there is no polling here."""

    def fresh_until(self, kinds: list[type[op.Operation]]) -> float:
        return self.now() + 0.5

    async def perform(
        self,
        operation: op.Operation,
        stop_count: int | None = None,
        activity: HostActivity | None = None,
        max_delay: float = 3.5,
        arrived_at: float | None = None,
    ) -> Any:
        await asyncio.sleep(0)
        self.mount.clock = op.Moment(self.clock() + self._ahead, self.mount.clock.offset)
        answer = self.mount.perform(operation)
        self._ahead = self.mount.clock.unix - self.clock()
        self.changed()
        return answer

    def begin_stop(self, by: str = "") -> None:
        self.stop_count += 1
        self.spawn(self.perform(op.AbortMotion()))

    def begin(
        self,
        operation: op.Operation,
        stops: int,
        failed: Callable[[Fault], None],
        activity: HostActivity,
        asked: float | None = None,
    ) -> asyncio.Task[None]:
        async def finish() -> None:
            try:
                await self.perform(operation, stops)
            except Fault as fault:
                failed(fault)

        return self.spawn(finish())

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        return self.loop.create_task(work)


class FakeGateway:
    """A mount behind a surface; ``connect`` opens a connection."""

    def __init__(
        self,
        mount: Mount | None = None,
        model: str = "autostar",
        protocol: str = "lx200",
        version: str | None = None,
        **settings: Any,
    ) -> None:
        self.mount = mount or Mount()
        self.controller = FakeController(self.mount)
        binding = make_surface(Endpoint(protocol, "-", model, version), SurfaceConfig(at="-", **settings), Limits())
        self.shared = SharedSettings()
        self.acceptor = ConnectionAcceptor(cast(Any, self.controller), binding, self.shared, self.controller.clock)

    def connect(self, host: str = "192.168.4.2") -> FakeConnection:
        return FakeConnection(self, host)


class FakeConnection:
    """One connection from a host."""

    def __init__(self, gateway: FakeGateway, host: str) -> None:
        self._heard = b""
        self.guest = gateway.acceptor.accept(NewConnection(f"{host}:1", host, self._hear))

    def _hear(self, data: bytes) -> None:
        self._heard += data

    async def ask(self, data: bytes) -> bytes:
        """Send bytes and return everything that comes back for them."""
        self.guest.feed(data)
        await asyncio.sleep(0.01)
        heard, self._heard = self._heard, b""
        return heard

    async def dribble(self, data: bytes, seconds: float) -> bytes:
        """Like `ask`, but send one byte after the other."""
        for byte in data:
            self.guest.feed(bytes((byte,)))
            await asyncio.sleep(seconds)
        return await self.ask(b"")

    def close(self) -> None:
        self.guest.close()
