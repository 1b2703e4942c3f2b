"""What all pages share: the mounts of this gateway, their lines, their conversation, and the recordings.

The state of the mounts is made once for all pages that look, at most five times a second.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Sequence
from typing import Any

from gateway.app.gateway import Gateway
from gateway.console import view
from gateway.console.gate import same_token
from gateway.console.places import Unknown
from gateway.console.programs import Programs
from gateway.console.pulse import Pulse
from gateway.console.recording import Recording
from gateway.console.talk import Talk
from gateway.core.about import VERSION
from gateway.core.operations import GetIdentity, Identity
from gateway.protocols.registry import spoken
from gateway.protocols.wireformat.command_set import load

#: Seconds for which a state is the newest one, and for which the Sun, the Moon and the planets stay where they were.
FRESH, BODIES_FRESH = 0.15, 10.0
#: Seconds that an explanation may take; it is played through a whole gateway of its own, in another process.
EXPLAIN = 20.0


class Mounts:
    """``pin`` is what lets a page act; empty where every page may."""

    version = VERSION

    def __init__(self, gateways: Sequence[Gateway], pin: str = "") -> None:
        self.gateways, self.pin = list(gateways), pin
        self.pulses = [Pulse() for _ in self.gateways]
        self.programs = [Programs(gateway) for gateway in self.gateways]
        self.talks = [Talk(gateway, index) for index, gateway in enumerate(self.gateways)]
        self.recordings = [Recording(gateway) for gateway in self.gateways]
        self._loop = asyncio.get_running_loop()
        self._states: list[dict[str, Any]] = []
        self._made = self._bodies_made = -1e9
        self._bodies: list[list[dict[str, Any]]] = []
        self._pages = 0
        self._explaining = asyncio.Lock()

    def now(self) -> float:
        """This computer's clock, Unix seconds."""
        return self.gateways[0].clock()

    def gateway(self, index: int) -> Gateway:
        """Raises Unknown."""
        if not 0 <= index < len(self.gateways):
            raise Unknown(f"there is no mount {index} here")
        return self.gateways[index]

    def admits(self, pin: str) -> bool:
        """Whether this is the pin."""
        return bool(self.pin) and same_token(pin, self.pin)

    def page_comes(self) -> Callable[[], None]:
        """A page looks from now on -> what ends that. With the first one the mounts' lines are listened to."""
        self._pages += 1
        if self._pages == 1:
            for gateway, pulse, programs in zip(self.gateways, self.pulses, self.programs, strict=True):
                gateway.wire_log.sinks += [pulse.put, programs.put]
        return self._page_goes

    def _page_goes(self) -> None:
        self._pages -= 1
        if not self._pages:
            for gateway, pulse, programs in zip(self.gateways, self.pulses, self.programs, strict=True):
                gateway.wire_log.leave(pulse.put)
                gateway.wire_log.leave(programs.put)

    def states(self) -> list[dict[str, Any]]:
        """Every mount as pages are shown it."""
        now = self._loop.time()
        if now - self._made >= FRESH:
            self._made, self._states = now, [self._state(index) for index in range(len(self.gateways))]
        return self._states

    def _state(self, index: int) -> dict[str, Any]:
        gateway, pulse = self.gateways[index], self.pulses[index]
        controller = gateway.controller
        assert controller is not None
        now = self._loop.time()
        if now - self._bodies_made >= BODIES_FRESH or len(self._bodies) != len(self.gateways):
            self._bodies_made = now
            self._bodies = [view.bodies(one.controller) for one in self.gateways if one.controller is not None]
        state = view.mount(gateway, index)
        rate = pulse.rate(controller.now(), controller.line.answers)
        state["line"] |= {"rate": rate, "faults": pulse.faults}
        state["programs"] = self.programs[index].told(now)
        state["bodies"] = self._bodies[index]
        return state

    async def explain(self, gateway: Gateway, surface: str, command: str) -> tuple[bool, str]:
        """What ``explain`` says of a command on this mount: played in a process of its own, one at a time."""
        face = spoken(surface or gateway.names()[0].partition("@")[0])[0]
        words = [sys.executable, "-m", "gateway", "explain", "--", face, _called(gateway), command]
        async with self._explaining:
            process = await asyncio.create_subprocess_exec(
                *words, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
            )
            try:
                async with asyncio.timeout(EXPLAIN):
                    out, err = await process.communicate()
            except TimeoutError:
                process.kill()
                await process.wait()
                return False, f"no explanation within {EXPLAIN:.0f} seconds; mount-gateway explain may take longer"
        if process.returncode:
            return False, err.decode("utf-8", "replace").strip() or "no explanation"
        return True, out.decode("utf-8", "replace")


def _called(gateway: Gateway) -> str:
    """The mount as ``explain`` wants it: with the model and version that it has told."""
    at = gateway.mount
    model, version = at.model, at.version
    identity: Identity | None = gateway.controller.cache.value(GetIdentity) if gateway.controller else None
    if identity is not None and identity.model in load(at.protocol).models:
        model, version = model or identity.model, version or identity.version
    return at.protocol + (f":{model}" if model else "") + (f"/{version}" if model and version else "")
