"""The programs that are connected: where from, to which surface, what they said last, and how often they speak."""

from __future__ import annotations

from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.status import Rate
from gateway.core.wire_log import Entry, show
from gateway.diagnostics.log.printing import MOUNT

#: Sides whose last words are kept.
MOST = 200


class Programs:
    """Listens to the programs' side of a wire_log."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._last: dict[str, str] = {}
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
            self._last[side] = show(entry.data[:40])
            self._counts[side] = self._counts.get(side, 0) + 1

    def told(self, now: float) -> list[dict[str, Any]]:
        """Every connection: name, surface, profile, last command, commands a second, whether it only looks."""
        names, found = self._gateway.names(), []
        for name, reception in zip(names, self._gateway.receptions, strict=False):
            for visit in reception.connections():
                client, side = visit.client, visit.client.log.name
                rate = self._rates.setdefault(side, Rate()).per_second(now, self._counts.get(side, 0))
                found.append({
                    "name": show(side.encode()), "surface": name, "profile": visit.profile,
                    "last": self._last.get(side, ""), "rate": round(rate, 1),
                    "read_only": client.runner.rights.read_only,
                })  # fmt: skip
        return found
