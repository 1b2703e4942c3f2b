"""A whole gateway in one process on virtual time: a client's bytes in at one end, a simulated mount at the other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway import operations as op
from gateway.access import Access
from gateway.assembly import DRIVERS, FACES, policy
from gateway.config import Endpoint, MountConfig, SurfaceConfig
from gateway.guests import Reception
from gateway.hub import Hub
from gateway.keeping import Keeping
from gateway.line import Line
from gateway.mark import InThread
from gateway.observatory import Observatory
from gateway.simulators import make_simulator
from gateway.sky import Sky
from gateway.state import Marked
from gateway.transcript import Entry, Transcript
from gateway.wires import SimulatorWire
from tests.sent_forms import malformed

#: 2026-01-15 22:00 UTC
EVENING = 1768514400.0


async def here(function: Callable[..., Any], *arguments: Any) -> Any:
    """Files are written at once: a thread knows nothing of virtual time."""
    return function(*arguments)


def _nobody() -> None:
    """What has changed is kept by nobody."""


class Bridge:
    """``sim`` is the simulated mount, ``hub`` the gateway's, ``client()`` a new connection."""

    def __init__(self, mount: str = "6-8se", version: str | None = None, *, site: tuple[float, float] = (45.0, 10.0),
                 latency: float = 0.05, aligned: bool = True, speed: float = 1.0, surface: str | None = "autostar",
                 config: dict[str, Any] | None = None, driven: str = "nexstar", presented: str = "lx200",
                 surface_version: str | None = None, start: float = EVENING, host_ahead: float = 0.0,
                 state: Path | None = None, on: Bridge | None = None, in_thread: InThread | None = None,
                 access: Access = Access(), ramps: bool = True) -> None:
        """With ``state`` a directory for what is kept; ``on`` the same mount as another gateway's, which has ended.

        ``ramps`` False is a mount whose motors change their speed at once, for tests that reckon with plain rates.
        """
        loop = asyncio.get_running_loop()
        self._began = loop.time() if on is None else on._began
        self.clock = lambda: start + loop.time() - self._began
        self.host = lambda: self.clock() + host_ahead
        self.settings = MountConfig(at="-", **(config or {}))
        endpoint = Endpoint(driven, "sim", mount, version)
        self.sim = on.sim if on else make_simulator(endpoint, clock=self.clock, site=site, aligned=aligned, speed=speed,
                                                    ramps=ramps)
        self.transcript = Transcript(self.clock)
        self.entries: list[Entry] = []
        self.transcript.sinks.append(self.entries.append)
        driver, follow_ups, dialogue = DRIVERS[driven](Endpoint(driven, "sim"), self.settings, loop.time)
        self.driver: Any = driver
        driver.hurry = speed
        line = Line(SimulatorWire("sim", self.sim.connection, latency), dialogue, self.transcript)
        given = self.settings.site
        self.observatory = Observatory(loop.time, self.host, op.Place(*given) if given else None)
        self.hub = Hub(driver, follow_ups, line, Sky(), self.observatory, self.transcript,
                       policy(self.settings))
        shown = Endpoint(presented, "-", surface, surface_version)
        face = FACES[presented](shown, SurfaceConfig(at="-"), self.settings.limits)
        face.surface.verbatim = presented == driven
        self._driven, self._hands_on = driven, presented == driven == "nexstar"
        self.warned: list[str] = []
        self.keeping: Keeping | None = None
        shared: dict[str, Any] = {"sites": {}}
        changed = _nobody
        if state is not None:
            self.keeping = Keeping(driven, "bridge", Marked(f"{driven}@bridge", 9600), str(state), self.warned.append,
                                   in_thread or here)
            self.keeping.attach(self.hub)
            shared, changed = self.keeping.shared, self.keeping.changed
        self.reception = Reception(self.hub, face, shared, self.clock, changed, access=access)

    async def __aenter__(self) -> Bridge:
        self.hub.start()
        await self.hub.settled.wait()
        return self

    async def __aexit__(self, failed: object = None, *_: object) -> None:
        await self.hub.close()
        if self.keeping is not None:
            await self.keeping.close()
        if failed is None and not self._hands_on:  # what passes through is the program's own
            assert not (wrong := malformed(self._driven, self.sent())), f"no paper writes it so: {wrong}"

    async def kill(self) -> None:
        """End as a killed process does: nothing more is sent or written, only the lock is let go."""
        assert self.keeping is not None
        tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in tasks:
            task.cancel()
        self.hub.motions.close()
        await asyncio.gather(*tasks, return_exceptions=True)
        self.keeping._lock.release()

    def client(self, host: str = "127.0.0.1") -> Visitor:
        return Visitor(self, host)

    def sent(self) -> list[bytes]:
        """Every request that went to the mount so far."""
        return [entry.data for entry in self.entries if entry.side == "mount" and entry.arrow == ">"]


class Visitor:
    """One connection."""

    def __init__(self, bridge: Any, host: str) -> None:
        self.heard = b""
        self._guest = bridge.reception.arrive(host, host, self._hear)

    def _hear(self, data: bytes) -> None:
        self.heard += data

    async def ask(self, data: bytes, seconds: float = 10.0, *, until: bytes = b"") -> bytes:
        """Send bytes and wait for the reply: up to ``until``, else for whatever comes first; b"" after ``seconds``."""
        self.heard = b""
        self._guest.feed(data)
        end = asyncio.get_running_loop().time() + seconds
        while asyncio.get_running_loop().time() < end:
            if self.heard and (not until or self.heard.endswith(until)):
                break
            await asyncio.sleep(0.01)
        return self.heard

    def tell(self, data: bytes) -> None:
        """Send bytes that have no reply."""
        self._guest.feed(data)

    def close(self) -> None:
        self._guest.close()
