"""One mount as all pages see it: what is asked for anew each time, and what is kept for longer.

The state is made in pieces. Between two of them programs are answered, and a stop is carried out.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

from gateway.app.gateway import Gateway
from gateway.console.shown import view
from gateway.console.shown.programs import Programs
from gateway.console.shown.pulse import Pulse
from gateway.console.shown.talk import Talk

#: Seconds for which Sun, Moon and planets stay where they were; while some are missing; programs and what they said.
BODIES_FRESH, BODIES_MISSING, PROGRAMS_FRESH = 10.0, 1.0, 1.0
#: Programs that are told in one piece; seconds between two pieces.
AT_ONCE, TURN = 10, 0.001


async def turn() -> None:
    """Whoever else has something to do does it now, with all that follows from it: a stop takes several turns of the
    event loop to the mount's line, and is to meet one piece at the most."""
    await asyncio.sleep(TURN)


class ShownMount:
    """``look`` while there are pages, ``look_away`` when there are none."""

    def __init__(self, gateway: Gateway, index: int) -> None:
        self.gateway, self._index = gateway, index
        self.pulse, self.talk, self._programs = Pulse(), Talk(gateway, index), Programs(gateway)
        self._told: list[dict[str, Any]] = []
        self._bodies: list[dict[str, Any]] = []
        self._told_at = self._bodies_at = -1e9
        self._bodies_by: Any = None
        self._loop = asyncio.get_running_loop()

    def look(self) -> None:
        """Listen to the mount's line and to the programs."""
        self.gateway.wire_log.sinks += [self.pulse.put, self._programs.put]
        self._told_at = -1e9

    def look_away(self) -> None:
        """Cost nothing any more."""
        for sink in (self.pulse.put, self._programs.put):
            self.gateway.wire_log.leave(sink)

    async def state(self) -> dict[str, Any]:
        """Everything that a page is shown of it."""
        controller = self.gateway.controller
        assert controller is not None
        state: dict[str, Any] = {}
        for part in view.parts(self.gateway, self._index):
            state |= part
            await turn()
        rate = self.pulse.rate(controller.now(), controller.line.answers)
        state["line"] |= {"rate": rate, "faults": self.pulse.faults}
        state["programs"] = await self._who_is_here()
        state["bodies"] = await self._on_the_sky()
        return state

    async def _who_is_here(self) -> list[dict[str, Any]]:
        """Anew after a while, and at once when one comes or goes."""
        now, many = self._loop.time(), sum(len(reception.connections()) for reception in self.gateway.receptions)
        if now - self._told_at >= PROGRAMS_FRESH or many != len(self._told):
            self._told_at = now
            self._told = await _gathered(self._programs.told(now), AT_ONCE)
        return self._told

    async def _on_the_sky(self) -> list[dict[str, Any]]:
        """Anew after a while, and at once when the site changes or the astronomy becomes exact."""
        controller = self.gateway.controller
        assert controller is not None
        now, by = self._loop.time(), (controller.sources.site(), controller.astrometry.sky.ready)
        fresh = BODIES_FRESH if len(self._bodies) == len(view.BODIES) else BODIES_MISSING
        if now - self._bodies_at >= fresh or by != self._bodies_by:
            self._bodies_at, self._bodies_by = now, by
            self._bodies = await _gathered(view.bodies(controller), 1)
        return self._bodies


async def _gathered(found: Iterable[dict[str, Any]], at_once: int) -> list[dict[str, Any]]:
    """All of them, so many in one piece."""
    kept = []
    for count, one in enumerate(found, 1):
        kept.append(one)
        if count % at_once == 0:
            await turn()
    return kept
