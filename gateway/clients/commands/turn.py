"""The state of one connection: the commands that wait for their turn, and the replies and readings it was sent.

A command is answered within a limited time or never. A reply that was made only of cached readings is valid as long as
they are: until one of them is renewed, which increments ``version``, or expires.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import NamedTuple

from msgspec import Struct

from gateway.core.operations import Operation
from gateway.core.wire_log import ClientLog
from gateway.mount.motion.taps import LONGEST_HELD
from gateway.protocols.base.surface import Ending
from gateway.protocols.base.wants import Handling

#: Used as a count of stops: sent before all of them, by a client that may be gone. Such a command begins no motion and
#: keeps none alive.
LONG_AGO = -1
#: Seconds after which a reply is no longer sent: clients have given up by then and would take it for the reply to the
#: next command (NexStar protocol: the hand control answers within 3.5 s). The mount gets a little less time, so that
#: commands which arrived together with one that it does not answer are still answered.
ANSWER_WITHIN, WAIT_FOR_MOUNT = 3.5, 3.4
#: Seconds after which a motion that has not begun is refused, while a reply is still possible.
REFUSE_AFTER = 3.0
#: Commands that may wait in one connection; beyond that the oldest are dropped.
INBOX = 256


class Turn(Struct, eq=False):
    """A command and the ``steps`` that carry it out; it ``arrived`` at this loop time, after ``stops`` stops.

    ``ending`` is the motion that it ended on arrival. ``reusable``: its reply depends only on the cached
    ``readings``. ``ended_motion``: the last thing it did was to end a motion. ``lasting``: its reply may take until the
    next command. ``late``: its reply is no longer sent. ``baud``: the rate to use after its reply. ``held``: seconds
    after which the arrow that it presses was released, before its turn.
    """

    frame: bytes
    steps: Handling
    stops: int
    ending: Ending | None
    arrived: float
    readings: list[type[Operation]] = []
    reusable: bool = True
    ended_motion: bool = False
    lasting: bool = False
    late: bool = False
    baud: int | None = None
    held: float | None = None
    timer: asyncio.TimerHandle | None = None


class Inbox(deque[Turn]):
    """The commands that wait, in the order of arrival. Commands that are removed other than by ``take`` are logged."""

    def __init__(self, log: ClientLog) -> None:
        super().__init__(maxlen=INBOX)
        self._log = log

    def add(self, turn: Turn) -> None:
        """Add a command; if the inbox is full, the oldest is dropped."""
        if len(self) == INBOX:
            self._log.put("x", self[0].frame, f"more than {INBOX} commands wait")
        self.append(turn)

    def take(self) -> Turn:
        """Remove and return the oldest command. There must be one."""
        turn = self.popleft()
        self._log.put(">", turn.frame)
        return turn

    def take_repeated(self, frame: bytes) -> int:
        """Remove the repetitions of this command that follow directly, and return their number."""
        count = 0
        while self and self[0].frame == frame:
            self.take()
            count += 1
        return count

    def release(self, presses: frozenset[bytes], now: float) -> bool:
        """Note the release of the newest of these presses, and remove those before it. Return whether one waits.

        One that has waited for too long does not count.
        """
        waiting = [turn for turn in self if turn.frame in presses]
        if not waiting or now - waiting[-1].arrived > LONGEST_HELD:
            return False
        for turn in waiting[:-1]:
            if turn.held is None:
                self.remove(turn)
        if waiting[-1].held is None:
            waiting[-1].held = now - waiting[-1].arrived
        return True

    def take_back(self, frames: frozenset[bytes], by: bytes) -> None:
        """Remove the commands that would begin what ``by`` ends."""
        for turn in [turn for turn in self if turn.frame in frames]:
            self.remove(turn)
            self._log.put("x", turn.frame, f"cancelled by {by!r}, which arrived before its turn")


Kinds = list[type[Operation]]

#: Different commands whose replies are cached.
MAX_REPLIES = 32
#: Seconds within which two coordinates that are requested one by one are taken from the same reading.
SAME_INSTANT = 1.0


class _SentReading(NamedTuple):
    """A reading as it was sent, its time, and the version at that time."""

    value: object
    at: float
    version: int


class ReplyCache:
    """Caches replies by command and readings by kind. Times are those of the event loop, seconds."""

    def __init__(self) -> None:
        self._replies: dict[bytes, tuple[bytes, Kinds]] = {}
        self._version, self._until = -1, 0.0
        self._readings: dict[type[Operation], _SentReading] = {}

    def reply(self, command: bytes, version: int, now: float) -> tuple[bytes, Kinds] | None:
        """Return the cached reply to this command and the kinds of readings it was made of; None if it is not valid."""
        return self._replies.get(command) if self._version == version and now < self._until else None

    def remember(self, command: bytes, reply: bytes, kinds: Kinds, version: int, now: float, until: float) -> None:
        """Cache a reply that is valid until this time."""
        if self._version != version or now >= self._until or len(self._replies) >= MAX_REPLIES:
            self._replies.clear()
            self._version, self._until = version, float("inf")
        self._replies[command] = reply, kinds
        self._until = min(self._until, until)

    def clear(self) -> None:
        """Forget all replies, because something was changed or may have been."""
        self._replies.clear()

    def remember_reading(self, operation: Operation, value: object, now: float, version: int) -> None:
        self._readings[type(operation)] = _SentReading(value, now, version)

    def recent_reading(self, operation: Operation, now: float) -> tuple[object, int] | None:
        """Return the reading that was sent a moment ago, and the version at that time; None if that is too long ago."""
        sent = self._readings.get(type(operation))
        return None if sent is None or now - sent.at >= SAME_INSTANT else (sent.value, sent.version)
