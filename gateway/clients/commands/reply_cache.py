"""What one client was told: whole replies that are good again, and single readings for the other half of a pair.

A reply that was made of readings at hand alone is good again for as long as they are: until one of them is renewed,
which ``version`` counts, or grows old.
"""

from __future__ import annotations

from typing import NamedTuple

from gateway.core.operations import Operation

Kinds = list[type[Operation]]

#: Different commands whose replies are remembered.
MEMO = 32
#: A half that is asked for within this many seconds of the other one belongs to the same instant.
PAIR = 1.0


class _Told(NamedTuple):
    """What was told by a read, when, and the version then."""

    value: object
    at: float
    version: int


class ReplyCache:
    """Replies by command, readings by kind. Times are those of the event loop."""

    def __init__(self) -> None:
        self._replies: dict[bytes, tuple[bytes, Kinds]] = {}
        self._version, self._until = -1, 0.0
        self._told: dict[type[Operation], _Told] = {}

    def reply(self, command: bytes, version: int, now: float) -> tuple[bytes, Kinds] | None:
        """The reply to this command where it is good again, and the kinds of readings it was made of."""
        return self._replies.get(command) if self._version == version and now < self._until else None

    def remember(self, command: bytes, reply: bytes, kinds: Kinds, version: int, now: float, until: float) -> None:
        """A reply that is good until this time."""
        if self._version != version or now >= self._until or len(self._replies) >= MEMO:
            self._replies.clear()
            self._version, self._until = version, float("inf")
        self._replies[command] = reply, kinds
        self._until = min(self._until, until)

    def clear(self) -> None:
        """No reply is good any more: something was done, or may have been."""
        self._replies.clear()

    def told(self, operation: Operation, value: object, now: float, version: int) -> None:
        """The client was told this reading."""
        self._told[type(operation)] = _Told(value, now, version)

    def again(self, operation: Operation, now: float) -> tuple[object, int] | None:
        """The reading it was told a moment ago, and the version then; None when that is too long ago."""
        told = self._told.get(type(operation))
        return None if told is None or now - told.at >= PAIR else (told.value, told.version)
