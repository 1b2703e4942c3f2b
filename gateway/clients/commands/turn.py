"""What one connection has to do and has done: the commands that wait for their turn, and what it was told.

A command has a reply within a limited time or none. A reply that was made of readings at hand alone is good again for
as long as they are: until one of them is renewed, which ``version`` counts, or grows old.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import NamedTuple

from msgspec import Struct

from gateway.core.operations import Operation
from gateway.core.wire_log import ClientLog
from gateway.protocols.base.surface import Ending
from gateway.protocols.base.wants import Handling

#: In the place of the count of stops: it was sent before all of them, and nobody may be there any more who sent it. It
#: begins no motion and holds none.
LONG_AGO = -1
#: Seconds after which a reply is not given any more: programs have gone on by then, and would take it for that of the
#: next (NexStar protocol: the hand control answers within 3.5 s). The mount is waited for a little less long, so that
#: what came together with a command which it does not answer is answered itself.
ANSWER_WITHIN, WAIT_FOR_MOUNT = 3.5, 3.4
#: A motion that is not begun so many seconds after it was asked for is refused, while that can still be said.
NO_IN_TIME = 3.0
#: Commands that may wait in one connection; of more than that the oldest are dropped.
INBOX = 256


class Turn(Struct, eq=False):
    """A command and the ``steps`` that carry it out; it ``came`` at this loop time, after so many stops.

    ``ending`` is what it has ended already, when it came. ``plain`` and ``spent`` say whether its reply may be
    repeated, ``halting`` that it has ended a motion last, ``baud`` the rate to go on with after its answer. It is
    ``late`` once nobody waits for its reply any more.
    """

    frame: bytes
    steps: Handling
    stops: int
    ending: Ending | None
    came: float
    spent: list[type[Operation]] = []
    plain: bool = True
    halting: bool = False
    lasting: bool = False
    late: bool = False
    baud: int | None = None
    timer: asyncio.TimerHandle | None = None


class Inbox(deque[Turn]):
    """What waits, in the order in which it came. Whatever leaves it other than by ``take`` is told to the log."""

    def __init__(self, log: ClientLog) -> None:
        super().__init__(maxlen=INBOX)
        self._log = log

    def add(self, turn: Turn) -> None:
        """The newest; the oldest makes room for it."""
        if len(self) == INBOX:
            self._log.put("x", self[0].frame, f"more than {INBOX} commands wait")
        self.append(turn)

    def take(self) -> Turn:
        """The oldest, which there must be."""
        turn = self.popleft()
        self._log.put(">", turn.frame)
        return turn

    def take_repeated(self, frame: bytes) -> int:
        """How often this follows at once; what is done for one of them does for all."""
        count = 0
        while self and self[0].frame == frame:
            self.take()
            count += 1
        return count

    def take_back(self, frames: frozenset[bytes], by: bytes) -> None:
        """Whatever would begin what ``by`` ends is not done any more."""
        for turn in [turn for turn in self if turn.frame in frames]:
            self.remove(turn)
            self._log.put("x", turn.frame, f"taken back by {by!r}, which came before its turn")


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
        self._told[type(operation)] = _Told(value, now, version)

    def again(self, operation: Operation, now: float) -> tuple[object, int] | None:
        """The reading it was told a moment ago, and the version then; None when that is too long ago."""
        told = self._told.get(type(operation))
        return None if told is None or now - told.at >= PAIR else (told.value, told.version)
