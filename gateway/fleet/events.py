"""What happens on a mount, as messages: refusals, faults, connections, and what has become of an order.

They are taken from the wire log. A program that reconnects for every command must not fill the broker: what is more
than a few a second is counted, and told as a number.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime

from gateway.core.wire_log import MOUNT, SKY_READY, Entry, show

#: Arrows of the wire log that are told, and what they are called.
KINDS = {"+": "connected", "-": "disconnected", "^": "port opened", "v": "port lost", "!": "refused"}
#: Events at once, and in a second after that; characters of one.
BURST, RATE, LONGEST = 20.0, 5.0, 500


class Events:
    """``publish`` takes an event as JSON. ``put`` is a sink of the wire log."""

    def __init__(self, publish: Callable[[bytes], None], clock: Callable[[], float]) -> None:
        self._publish, self._clock = publish, clock
        self._left, self._since, self._dropped = BURST, clock(), 0

    def put(self, entry: Entry) -> None:
        """One thing that has happened on the line or at a surface."""
        kind = KINDS.get(entry.arrow)
        if kind is None or entry.note == SKY_READY:
            return
        if entry.arrow == "!" and entry.side == MOUNT:
            kind = "note"
        self.tell(kind, entry.side, entry.note)

    def tell(self, kind: str, who: str, words: str) -> None:
        """The same in words; ``who`` is a program, the mount, or ``mqtt``."""
        now = self._clock()
        self._left = min(BURST, self._left + max(0.0, now - self._since) * RATE)
        self._since = now
        if self._left < 1.0:
            self._dropped += 1
            return
        self._left -= 1.0
        if self._dropped:
            self._send(now, "left out", MOUNT, f"{self._dropped} events, because there were too many")
            self._dropped = 0
        self._send(now, kind, who, words)

    def _send(self, now: float, kind: str, who: str, words: str) -> None:
        time = datetime.fromtimestamp(now, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
        told = {"time": time, "kind": kind, "who": show(who.encode()), "words": words[:LONGEST]}
        self._publish(json.dumps(told).encode())
