"""Putting a gateway together: a mount, its hub, and the ports its surfaces are presented on.

The only place, with ``simulators.py``, where the names of protocols are known to the upper floors: a third protocol is
one more entry in ``DRIVERS`` and ``FACES``.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from gateway import operations as op
from gateway.config import Config, Endpoint, MountConfig, SurfaceConfig, parse_endpoint
from gateway.driver import Driver
from gateway.equinox import J2000
from gateway.errors import Fault, UserError
from gateway.guests import Face, Reception
from gateway.hub import Hub, Policy
from gateway.line import Dialogue, Line
from gateway.observatory import Observatory
from gateway.ports import Port, open_port
from gateway.safety import Limits
from gateway.sky import Sky
from gateway.tables import load
from gateway.transcript import Transcript
from gateway.wires import SerialWire, Wire

#: A driver, what it does later by itself, and how its line talks.
Driven = tuple[Driver, dict[type[Any], Callable[[Any, Any], Any]], Dialogue]


def _nexstar_driver(endpoint: Endpoint, config: MountConfig, now: Callable[[], float]) -> Driven:
    from gateway.protocols.nexstar.dialogue import NexStarDialogue
    from gateway.protocols.nexstar.driver import FOLLOW_UPS
    from gateway.protocols.nexstar.driver.state import NexStar, Settings

    settings = Settings(site=config.site, mode=config.mode, guide_rate=config.guide_rate, park=config.park,
                        aux_home=config.aux_home)
    return NexStar(now, settings, endpoint.model, endpoint.version), dict(FOLLOW_UPS), NexStarDialogue()


def _lx200_face(endpoint: Endpoint, config: SurfaceConfig, limits: Limits) -> Face:
    from gateway.protocols.lx200.framing import Framer
    from gateway.protocols.lx200.surface import SPECIALS
    from gateway.surface import Surface

    protocol = load("lx200")
    name = endpoint.model or "autostar"
    settings = {"precision": config.precision, "limits": limits, "sync_text": config.sync_text}
    model = {**protocol.models[name], "name": name}
    halts = {b":Q%c#" % letter: (op.Halt(axis), frozenset(b":M%c#" % other for other in letters))
             for axis, letters in ((1, b"ew"), (2, b"ns")) for letter in letters}
    surface = Surface(protocol, SPECIALS)
    return Face(surface, lambda now: Framer().feed, frozenset({b":Q#"}), model, settings, halts=halts)


def _meade_driver(endpoint: Endpoint, config: MountConfig, now: Callable[[], float]) -> Driven:
    from gateway.protocols.lx200.dialogue import MeadeDialogue
    from gateway.protocols.lx200.driver import FOLLOW_UPS
    from gateway.protocols.lx200.driver.state import Meade

    return Meade(now, endpoint.model), dict(FOLLOW_UPS), MeadeDialogue()


def _nexstar_face(endpoint: Endpoint, config: SurfaceConfig, limits: Limits) -> Face:
    from gateway.protocols.nexstar.surface import FORK, GERMAN, SPECIALS, framing, presented
    from gateway.protocols.nexstar.surface.devices import NEVER_PASSED, no_response
    from gateway.surface import Surface

    model = presented(endpoint.model, endpoint.version)
    fit = None if endpoint.model else lambda equatorial: presented(GERMAN if equatorial else FORK, endpoint.version)
    surface = Surface(load("nexstar"), SPECIALS, no_response)
    surface.never = NEVER_PASSED
    return Face(surface, framing(model), frozenset(), model, {"precision": "high"}, fit=fit)


DRIVERS: dict[str, Callable[[Endpoint, MountConfig, Callable[[], float]], Driven]] = {
    "lx200": _meade_driver,
    "nexstar": _nexstar_driver,
}
FACES: dict[str, Callable[[Endpoint, SurfaceConfig, Limits], Face]] = {
    "lx200": _lx200_face,
    "nexstar": _nexstar_face,
}


class Gateway:
    """A mount and its surfaces, open for clients until it is closed."""

    def __init__(self, config: Config, transcript: Transcript | None = None) -> None:
        self.config = config
        self.transcript = transcript or Transcript(time.time)
        self.sky = Sky()
        self.mount = parse_endpoint(config.mount.at)
        self.endpoints = [parse_endpoint(surface.at) for surface in config.surface]
        if self.mount.protocol not in DRIVERS:
            raise UserError(f"{self.mount}: {self.mount.protocol} mounts cannot be driven; {' or '.join(DRIVERS)} can")
        for endpoint in self.endpoints:
            if endpoint.protocol not in FACES:
                raise UserError(f"{endpoint}: no {endpoint.protocol} surface; write {' or '.join(FACES)}")
        self.ports: list[Port] = []
        self.faces: list[tuple[str, Face]] = []
        self.fitted = asyncio.Event()
        self.hub: Hub | None = None

    async def open(self) -> None:
        """Open the ports and the line. Raises UserError."""
        config, loop = self.config.mount, asyncio.get_running_loop()
        driver, follow_ups, dialogue = DRIVERS[self.mount.protocol](self.mount, config, loop.time)
        limits = Limits(config.lowest, config.highest, config.sync_limit)
        site = op.Place(*config.site) if config.site else None
        observatory = Observatory(loop.time, time.time, site)
        line = Line(self._wire(), dialogue, self.transcript)
        self.hub = hub = Hub(driver, follow_ups, line, self.sky, observatory, self.transcript,
                             Policy(limits, config.site_time, config.equinox))
        shared: dict[str, Any] = {"sites": {}}
        for number, (endpoint, surface) in enumerate(zip(self.endpoints, self.config.surface, strict=True), 1):
            face = FACES[endpoint.protocol](endpoint, surface, limits)
            face.surface.verbatim = endpoint.protocol == self.mount.protocol
            if surface.equinox == "j2000":
                face = replace(face, equinox=J2000(self.sky, observatory.unix))
            reception = Reception(hub, face, shared, time.time, lambda: None, number)
            try:
                port = await open_port(endpoint.where, reception.arrive)
            except UserError:
                await self.close()
                raise
            self.ports.append(port)
            self.faces.append((endpoint.protocol, face))
        hub.start()
        hub.spawn(self._fit())

    async def _fit(self) -> None:
        """Present what fits the mount, where the user named no model."""
        assert self.hub is not None
        await self.hub.identified.wait()
        while True:
            try:
                equatorial = (await self.hub.read(op.GetStatus())).equatorial
                break
            except Fault:
                await asyncio.sleep(1.0)
        for _, face in self.faces:
            if face.fit is not None:
                face.model.update(face.fit(equatorial))
                if self.hub.driver.gps and "has" in face.model:
                    face.model["has"] = [*face.model["has"], "gps"]
        self.fitted.set()

    def names(self) -> list[str]:
        """One ``PROTOCOL:MODEL@WHERE`` per open port."""
        return [f"{protocol}:{face.model['name']}@{port.where}"
                for (protocol, face), port in zip(self.faces, self.ports, strict=True)]

    def _wire(self) -> Wire:
        if self.mount.where == "sim":
            from gateway.simulators import simulated_wire

            return simulated_wire(self.mount, self.config.mount)
        return SerialWire(self.mount.where, self.config.mount.baud)

    async def found(self, seconds: float) -> bool:
        """Wait until the mount has said who it is -> whether it did in time."""
        assert self.hub is not None
        try:
            async with asyncio.timeout(seconds):
                await self.fitted.wait()
        except TimeoutError:
            return False
        return True

    async def close(self) -> None:
        """Stop motion, close the ports and the line."""
        for port in self.ports:
            await port.close()
        if self.hub is not None:
            await self.hub.close()
