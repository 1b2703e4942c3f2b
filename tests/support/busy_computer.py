"""A busy computer on virtual time: every timer fires late."""

from __future__ import annotations

from collections.abc import Coroutine
from random import Random
from typing import Any

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.simulated import make_simulator
from gateway.core.wire_log import WireLog
from gateway.diagnostics.virtual_time import VirtualLoop, run
from gateway.mount.link.line import MountLink
from gateway.transport import ConnectionHandler
from gateway.transport.handler import NewConnection
from gateway.transport.wires import SimulatedTransport

#: 2026-01-15 22:00 UTC
EVENING = 1768514400.0


class BusyLoop(VirtualLoop):
    """An event loop whose delays are drawn from ``random``."""

    def __init__(self, random: Random) -> None:
        self._random = random
        super().__init__()

    def _wait(self) -> None:
        super()._wait()
        self.elapsed += self._random.expovariate(500.0)


def run_busy(program: Coroutine[Any, Any, Any], seed: object) -> Any:
    """Run a coroutine on a busy computer."""
    return run(program, lambda: BusyLoop(Random(str(seed))))


class Busy:
    """A gateway with one surface on a busy computer; it needs a running loop."""

    def __init__(self, loop: VirtualLoop, mount: str, presented: str) -> None:
        self.loop = loop

        def clock() -> float:
            return EVENING + loop.time()

        surfaces = [SurfaceConfig(at=f"{presented}@tcp://:0")]
        self.gateway = Gateway(MountConfig(at=f"{mount}@sim"), surfaces, WireLog(clock), clock=clock)
        simulator = make_simulator(self.gateway.mount, clock=clock, speed=3.0)
        wire = SimulatedTransport("sim", simulator.connection, 0.0131)
        self.gateway.prepare(lambda reply_rules, to: MountLink(wire, reply_rules, to))

    def arrive(self, name: str, write: Any) -> ConnectionHandler:
        """Open a new connection. Raises ConnectionRefused."""
        return self.gateway.acceptors[0].accept(NewConnection(name, name.partition(":")[0], write, lambda last: None))

    async def __aenter__(self) -> Busy:
        self.gateway.open_line()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.gateway.close()
