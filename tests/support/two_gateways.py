"""Two gateways in a row, in one process on virtual time: the driver of the first sends to the surface of the second."""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.app.bindings import make_driver, make_surface
from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.astro.ephemeris.sky import Sky
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.core import operations as op
from gateway.core.wire_log import Entry, WireLog
from gateway.mount.context import Context
from gateway.mount.controller import MountController
from gateway.mount.link.line import MountLink
from gateway.mount.policy import Limits, Policy
from gateway.mount.site.site_clock import SiteClock
from gateway.protocols.base.session import SharedSettings
from gateway.transport import ConnectionHandler
from gateway.transport.handler import NewConnection
from gateway.transport.wires import OnData, OnLost
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.sent_forms import malformed

#: Seconds within which the outer gateway must have identified what it drives.
MOST = 60.0


class SurfaceTransport:
    """A transport to the surface of another gateway."""

    name = "the other gateway"

    def __init__(self, acceptor: ConnectionAcceptor) -> None:
        self._acceptor = acceptor
        self.guest: ConnectionHandler | None = None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        loop = asyncio.get_running_loop()
        connected = NewConnection("chain", "chain", lambda data: loop.call_soon(on_data, bytes(data)))
        self.guest = self._acceptor.accept(connected)

    def write(self, data: bytes) -> None:
        assert self.guest is not None
        self.guest.feed(data)

    async def close(self) -> None:
        if self.guest is not None:
            self.guest.close()
            self.guest = None


class TwoGateways:
    """``outer`` serves the clients and drives ``inner``, which drives the simulated mount."""

    def __init__(self, inner: Bridge, link: str, presented: str, surface: str | None = None) -> None:
        self.inner, self._link = inner, link
        loop = asyncio.get_running_loop()
        self.wire_log = WireLog(inner.clock)
        self.entries: list[Entry] = []
        self.wire_log.sinks.append(self.entries.append)
        driver, follow_ups, reply_rules = make_driver(Endpoint(link, "-"), MountConfig(at="-"), loop.time)
        self.driver: Any = driver
        line = MountLink(SurfaceTransport(inner.acceptor), reply_rules, self.wire_log)
        site_clock = SiteClock(loop.time, inner.clock, None)
        limits = Limits(lowest=-90.0, sun=0.0)  # the inner gateway and the mount have limits of their own
        self.controller = MountController(
            Context(driver, Policy(limits), self.wire_log, line, Sky(), site_clock), follow_ups
        )
        face = make_surface(Endpoint(presented, "-", surface), SurfaceConfig(at="-"), limits)
        self.acceptor = ConnectionAcceptor(self.controller, face, SharedSettings(), inner.clock)

    async def __aenter__(self) -> TwoGateways:
        await self.inner.__aenter__()
        self.controller.start()
        async with asyncio.timeout(MOST):  # otherwise a mount that is never identified is asked for ever
            await self.controller.site_read.wait()
        return self

    async def __aexit__(self, failed: object = None, *_: object) -> None:
        await self.controller.close()
        await self.inner.__aexit__(failed)
        if failed is None:
            assert not (wrong := malformed(self._link, self.sent())), f"not a form of the manual: {wrong}"

    def client(self) -> RehearsalClient:
        return RehearsalClient(self, "127.0.0.1")

    def sent(self) -> list[bytes]:
        """Return what the outer gateway has sent to the inner one."""
        return [entry.data for entry in self.entries if entry.side == "mount" and entry.arrow == ">"]


def equatorial(raw: bytes) -> op.Equatorial:
    """Convert a reply to ``e`` to degrees."""
    ra, dec = (int(part[:6], 16) * 360.0 / 2**24 for part in raw.rstrip(b"#").split(b","))
    return op.Equatorial(ra, dec - 360.0 if dec > 180 else dec)
