"""What the broker is told of a mount: how it is, and what happens on it.

The state is made of what is known without asking the mount. Angles are told as finely as somebody who looks can use, so
that a mount that stands is told once and not every second. Events are taken from the wire log. A program that
reconnects for every command must not fill the broker: what is more than a few a second is counted, and told as a
number.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from gateway.app.control.gather import look
from gateway.app.gateway import Gateway
from gateway.app.status import does
from gateway.core import operations as op
from gateway.core.wire_log import MOUNT, SKY_READY, Entry, show

#: Arrows of the wire log that are told, and what they are called.
KINDS = {"+": "connected", "-": "disconnected", "^": "port opened", "v": "port lost", "!": "refused"}
#: Events at once, and in a second after that; characters of one.
BURST, RATE, LONGEST = 20.0, 5.0, 500


def state(gateway: Gateway) -> dict[str, Any]:
    """What is not known is None."""
    controller = gateway.controller
    assert controller is not None
    seen = look(controller, gateway.config.name or "", str(gateway.mount), len(gateway.programs()))
    identity: op.Identity | None = controller.cache.value(op.GetIdentity)
    status = seen.status
    return {
        "online": seen.state in ("up", "busy"),
        "does": does(seen) or seen.state,
        **_places(gateway, seen.position),
        "tracking": None if status is None else status.tracking is not op.Tracking.OFF,
        "moving": seen.slewing or seen.by_hand,
        "aligned": None if status is None else status.aligned,
        "asleep": seen.asleep,
        "held": seen.held,
        "product": identity.product if identity else None,
        "model": identity.model if identity else None,
        "version": identity.version if identity else None,
        "line": {"state": seen.state, "reason": seen.reason, "answer_seconds": round(controller.line.typical, 2)},
        "programs": seen.programs,
    }


def _places(gateway: Gateway, seen: op.Equatorial | None) -> dict[str, float | None]:
    assert gateway.controller is not None
    derived = gateway.controller.astrometry
    over = None if seen is None or derived.site_clock.site() is None else derived.horizon(seen)
    return {
        "ra_hours": None if seen is None else round(seen.ra / 15.0, 5),
        "dec_degrees": None if seen is None else round(seen.dec, 4),
        "altitude_degrees": None if over is None else round(over.alt, 2),
        "azimuth_degrees": None if over is None else round(over.az, 2),
    }


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
