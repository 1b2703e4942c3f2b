"""The conversation as a page shows it: both sides' bytes in words, and which of them belong together.

A program's command gets a number; what goes over the mount's line until that command is answered, and the answer,
bear the same one. Only while a page shows it is anything done, and then not in the call in which it is said.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

from gateway.app.gateway import Gateway
from gateway.core.wire_log import MOUNT, Entry, show
from gateway.diagnostics.log.layout import Row
from gateway.diagnostics.log.printing import Rows

#: Rows that are kept for pages; things that were said and wait to be put into words. The oldest are dropped.
MOST, WAITING = 400, 2000
#: How many seconds an unanswered command may still be what the mount is asked for.
RECENT = 3.0


class Talk:
    """What was said at one mount: kept as it is when it is said, and put into words when pages are to be shown it."""

    def __init__(self, gateway: Gateway, index: int) -> None:
        self._gateway, self._index = gateway, index
        self._entries: deque[Entry] = deque(maxlen=WAITING)
        self._listening = False
        self._number = 0
        self._open: dict[str, tuple[int, float]] = {}
        self._asked: int | None = None
        self._rows = self._fresh()

    def _fresh(self) -> Rows:
        surfaces = [endpoint.protocol for endpoint in self._gateway.endpoints]
        return Rows(self._gateway.mount.protocol, surfaces)

    def listen(self, on: bool) -> None:
        """Somebody is shown it from now on, or nobody any more."""
        if on == self._listening:
            return
        self._listening, wire_log = on, self._gateway.wire_log
        if on:
            self._rows, self._open, self._asked = self._fresh(), {}, None
            wire_log.sinks.append(self._entries.append)
        else:
            self._entries.clear()
            wire_log.remove(self._entries.append)

    def take(self) -> Iterator[dict[str, Any]]:
        """The rows of what was said since the last time, one by one."""
        while self._entries:
            entry = self._entries.popleft()
            pair = self._pair(entry)
            for row in self._rows.take(entry):
                yield as_row(row, self._index, pair)

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


def as_row(row: Row, index: int, pair: int | None) -> dict[str, Any]:
    """A row as the page gets it: bytes become printable text here, and the page shows it as text, never as markup."""
    return {
        "mount": index, "time": round(row.time, 3), "side": show(row.side.encode()), "arrow": row.arrow,
        "data": show(row.data), "words": row.words, "kind": row.kind, "pair": pair,
    }  # fmt: skip
