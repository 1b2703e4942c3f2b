"""The cache of the mount's last readings, with the time of each, and of when clients asked for them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.signals import Signal

Kind = type[op.Operation]

#: Returned for a reading that is not cached or no longer fresh: it must be requested from the mount.
NOT_CACHED: Any = object()

#: The age in seconds up to which a reading is fresh.
MAX_AGE: dict[Kind, float] = {
    op.Position: 0.5, op.HorizontalPosition: 0.5, op.AxisPosition: 0.5, op.Slewing: 1.0, op.GetStatus: 6.0,
    op.GetIdentity: 1e9, op.PierSide: 5.0,
}  # fmt: skip
#: The period in seconds at which a reading is renewed while clients poll it.
POLL_PERIOD: dict[Kind, float] = {
    op.Position: 0.4, op.HorizontalPosition: 0.45, op.AxisPosition: 0.45, op.Slewing: 0.5, op.GetStatus: 2.5,
}  # fmt: skip
#: A reading counts as polled if a client asked for it within this many seconds.
POLLING = 3.0
#: Seconds for which clients still get the last position after the line went down.
LAST_POSITION = 10.0


class CachedValue(Struct):
    """A reading and the loop time at which it arrived."""

    value: Any
    at: float


class ReadingsCache:
    """The last readings by kind. ``changed`` is emitted with the kind whose reading was stored or forgotten."""

    def __init__(self) -> None:
        self._values: dict[Kind, CachedValue] = {}
        self._asked: dict[Kind, float] = {}
        self.changed: Signal[Kind] = Signal()

    def put(self, kind: Kind, value: Any, now: float) -> None:
        """Store a reading that the mount reported, or that follows from a command that it acknowledged."""
        self._values[kind] = CachedValue(value, now)
        self.changed.emit(kind)

    def forget(self, *kinds: Kind) -> None:
        """Forget the readings of these kinds: they are no longer true."""
        for kind in kinds:
            self._values.pop(kind, None)
            self.changed.emit(kind)

    def clear(self) -> None:
        """Forget everything: after a reconnect it may be another mount."""
        self.forget(*self._values)

    def touch(self, kinds: Iterable[Kind], now: float) -> None:
        for kind in kinds:
            self._asked[kind] = now

    def value(self, kind: Kind) -> Any:
        """Return the last reading, however old; None before the first."""
        cached = self._values.get(kind)
        return None if cached is None else cached.value

    def fresh(self, kind: Kind, now: float, patience: float, down: bool) -> Any:
        """Return the reading if fresh, else NOT_CACHED; ``patience`` (seconds) or a line ``down`` extend its life."""
        cached = self._values.get(kind)
        if cached is None or now - cached.at > (LAST_POSITION if down else max(MAX_AGE[kind], patience)):
            return NOT_CACHED
        return cached.value

    def poll(self, kind: Kind, now: float) -> Any:
        """Note that a client asks, and return the reading if it is fresh whatever the line, else NOT_CACHED."""
        self._asked[kind] = now
        cached = self._values.get(kind)
        return NOT_CACHED if cached is None or now - cached.at > min(MAX_AGE[kind], LAST_POSITION) else cached.value

    def until(self, kinds: list[Kind]) -> float:
        """Return the loop time until which the readings of these kinds are fresh."""
        return min(self._values[kind].at + MAX_AGE[kind] if kind in self._values else 0.0 for kind in kinds)

    def age(self, kind: Kind, now: float) -> float:
        """Return the seconds since the last reading."""
        cached = self._values.get(kind)
        return 1e9 if cached is None else now - cached.at

    def polled(self, kind: Kind, now: float) -> bool:
        return now - self._asked.get(kind, -1e9) <= POLLING
