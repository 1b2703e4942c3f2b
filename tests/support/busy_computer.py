"""A busy computer on virtual time: every event loop iteration takes a while, and every timer fires late."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from pathlib import Path
from random import Random
from typing import Any

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.recording.recorded_gateway import HostClock, record_whole
from gateway.app.recording.recorder import Recorder
from gateway.app.recording.turns import TurnLoop, Wait
from gateway.app.simulated import make_simulator
from gateway.core.wire_log import WireLog
from gateway.mount.link.line import MountLink
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Connected
from gateway.transport.wires import SimulatedTransport

#: 2026-01-15 22:00 UTC
EVENING = 1768514400.0


class BusyLoop(TurnLoop):
    """An event loop whose delays are drawn from ``random``."""

    def __init__(self, random: Random) -> None:
        self.passed, self._random = 0.0, random
        super().__init__(lambda: self.passed)

    def begin_turn(self, timeout: float | None, wait: Wait) -> list[Any]:
        def jump(seconds: float | None) -> list[Any]:
            assert seconds is not None, "nothing will ever happen again"
            self.passed += seconds + self._random.expovariate(500.0 if seconds else 5000.0)
            return []

        return super().begin_turn(timeout, jump)


def run_busy(program: Coroutine[Any, Any, Any], seed: object) -> Any:
    """Run a coroutine on a busy computer."""
    with asyncio.Runner(loop_factory=lambda: BusyLoop(Random(str(seed)))) as runner:
        return runner.run(program)


class Pluggable(SimulatedTransport):
    """A simulated mount whose cable can be pulled out (``lose``)."""

    async def open(self, on_data: Any, on_lost: Any) -> None:
        self.lose = lambda: on_lost("pulled out")
        await super().open(on_data, on_lost)


class Overtaking(Pluggable):
    """A simulated mount like one over HTTP: only the reply to the newest request is delivered."""

    newest_only, written = True, 0

    def write(self, data: bytes) -> None:
        self.written += 1
        asyncio.get_running_loop().call_later(self._latency, self._reply, self.written, self._feed(data))

    def _reply(self, number: int, answer: bytes) -> None:
        if number == self.written:
            self._deliver(answer)


class Recorded:
    """A gateway with one surface, recorded in ``path``; ``ahead`` is by how many seconds its host's clock is fast."""

    def __init__(self, path: Path, mount: str, presented: str, longest: int = 10_000_000, **surface: Any) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, BusyLoop)
        self.loop, self.ahead = loop, 0.0
        clock = HostClock(loop, lambda: EVENING + loop.passed + self.ahead, lambda: loop.passed)
        surfaces = [SurfaceConfig(at=f"{presented}@tcp://:0", **surface)]
        at = mount if "@" in mount else f"{mount}@sim"
        self.gateway = Gateway(MountConfig(at=at), surfaces, WireLog(clock), clock=clock)
        wire, latency = (Overtaking, 0.3) if "http" in mount else (Pluggable, 0.0131)
        self.wire = wire("sim", make_simulator(self.gateway.mount, clock=clock, speed=3.0).connection, latency)
        self.recorder: Recorder = record_whole(path, self.gateway, longest)
        entrance = self.gateway.entrance
        self.gateway.prepare(lambda reply_rules, to: MountLink(entrance.wire(self.wire), reply_rules, to))
        self._arrive = entrance.accept(self.gateway.acceptors[0])

    def arrive(self, name: str, write: Any) -> ConnectionHandler:
        """Open a new connection. Raises TurnedAway."""
        return self._arrive(Connected(name, name.partition(":")[0], write, lambda last: None))

    async def __aenter__(self) -> Recorded:
        await self.gateway.entrance.begin(self.gateway.begin)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.gateway.close()
        self.recorder.close()
