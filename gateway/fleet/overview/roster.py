"""Collects what is known of all mounts on a broker: newest states, connected gateways, results of orders.

Anyone may publish on a broker: a message that does not have the expected form is ignored.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
from msgspec import Struct

from gateway.fleet.topics import ONLINE, Received, Topics

#: Gateway and mount.
_Name = tuple[str, str]
#: The maximum number of mounts; the maximum length of a text that is shown.
MOST, LONGEST = 5000, 200
#: Kinds of events that report the result of an order.
RESULTS = ("done", "failed", "refused")


class ShownState(Struct, frozen=True):
    """The shown part of a mount's state."""

    online: bool = False
    does: str = ""
    ra_hours: float | None = None
    dec_degrees: float | None = None
    altitude_degrees: float | None = None
    azimuth_degrees: float | None = None
    moving: bool = False
    held: bool = False
    model: str | None = None
    programs: int = 0
    time: float = 0.0


class ShownEvent(Struct, frozen=True):
    """The shown part of an event."""

    kind: str
    who: str = ""
    words: str = ""


class Roster:
    """The mounts on a broker. ``clock`` returns Unix seconds."""

    def __init__(self, prefix: str, clock: Callable[[], float]) -> None:
        self._topics, self._clock = Topics(prefix, "+"), clock
        self._available: dict[str, bool] = {}
        self._states: dict[_Name, tuple[ShownState, float]] = {}
        self._results: dict[_Name, tuple[ShownEvent, float]] = {}

    @property
    def subscriptions(self) -> list[str]:
        """The topics to subscribe to."""
        topics = self._topics
        return [topics.availability, topics.of("+", "state"), topics.of("+", "event")]

    def receive(self, received: Received) -> None:
        """Take a message of the broker."""
        match self._topics.parts(received.topic):
            case [gateway, "availability"] if gateway in self._available or len(self._available) < MOST:
                self._available[gateway] = received.payload == ONLINE
            case [gateway, mount, "state"]:
                self._put(self._states, (gateway, mount), received, ShownState)
            case [gateway, mount, "event"] if not received.retained:
                self._put(self._results, (gateway, mount), received, ShownEvent)

    def _put(self, known: dict[_Name, tuple[Any, float]], of: _Name, received: Received, kind: Any) -> None:
        if not received.payload:
            known.pop(of, None)  # an empty payload deletes a retained message
            return
        try:
            value = msgspec.json.decode(received.payload, type=kind)
        except (ValueError, RecursionError):
            return
        if isinstance(value, ShownEvent) and (value.kind not in RESULTS or value.who != "mqtt"):
            return
        if of in known or len(known) < MOST:
            then = value.time if received.retained and isinstance(value, ShownState) else self._clock()
            known[of] = value, then

    def mounts(self) -> list[dict[str, Any]]:
        """Return the mounts as the page shows them, sorted by name. ``age`` is that of the state, in seconds."""
        now, found = self._clock(), []
        for (gateway, mount), (state, then) in sorted(self._states.items()):
            event, at = self._results.get((gateway, mount), (None, 0.0))
            found.append({
                "gateway": gateway[:LONGEST], "mount": mount[:LONGEST],
                "available": self._available.get(gateway, False), "online": state.online,
                "does": state.does[:LONGEST], "moving": state.moving, "held": state.held,
                "ra": state.ra_hours, "dec": state.dec_degrees, "alt": state.altitude_degrees,
                "az": state.azimuth_degrees, "model": (state.model or "")[:LONGEST], "programs": state.programs,
                "age": round(max(0.0, now - then)),
                "said": event.words[:LONGEST] if event else "", "said_age": round(max(0.0, now - at)) if event else 0,
            })  # fmt: skip
        return found
