"""What the mount said last, when it said it, and who has been asking.

``FRESH`` is how old an answer may be before it must be asked anew, ``RENEW`` how often it is renewed while anybody
polls.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.signals import Signal

Kind = type[op.Operation]

#: Nothing yet, or no longer fresh: the answer must be waited for.
MISSING: Any = object()

FRESH: dict[Kind, float] = {
    op.Position: 0.5, op.HorizontalPosition: 0.5, op.AxisPosition: 0.5, op.Slewing: 1.0, op.GetStatus: 6.0,
    op.GetIdentity: 1e9, op.PierSide: 5.0,
}  # fmt: skip
RENEW: dict[Kind, float] = {
    op.Position: 0.4, op.HorizontalPosition: 0.45, op.AxisPosition: 0.45, op.Slewing: 0.5, op.GetStatus: 2.5,
}  # fmt: skip
#: A client that asked within this time is still polling.
POLLING = 3.0
#: The last position is still told this long after the line went down.
LAST_POSITION = 10.0


class Seen(Struct):
    """An answer and the loop time at which it came."""

    value: Any
    at: float


class ReadingsCache:
    """Answers by kind of read. ``changed`` is emitted with the kind whose answer has come or was forgotten."""

    def __init__(self) -> None:
        self._seen: dict[Kind, Seen] = {}
        self._asked: dict[Kind, float] = {}
        self.changed: Signal[Kind] = Signal()

    def put(self, kind: Kind, value: Any, now: float) -> None:
        """The mount has told this, or what it has acknowledged says so."""
        self._seen[kind] = Seen(value, now)
        self.changed.emit(kind)

    def forget(self, *kinds: Kind) -> None:
        """What was told of these is not true any more."""
        for kind in kinds:
            self._seen.pop(kind, None)
            self.changed.emit(kind)

    def clear(self) -> None:
        """It may be another mount."""
        self.forget(*self._seen)

    def touch(self, kinds: Iterable[Kind], now: float) -> None:
        for kind in kinds:
            self._asked[kind] = now

    def value(self, kind: Kind) -> Any:
        """The last answer, however old; None before the first."""
        seen = self._seen.get(kind)
        return None if seen is None else seen.value

    def fresh(self, kind: Kind, now: float, patience: float, down: bool) -> Any:
        """The answer if it may still be told, else MISSING; on a slow or a lost line it lives longer."""
        seen = self._seen.get(kind)
        if seen is None or now - seen.at > (LAST_POSITION if down else max(FRESH[kind], patience)):
            return MISSING
        return seen.value

    def asked(self, kind: Kind, now: float) -> Any:
        """Somebody asks for this -> the answer where it is new enough on any line, else MISSING."""
        self._asked[kind] = now
        seen = self._seen.get(kind)
        return MISSING if seen is None or now - seen.at > min(FRESH[kind], LAST_POSITION) else seen.value

    def until(self, kinds: list[Kind]) -> float:
        """The loop time until which the answers of these kinds may be told."""
        return min(self._seen[kind].at + FRESH[kind] if kind in self._seen else 0.0 for kind in kinds)

    def age(self, kind: Kind, now: float) -> float:
        """Seconds since the last answer."""
        seen = self._seen.get(kind)
        return 1e9 if seen is None else now - seen.at

    def polled(self, kind: Kind, now: float) -> bool:
        return now - self._asked.get(kind, -1e9) <= POLLING
