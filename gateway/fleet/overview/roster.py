"""What is known of all mounts on a broker: their newest states, which gateways are there, what an order has come to.

What comes from a broker may come from anybody: it has the form that is expected, or it is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
from msgspec import Struct

from gateway.fleet.topics import ONLINE, Heard, Topics

#: Gateway and mount.
_Name = tuple[str, str]
#: Mounts that are kept; characters of a text that is shown.
MOST, LONGEST = 5000, 200
#: Kinds of events that tell what has become of an order.
ENDS = ("done", "failed", "refused")


class State(Struct, frozen=True):
    """Of a state, what is shown."""

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


class Event(Struct, frozen=True):
    """Of an event, what is shown."""

    kind: str
    who: str = ""
    words: str = ""


class Roster:
    """``clock`` gives Unix seconds."""

    def __init__(self, prefix: str, clock: Callable[[], float]) -> None:
        self._topics, self._clock = Topics(prefix, "+"), clock
        self._available: dict[str, bool] = {}
        self._states: dict[_Name, tuple[State, float]] = {}
        self._ends: dict[_Name, tuple[Event, float]] = {}

    @property
    def subscriptions(self) -> list[str]:
        """Where all of that is told."""
        topics = self._topics
        return [topics.availability, topics.of("+", "state"), topics.of("+", "event")]

    def hear(self, heard: Heard) -> None:
        """Something was told on the broker."""
        match self._topics.parts(heard.topic):
            case [gateway, "availability"] if gateway in self._available or len(self._available) < MOST:
                self._available[gateway] = heard.payload == ONLINE
            case [gateway, mount, "state"]:
                self._put(self._states, (gateway, mount), heard, State)
            case [gateway, mount, "event"] if not heard.retained:
                self._put(self._ends, (gateway, mount), heard, Event)

    def _put(self, known: dict[_Name, tuple[Any, float]], of: _Name, heard: Heard, kind: Any) -> None:
        if not heard.payload:
            known.pop(of, None)  # that is how a retained message is taken away
            return
        try:
            value = msgspec.json.decode(heard.payload, type=kind)
        except (ValueError, RecursionError):
            return
        if isinstance(value, Event) and (value.kind not in ENDS or value.who != "mqtt"):
            return
        if of in known or len(known) < MOST:
            then = value.time if heard.retained and isinstance(value, State) else self._clock()
            known[of] = value, then

    def mounts(self) -> list[dict[str, Any]]:
        """As the page shows them, by name. ``age`` is how long ago the state was told, seconds."""
        now, found = self._clock(), []
        for (gateway, mount), (state, then) in sorted(self._states.items()):
            event, at = self._ends.get((gateway, mount), (None, 0.0))
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
