"""The conversation as a page shows it: both sides' bytes in words, and which of them belong together.

A program's command gets a number; what goes over the mount's line until that command is answered, and the answer,
bear the same one. Nobody but a page that shows it costs anything: the sink is taken out when the last one leaves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from gateway.app.bindings import speech
from gateway.app.config import parse_endpoint
from gateway.app.gateway import Gateway
from gateway.core.wire_log import Entry, show
from gateway.diagnostics.log.layout import Row
from gateway.diagnostics.log.printing import MOUNT, Rows

#: Rows that wait for a page; the oldest are dropped, and that is said.
MOST = 400
#: How many seconds an unanswered command may still be what the mount is asked for.
RECENT = 3.0


class Talk:
    """The rows of one mount for everybody who looks. ``programs`` are the last command and the rate, by side."""

    def __init__(self, gateway: Gateway, index: int) -> None:
        self._gateway, self._index = gateway, index
        self._listeners: set[Callable[[dict[str, Any]], None]] = set()
        self._number = 0
        self._open: dict[str, tuple[int, float]] = {}
        self._asked: int | None = None
        self._rows = self._fresh()

    def _fresh(self) -> Rows:
        surfaces = [endpoint.protocol for endpoint in self._gateway.endpoints]
        return Rows(parse_endpoint(self._gateway.config.at).protocol, surfaces, speech)

    def listen(self, listener: Callable[[dict[str, Any]], None]) -> Callable[[], None]:
        """Hand every row to a listener -> what ends that."""
        if not self._listeners:
            self._rows, self._open, self._asked = self._fresh(), {}, None
            self._gateway.wire_log.sinks.append(self._put)
        self._listeners.add(listener)
        return lambda: self._leave(listener)

    def _leave(self, listener: Callable[[dict[str, Any]], None]) -> None:
        self._listeners.discard(listener)
        if not self._listeners:
            self._gateway.wire_log.leave(self._put)

    def _put(self, entry: Entry) -> None:
        pair = self._pair(entry)
        for row in self._rows.take(entry):
            told = as_row(row, self._index, pair)
            for listener in list(self._listeners):
                listener(told)

    def _pair(self, entry: Entry) -> int | None:
        """Which command of a program this belongs to, as far as that can be told from the order of things."""
        if entry.side != MOUNT and entry.arrow == ">":
            self._number += 1
            self._open[entry.side] = (self._number, entry.time)
            return self._number
        if entry.side != MOUNT:
            number = self._open.get(entry.side, (None, 0.0))[0]
            if entry.arrow in "<-":  # a refusal is noted first, and the reply that says it follows
                self._open.pop(entry.side, None)
            return number
        if entry.arrow == ">":  # what the mount answers then belongs to the same command, however late it comes
            waiting = [number for number, at in self._open.values() if entry.time - at <= RECENT]
            self._asked = max(waiting, default=None)
        return self._asked


class Newest:
    """What waits for one page: no more than it can be shown, the newest of it."""

    def __init__(self) -> None:
        self._rows: deque[dict[str, Any]] = deque(maxlen=MOST)

    def add(self, row: dict[str, Any]) -> None:
        """One more; where there are too many the oldest goes."""
        self._rows.append(row)

    def take(self) -> list[dict[str, Any]]:
        """All that waits."""
        rows, self._rows = list(self._rows), deque(maxlen=MOST)
        return rows


def as_row(row: Row, index: int, pair: int | None) -> dict[str, Any]:
    """A row as the page gets it: bytes become printable text here, and the page shows it as text, never as markup."""
    return {
        "mount": index, "time": round(row.time, 3), "side": show(row.side.encode()), "arrow": row.arrow,
        "data": show(row.data), "words": row.words, "kind": row.kind, "pair": pair,
    }  # fmt: skip
