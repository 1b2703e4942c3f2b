"""The programs that are connected: where from, to which surface, what they said last, and how often they speak."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.status import Rate
from gateway.core.wire_log import MOUNT, Entry, show
from gateway.protocols.registry import ANY

#: Sides whose last words are kept; bytes that are shown of them.
MOST, SHOWN = 200, 40


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
