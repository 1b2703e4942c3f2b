"""What the mount said last, when it said it, and who has been asking.

``FRESH`` is how old an answer may be before it must be asked anew, ``RENEW`` how often it is renewed while anybody
polls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from gateway.core import operations as op

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
    """Answers by kind of read. ``version`` grows whenever one changes."""

    def __init__(self) -> None:
        self.version = 0
        self.seen: dict[Kind, Seen] = {}
        self.asked: dict[Kind, float] = {}
        #: Called with the kind whose answer has come or was forgotten.
        self.changed: Callable[[Kind], None] = lambda kind: None

    def put(self, kind: Kind, value: Any, now: float) -> None:
        self.seen[kind] = Seen(value, now)
        self.version += 1
        self.changed(kind)

    def forget(self, *kinds: Kind) -> None:
        for kind in kinds:
            self.seen.pop(kind, None)
            self.changed(kind)
        self.version += 1

    def clear(self) -> None:
        self.forget(*self.seen)

    def value(self, kind: Kind) -> Any:
        """The last answer, however old; None before the first."""
        seen = self.seen.get(kind)
        return None if seen is None else seen.value

    def fresh(self, kind: Kind, now: float, patience: float, down: bool) -> Any:
        """The answer if it may still be told, else MISSING; on a slow or a lost line it lives longer."""
        seen = self.seen.get(kind)
        if seen is None or now - seen.at > (LAST_POSITION if down else max(FRESH[kind], patience)):
            return MISSING
        return seen.value

    def until(self, kinds: list[Kind]) -> float:
        """The loop time until which the answers of these kinds may be told."""
        return min(self.seen[kind].at + FRESH[kind] if kind in self.seen else 0.0 for kind in kinds)

    def age(self, kind: Kind, now: float) -> float:
        seen = self.seen.get(kind)
        return 1e9 if seen is None else now - seen.at

    def polled(self, kind: Kind, now: float) -> bool:
        """Whether somebody has asked for it lately."""
        return now - self.asked.get(kind, -1e9) <= POLLING
