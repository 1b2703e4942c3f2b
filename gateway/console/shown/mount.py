"""One mount as all pages see it: what is asked for anew each time, and what is kept for longer.

Kept is what was heard of its line, and what each program said last. The state is made in pieces: between two of them
programs are answered, and a stop is carried out.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.status import Rate
from gateway.console.shown import view
from gateway.console.shown.talk import Talk
from gateway.core.wire_log import MOUNT, Entry, show
from gateway.protocols.registry import ANY

#: Answer times that are kept for a page that has just come.
KEPT = 240

#: When (Unix seconds), and after how many milliseconds; None for a question that failed.
Sample = tuple[float, float | None]
#: Sides whose last words are kept; bytes that are shown of them.
MOST, SHOWN = 200, 40
#: Seconds for which Sun, Moon and planets stay where they were; while some are missing; programs and what they said.
BODIES_FRESH, BODIES_MISSING, PROGRAMS_FRESH = 10.0, 1.0, 1.0
#: Programs that are told in one piece; seconds between two pieces.
AT_ONCE, TURN = 10, 0.001


class Pulse:
    """Listens to the mount's side of a wire_log."""

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque(maxlen=KEPT)
        self.faults = 0
        self._new: deque[Sample] = deque(maxlen=KEPT)
        self._asked = 0.0
        self._rate = Rate()

    def put(self, entry: Entry) -> None:
        """A sink of the wire_log."""
        if entry.side != MOUNT:
            return
        if entry.arrow == ">":
            self._asked = entry.time
        elif entry.arrow == "<":
            failed = bool(entry.note)
            self.faults += failed
            self._new.append((round(entry.time, 3), None if failed else round((entry.time - self._asked) * 1e3, 1)))

    def take(self) -> list[Sample]:
        """What is new since the last time; from now on it is among the ``samples``."""
        new = list(self._new)
        self._new.clear()
        self.samples += new
        return new

    def rate(self, now: float, answers: int) -> float:
        """Exchanges a second, of late."""
        return round(self._rate.per_second(now, answers), 1)


class Programs:
    """Listens to the programs' side of a wire_log."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._last: dict[str, bytes] = {}
        self._counts: dict[str, int] = {}
        self._rates: dict[str, Rate] = {}

    def put(self, entry: Entry) -> None:
        """A sink of the wire_log."""
        side = entry.side
        if side == MOUNT:
            return
        if entry.arrow == "-":
            for known in (self._last, self._counts, self._rates):
                known.pop(side, None)
        elif entry.arrow == ">":
            if side not in self._last and len(self._last) >= MOST:
                return
            self._last[side] = entry.data
            self._counts[side] = self._counts.get(side, 0) + 1

    def told(self, now: float) -> Iterator[dict[str, Any]]:
        """Every connection: name, surface, profile, last command, commands a second, whether it only looks."""
        receptions = zip(self._gateway.names(), self._gateway.receptions, strict=False)
        here = [(surface, visit) for surface, reception in receptions for visit in reception.connections()]
        for surface, visit in here:
            client, side = visit.client, visit.client.log.name
            rate = self._rates.setdefault(side, Rate()).per_second(now, self._counts.get(side, 0))
            yield {
                "name": show(side.encode()), "surface": _spoken(surface, visit.protocol), "profile": visit.profile,
                "last": show(self._last.get(side, b"")[:SHOWN]), "rate": round(rate, 1),
                "read_only": client.runner.rights.read_only,
            }  # fmt: skip


def _spoken(surface: str, protocol: str) -> str:
    """Where a program is connected; where every protocol is spoken, with the one that it speaks."""
    what, at, where = surface.partition("@")
    return f"{protocol}{at}{where}" if what == ANY else surface


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
            self.gateway.wire_log.remove(sink)

    async def state(self) -> dict[str, Any]:
        """Everything that a page is shown of it."""
        controller = self.gateway.controller
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
