"""The commands of one connection that wait for their turn, in the order in which they came."""

from __future__ import annotations

from collections import deque

from gateway.clients.commands.client_log import ClientLog
from gateway.clients.commands.turn import Turn

#: Commands that may wait in one connection; of more than that the oldest are dropped.
INBOX = 256


class Inbox:
    """Whatever leaves it other than by ``take`` is told to the log."""

    def __init__(self, log: ClientLog) -> None:
        self._log = log
        self._waiting: deque[Turn] = deque(maxlen=INBOX)

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, turn: Turn) -> None:
        """The newest; the oldest makes room for it."""
        if len(self._waiting) == INBOX:
            self._log.put("x", self._waiting[0].frame, f"more than {INBOX} commands wait")
        self._waiting.append(turn)

    def take(self) -> Turn:
        """The oldest, which there must be."""
        turn = self._waiting.popleft()
        self._log.put(">", turn.frame)
        return turn

    def take_repeated(self, frame: bytes) -> int:
        """How often this follows at once; what is done for one of them does for all."""
        count = 0
        while self._waiting and self._waiting[0].frame == frame:
            self.take()
            count += 1
        return count

    def take_back(self, frames: frozenset[bytes], by: bytes) -> None:
        """Whatever would begin what ``by`` ends is not done any more."""
        for turn in [turn for turn in self._waiting if turn.frame in frames]:
            self._waiting.remove(turn)
            self._log.put("x", turn.frame, f"taken back by {by!r}, which came before its turn")
