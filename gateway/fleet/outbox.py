"""What waits to be published: of every state the newest, of what has happened the last so many.

It never grows, however long the broker is away. One thread puts in, another takes out.
"""

from __future__ import annotations

import threading
from collections import deque

from gateway.fleet.topics import Message

#: Events that are kept for a broker that is away; the oldest are dropped.
EVENTS = 200


class Outbox:
    """``take`` gives states first: they say how it is now."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest: dict[str, Message] = {}
        self._waiting: dict[str, None] = {}
        self._events: deque[Message] = deque(maxlen=EVENTS)

    def put(self, message: Message) -> None:
        """One more; a state takes the place of the one before it."""
        with self._lock:
            if message.newest:
                self._newest[message.topic] = message
                self._waiting[message.topic] = None
            else:
                self._events.append(message)

    @property
    def any(self) -> bool:
        """Whether anything waits."""
        return bool(self._waiting or self._events)

    def take(self, most: int) -> list[Message]:
        """The next ones; they do not wait any more."""
        with self._lock:
            topics = list(self._waiting)[:most]
            for topic in topics:
                del self._waiting[topic]
            found = [self._newest[topic] for topic in topics]
            while self._events and len(found) < most:
                found.append(self._events.popleft())
            return found

    def again(self) -> None:
        """The broker may have forgotten everything: all states wait once more."""
        with self._lock:
            self._waiting = dict.fromkeys(self._newest)
